"""Every command where no extra and no add-on is installed."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from chefbotd.cli.common.exits import Exit
from chefbotd.extras import how_to_add_extra
from tests.core_install import ELSEWHERE, NEEDS
from tests.waiting import PATIENCE_S

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def rows() -> dict[str, dict[str, Any]]:
    """How each command ended, by its words."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.core_install", "--hide"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    return {row["command"]: row for row in map(json.loads, done.stdout.splitlines())}


def test_no_command_ends_in_a_traceback(rows: dict[str, dict[str, Any]]) -> None:
    """Each of them ends with an exit code of its own, whatever is missing."""
    assert len(rows) > 70
    assert {line: row["problem"] for line, row in rows.items() if row["problem"]} == {}


@pytest.mark.parametrize(("command", "extra"), NEEDS.items(), ids=NEEDS)
def test_what_needs_an_extra_says_how_to_add_it(
    rows: dict[str, dict[str, Any]], command: str, extra: str
) -> None:
    """Exit code 7, and the command that adds the extra to this installation."""
    assert rows[command]["exit_code"] == Exit.NOT_INSTALLED, rows[command]
    assert how_to_add_extra(extra) in rows[command]["output"]


@pytest.mark.parametrize(("command", "where"), ELSEWHERE.items(), ids=ELSEWHERE)
def test_what_is_elsewhere_says_where(rows: dict[str, dict[str, Any]], command: str, where: str) -> None:
    """Exit code 7, and the add-on or the target of make."""
    assert rows[command]["exit_code"] == Exit.NOT_INSTALLED, rows[command]
    assert where in rows[command]["output"]


def test_what_needs_no_extra_asks_for_none(rows: dict[str, dict[str, Any]]) -> None:
    """It works, or says what is wrong besides: no daemon answers, no board is there, no program flashes."""
    for command in rows.keys() - NEEDS.keys() - ELSEWHERE.keys():
        assert "chefbotd[" not in rows[command]["output"], command
