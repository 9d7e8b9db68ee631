"""What a run of the tests promises: one that carried out no test has not passed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.budget import FAST_EXAMPLES, examples, sample
from tests.groups import group_of

ROOT = Path(__file__).parents[1]
SKIPPED = "import pytest\n@pytest.mark.skip\ndef test_it(): pass\n"


@pytest.mark.parametrize(
    ("text", "options", "code"),
    sample(
        [
            (SKIPPED, ["-n", "1"], 5),
            ("def test_it(): pass\n", [], 0),
            (SKIPPED, [], 5),
            ("def test_it(): pass\n", ["-m", "slow"], 5),
        ]
    ),
)
def test_a_run_that_carried_out_no_test_fails(
    tmp_path: Path, text: str, options: list[str], code: int
) -> None:
    """Skipped, deselected or not there: exit code 5, in one process or several."""
    (tmp_path / "test_it.py").write_text(text, encoding="utf-8")
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n slow:\n", encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "tests.conftest", *options, str(tmp_path)]
    inherited = {name: text for name, text in os.environ.items() if not name.startswith("PYTEST_")}
    done = subprocess.run(
        [*command, "-c", str(tmp_path / "pytest.ini")],
        cwd=ROOT,
        env=inherited,
        capture_output=True,
        check=False,
    )
    assert done.returncode == code, done.stdout


def test_the_fast_tier_has_fewer_examples(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many as asked for in the full tier, 20 at most in the fast one."""
    monkeypatch.setattr("tests.budget.IS_FULL", False)
    assert (examples(300), examples(8)) == (FAST_EXAMPLES, 8)
    monkeypatch.setattr("tests.budget.IS_FULL", True)
    assert examples(300) == 300


def test_the_fast_tier_has_the_first_cases() -> None:
    """The others are there and marked slow; a case may be one value or several."""
    first, second, third = sample([1, (2, 3), 4], fast=2)
    assert [case.values for case in (first, second, third)] == [(1,), (2, 3), (4,)]
    assert [[mark.name for mark in case.marks] for case in (first, second, third)] == [[], [], ["slow"]]


def test_tests_of_the_real_clock_share_a_process_and_so_do_those_that_compile() -> None:
    """A file of each, and one that is a group of its own."""
    here = Path(__file__).parent
    assert group_of(here / "chefbotd/process/test_signals.py") == "realtime"
    assert group_of(here / "chefbotd/navigation/test_planner.py") == "compiled"
    assert group_of(here / "scenarios/test_navigation.py") == "compiled"
    alone = here / "chefbotd/motion/test_pid.py"
    assert group_of(alone) == str(alone)


def test_xdist_gives_whole_groups_to_a_process() -> None:
    """Tests of two files that need the real clock are one unit of work, and another file is another."""
    kind = pytest.importorskip("tests.scheduling").GroupScheduling
    scheduling = kind.__new__(kind)  # it needs no workers to tell groups
    ids = [
        f"tests/chefbotd/{name}::test_it[a::b]"
        for name in ("process/test_signals.py", "link/test_replug.py", "test_bus.py")
    ]
    first, second, other = map(scheduling._split_scope, ids)
    assert first == second == "realtime"
    assert other.endswith("test_bus.py")
