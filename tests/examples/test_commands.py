"""The demonstrations' commands: what they need before they begin, and where they are offered."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.programs.chefbotctl import main
from examples.commands import only_one_in
from tests.missing import PILLOW, hide
from tests.waiting import PATIENCE_S

COMMANDS = [("map", "demo"), ("serve",)]
WITHOUT = """
import sys
sys.modules["{package}"] = None
from chefbotd import start
sys.argv = ["chefbotctl", *{words}]
start.chefbotctl()
"""


def chefbotctl(*words: str) -> Result:
    """The program run with these words; no daemon answers."""
    return CliRunner().invoke(main, ["--connect", "127.0.0.1:1", *words])


def without(package: str, *words: str) -> subprocess.CompletedProcess[str]:
    """The program run in a process of its own that cannot import this package."""
    program = WITHOUT.format(package=package, words=words)
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


def test_a_second_demonstration_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    """It says what to do, and starts nothing; in another folder, or afterwards, it may."""
    with only_one_in(tmp_path / "map"):
        result = chefbotctl("map", "demo", "--out", str(tmp_path / "map"))
        assert result.exit_code == Exit.NOT_DONE
        assert "give another folder with --out" in result.output
        with only_one_in(tmp_path / "other"):
            pass
    with only_one_in(tmp_path / "map"):
        assert (tmp_path / "map" / ".demo.lock").is_file()


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    """A file is in its place."""
    (tmp_path / "map").write_text("")
    with (
        pytest.raises(ProgramError, match=f"cannot write to {tmp_path / 'map'}"),
        only_one_in(tmp_path / "map"),
    ):
        pass


@pytest.mark.parametrize("words", COMMANDS)
def test_the_demonstrations_ask_for_all_of_navigation(
    monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    """Where Pillow is missing, before a simulated robot is started: exit code 7 and the command of pip."""
    hide(monkeypatch, *PILLOW)
    result = chefbotctl(*words)
    assert result.exit_code == Exit.NOT_INSTALLED
    assert "pip install 'chefbotd[navigation]'" in result.stderr


def test_serving_asks_for_numba() -> None:
    """It measures the robot's way against the shortest, and that is computed here."""
    done = without("numba", "serve")
    assert done.returncode == Exit.NOT_INSTALLED
    assert "pip install 'chefbotd[navigation]'" in done.stderr


@pytest.mark.parametrize("words", COMMANDS)
def test_a_checkout_lists_the_demonstrations(words: tuple[str, ...]) -> None:
    """Beside the other commands, each with its line."""
    listed = chefbotctl(*words[:-1], "--help").stdout
    assert f"\n  {words[-1]} " in listed


@pytest.mark.parametrize("words", COMMANDS)
@pytest.mark.parametrize("more", [(), ("--out", "somewhere")])
def test_a_package_without_examples_says_where_they_are(
    words: tuple[str, ...], more: tuple[str, ...]
) -> None:
    """One sentence and exit code 7, whatever follows the command; it is not listed."""
    done = without("examples", *words, *more, "--json")
    assert done.returncode == Exit.NOT_INSTALLED
    said = json.loads(done.stderr)["error"]["message"]
    target = {"demo": "map", "serve": "serve"}[words[-1]]
    assert said == (
        f"'chefbotctl {' '.join(words)}' is a demonstration, which only the sources of chefbotd have: "
        f"run 'make {target}' in a checkout"
    )
    assert f"\n  {words[-1]} " not in without("examples", *words[:-1], "--help").stdout
