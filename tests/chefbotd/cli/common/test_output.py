"""What is drawn on a terminal only."""

import io

from rich.console import Console

from chefbotd.cli.common.output import countdown


def drawn(console: Console) -> str:
    """A countdown of 5 s, 2.5 s in."""
    with countdown(5.0, console) as report:
        report(2.5)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_a_countdown_on_a_terminal() -> None:
    """The seconds gone by are drawn as they pass."""
    assert "2.5 of 5.0 s" in drawn(Console(file=io.StringIO(), force_terminal=True, width=80))


def test_no_countdown_in_a_file() -> None:
    """A log or a script gets no bar."""
    assert drawn(Console(file=io.StringIO())) == ""
