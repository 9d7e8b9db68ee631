"""What the programs print, whoever wrote it."""

import io
import re
import sys
from pathlib import Path

import pytest
import structlog
from rich.table import Table
from rich.text import Text

from chefbotd.cli.common.console import Printer
from chefbotd.cli.common.echo import echo, tell
from chefbotd.cli.common.state_text import Fact
from chefbotd.process import logs

HOSTILE = "\x1b]0;title\x07\x1b[8mhidden\x9b2J\u202e"
PACKAGE = Path(logs.__file__).parents[1]


def is_plain(text: str) -> bool:
    """Whether there is no character that only a hostile text brings."""
    return not set(text) & set("\x07\x9b\u202e") and "\x1b[8m" not in text and "\x1b]" not in text


def test_lines(capsys: pytest.CaptureFixture[str]) -> None:
    """On both outputs; the program's own colours stay."""
    echo(HOSTILE, styled="\x1b[1mword\x1b[0m")
    tell(HOSTILE)
    printed = capsys.readouterr()
    assert is_plain(printed.out)
    assert is_plain(printed.err)


def test_tables_and_status_lines() -> None:
    """Tables keep their colours."""
    output = io.StringIO()
    console = Printer(file=output, force_terminal=True, color_system="standard", width=100)
    table = Table("name")
    table.add_row(Text(HOSTILE, style="red"))
    console.print(table)
    with console.status(HOSTILE):
        pass
    assert is_plain(output.getvalue())
    assert "\x1b[31m" in output.getvalue()
    assert is_plain(Fact("link", HOSTILE).text)


def test_logs_on_a_terminal() -> None:
    """Events, fields, lists and tracebacks; the log's own colours stay."""
    *processors, renderer = logs._renderers(on_terminal=True)
    try:
        raise ValueError(HOSTILE)
    except ValueError:
        event = {
            "event": HOSTILE,
            "level": "error",
            "field": HOSTILE,
            "lines": [HOSTILE],
            "map": {"a": HOSTILE},
        }
        event["exc_info"] = sys.exc_info()
    for processor in processors:
        event = processor(None, "error", event)
    text = str(renderer(structlog, "error", event))
    assert is_plain(text)
    assert "hidden" in text


def test_no_program_prints_in_another_way() -> None:
    """Only the common modules print lines and make consoles, so that none is forgotten."""
    allowed = {"echo.py", "console.py", "manual.py"}
    for path in (PACKAGE / "cli").rglob("*.py"):
        found = re.search(r"click\.s?echo\(|(?<!\w)Console\(", path.read_text(encoding="utf-8"))
        assert found is None or path.name in allowed, f"{path}: {found.group() if found else ''}"
