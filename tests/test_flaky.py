"""A test that fails and then passes is named at the end of the run, and fails it."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests import flaky

FLAKY = Path(flaky.__file__).resolve()
PYTEST = (sys.executable, "-m", "pytest", "-q")
NOW_AND_THEN = """
from pathlib import Path

def test_second_time():
    seen = Path("seen")
    if not seen.exists():
        seen.touch()
        raise AssertionError("the first time")

def test_always():
    pass
"""


@pytest.fixture(autouse=True)
def _no_plugins(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take longer to load than these tests to run."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The program, in this folder."""
    program = [sys.executable, str(FLAKY), *arguments]
    return subprocess.run(program, cwd=folder, capture_output=True, text=True, check=False)


def test_one_that_fails_and_then_passes_is_named_and_fails_the_run(tmp_path: Path):
    """The second try passes, so the run goes on; its report at the end names it, with exit code 1."""
    (tmp_path / "test_it.py").write_text(NOW_AND_THEN)
    assert subprocess.run(PYTEST, cwd=tmp_path, capture_output=True, check=False).returncode == 1
    assert run(tmp_path, "again", "notes/flaky", *PYTEST).returncode == 0
    told = run(tmp_path, "report", "notes/flaky")
    assert (told.returncode, told.stdout) == (
        1,
        "failed and then passed: test_it.py::test_second_time (not known: mend it)\n",
    )


def test_one_that_fails_twice_ends_the_run(tmp_path: Path):
    """It is no test that fails now and then, and is not named as one."""
    (tmp_path / "test_it.py").write_text("def test_it():\n    assert False\n")
    subprocess.run(PYTEST, cwd=tmp_path, capture_output=True, check=False)
    assert run(tmp_path, "again", "flaky", *PYTEST).returncode == 1
    assert run(tmp_path, "report", "flaky").returncode == 0


def test_where_no_test_has_failed_something_else_did(tmp_path: Path):
    """A folder that cannot be collected, say: trying again mends nothing."""
    assert run(tmp_path, "again", "flaky", *PYTEST).returncode == 1


def test_a_known_one_is_named_with_its_reason_and_fails_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """The reason stands in the list."""
    (tmp_path / "flaky").write_text("test_it.py::test_a\ntest_it.py::test_a\n")
    assert flaky.report(tmp_path / "flaky", {"test_it.py::test_a": "the kernel decides"}) == 0
    assert capsys.readouterr().out == "failed and then passed: test_it.py::test_a (the kernel decides)\n"


def test_who_fails_on_a_busy_computer_is_named_for_each_run(tmp_path: Path):
    """Two runs: the first has one failure, the second none."""
    (tmp_path / "test_it.py").write_text(NOW_AND_THEN)
    told = run(tmp_path, "loaded", "2", *PYTEST)
    assert told.returncode == 1
    assert told.stdout.endswith(
        "run 1 of 2: 1 failed\n  test_it.py::test_second_time\nrun 2 of 2: 0 failed\n"
    )
