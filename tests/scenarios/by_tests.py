"""Rows of docs/safety.md that happen to no simulated robot: ``make faults`` runs their tests instead.

docs/safety_tests.md names them. They need a browser, a terminal, a broker, a second program or a disk of their own.
"""

import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from tests.scenarios.fault_run import Result, not_applicable

ROOT = Path(__file__).parents[2]
TESTS_PAGE = ROOT / "docs" / "safety_tests.md"
LONGEST_S = 900.0

NOT_INJECTED: Mapping[str, str] = {
    "Gamepad's": "its tests have a pad",
    "Enable button": "its tests have a pad",
    "Terminal of": "its tests have a terminal",
    "The page's": "its tests have a browser",
    "The program ends while the port is being opened": "its test has a port that takes its time",
    "The daemon starts again after it was killed": "its test starts two programs",
    "The daemon starts again after it ended": "its test starts two programs",
    "The latch cannot be written": "its test has no board",
    "Obstacle that only a depth camera sees": "its test has a taller robot",
    "A depth camera is gone": "its tests have a camera",
    "The disk with recordings": "its tests have a disk of their own",
    "Crowd at the page": "its tests have a page",
    "File in our folders": "its tests have no robot",
    "Plug-in that raises or hangs": "its tests install plug-ins",
    "`chefbotctl doctor`, which drives": "its tests start the doctor",
    "The program is killed, or the power fails": "its test kills a program that saves",
    "The worker cannot work here": "its test has another worker",
    "The daemon dies while it has a worker": "its test starts a program of its own",
    "A command of navigation": "its test is the driver",
    "A lidar's or a board's port stalls": "its tests have ports that stall",
    "Add-on": "its tests have the add-on, and no robot",
}
"""Rows by how they begin, and where they happen instead."""


@dataclass(frozen=True, slots=True)
class TestedRow:
    """A row and its tests, as pytest names them."""

    __test__ = False

    row: str
    name: str
    tests: tuple[str, ...]
    robots: tuple[str, ...] = ("chefbot",)


def tests_of_rows() -> dict[str, tuple[str, ...]]:
    """The tests of each row, under its first cell; none in an installed package, which has no documentation."""
    if not TESTS_PAGE.exists():
        return {}
    text = TESTS_PAGE.read_text(encoding="utf-8")
    entries = re.findall(r"^\*\*(.*)\*\*\n\n((?:- .*\n)+)", text, re.MULTILINE)
    return {title: tuple(re.findall(r"^- `(.*)`$", listed, re.MULTILINE)) for title, listed in entries}


def tested_rows(injected: frozenset[str]) -> tuple[TestedRow, ...]:
    """All that no fault is injected for; ``injected`` has how the rows of the others begin."""
    return tuple(
        [
            TestedRow(row, f"by its tests: {_short(row)}", tests)
            for row, tests in tests_of_rows().items()
            if row.startswith(tuple(NOT_INJECTED)) and not row.startswith(tuple(injected))
        ]
    )


def _short(row: str) -> str:
    words = re.sub(r"[`*]", "", row).partition(":")
    text = words[0] if words[0] != "Add-on" else words[2].strip()
    return text if len(text) <= 60 else f"{text[:57].rpartition(' ')[0]} ..."


def attempt(row: TestedRow, robot_name: str) -> Result:
    """Run those tests of a row that `make test` runs, too, in a process of their own."""
    add_ons = {path.split("/")[1] for path in row.tests if path.startswith("addons/")}
    missing = sorted(name for name in add_ons if find_spec(name.replace("-", "_")) is None)
    if missing:
        return not_applicable(robot_name, row.name, f"{', '.join(missing)} is not installed")
    command = [sys.executable, "-m", "pytest", "-q", "-m", "not slow", "-p", "no:cacheprovider", *row.tests]
    try:
        ran = subprocess.run(
            command, cwd=ROOT, check=False, capture_output=True, text=True, timeout=LONGEST_S
        )
    except subprocess.TimeoutExpired:
        return _result(robot_name, row, (f"its tests did not end within {LONGEST_S:g} s",))
    (*_, summary) = ran.stdout.strip().splitlines() or ("",)
    if ran.returncode == 0 and "passed" not in summary:
        return not_applicable(robot_name, row.name, f"its tests were skipped here: {summary.strip('= ')}")
    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", ran.stdout, re.MULTILINE)
    wrong = tuple(failed or (f"pytest ended with {ran.returncode}",)) if ran.returncode else ()
    return _result(robot_name, row, wrong)


def _result(robot_name: str, row: TestedRow, wrong: tuple[str, ...]) -> Result:
    return Result(robot_name, row.name, None, None, None, 0, 0, wrong, outcome="as its tests say")
