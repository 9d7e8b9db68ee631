"""What a run of the tests promises: one that carried out no test has not passed."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.budget import FAST_EXAMPLES, HERE, PACKAGED, examples, is_left, sample, tier_of
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
        ],
        fast=0,
    ),
)
def test_a_run_that_carried_out_no_test_fails(
    tmp_path: Path, text: str, options: list[str], code: int
) -> None:
    """Skipped, deselected or not there: exit code 5, in one process or several."""
    (tmp_path / "test_it.py").write_text(text, encoding="utf-8")
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n slow:\n", encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "tests.conftest", *options, str(tmp_path)]
    inherited = {
        name: text for name, text in os.environ.items() if not name.startswith(("PYTEST_", "TEST_TIER"))
    }
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


TWO_TIERS = """
import pytest
from hypothesis import given, strategies
@pytest.mark.slow
def test_slow(): pass
@given(strategies.none())
def test_examples(_): pass
def test_fast(): pass
"""


@pytest.mark.slow
def test_the_rest_is_what_the_fast_tier_leaves(tmp_path: Path) -> None:
    """The rest has the slow ones, and those of Hypothesis once more, with all their examples."""
    (tmp_path / "test_it.py").write_text(TWO_TIERS, encoding="utf-8")
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n slow:\n", encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-v", "-p", "tests.conftest", str(tmp_path)]
    inherited = {name: text for name, text in os.environ.items() if not name.startswith("PYTEST_")}
    done = subprocess.run(
        [*command, "-c", str(tmp_path / "pytest.ini")],
        cwd=ROOT,
        env={**inherited, "TEST_TIER": "rest"},
        capture_output=True,
        check=True,
        text=True,
    )
    assert set(re.findall(r"::(\w+) PASSED", done.stdout)) == {"test_slow", "test_examples"}


def test_what_a_wheel_can_lack_is_left_to_the_wheel(request: pytest.FixtureRequest) -> None:
    """Each room of such tests is there; this test is of none of them, and has no examples."""
    assert all((HERE / name).exists() for name in PACKAGED)
    assert not is_left(request.node)


def test_a_tier_that_is_none_is_refused() -> None:
    """The error names it, and what there is."""
    with pytest.raises(ValueError, match="one of fast, full, rest, got 'all'"):
        tier_of("all")


def test_tests_of_the_real_clock_share_a_process_and_so_do_those_that_compile() -> None:
    """A file of each, and one that is a group of its own."""
    here = Path(__file__).parent
    assert group_of(here / "chefbotd/process/test_signals.py") == "realtime"
    assert group_of(here / "chefbotd/components/navigation/algorithms/test_planner.py") == "compiled"
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
