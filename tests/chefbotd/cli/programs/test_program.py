"""What both programs do alike: output that cannot be written, --json anywhere, screens without a terminal."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import click
import pytest
from click.testing import CliRunner

from chefbotd.cli.common.echo import need_terminal
from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotctl import main as chefbotctl
from chefbotd.cli.programs.chefbotd import main as chefbotd
from chefbotd.cli.programs.program import CommandGroup
from chefbotd.extras import how_to_add_folder
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control
from tests.waiting import PATIENCE_S


@pytest.fixture
def full() -> Iterator[TextIO]:
    """An output on a disk that is full."""
    with Path("/dev/full").open("w") as output:
        yield output


@pytest.fixture
def closed() -> Iterator[TextIO]:
    """A pipe whose reader is gone."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as output:
        yield output


TALKS = (["watch", "odometry"], ["status"], ["stop"], ["--json", "status"], ["square"], ["pid"])


def exit_code(daemon: FakeDaemon, args: list[str], output: TextIO, monkeypatch: pytest.MonkeyPatch) -> int:
    """What ``chefbotctl ARGS > output`` ends with."""
    monkeypatch.setattr(sys, "stdout", output)
    with pytest.raises(SystemExit) as ended:
        chefbotctl([f"--connect=127.0.0.1:{daemon.port}", *args], obj=daemon.run)
    assert isinstance(ended.value.code, int)
    return ended.value.code


@pytest.mark.parametrize("args", TALKS)
def test_a_reader_that_leaves_ends_the_program_quietly(
    daemon: FakeDaemon,
    closed: TextIO,
    args: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """``chefbotctl ... | head`` ends like any tool, as if by SIGPIPE: 128 + 13, and not a word."""
    assert exit_code(daemon, args, closed, monkeypatch) == 141
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("args", TALKS)
def test_a_full_disk_is_not_taken_for_the_network(
    daemon: FakeDaemon,
    full: TextIO,
    args: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """It is told as what it is, once and without a traceback, and the exit code is that of other errors."""
    assert exit_code(daemon, args, full, monkeypatch) == Exit.FAILED
    assert "cannot write the output: No space left on device" in capfd.readouterr().err


def test_a_square_whose_output_fails_stops_the_robot(
    daemon: FakeDaemon, full: TextIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The failure ends the drive as any other does."""
    exit_code(daemon, ["square"], full, monkeypatch)
    assert daemon.methods()[-3:] == ["drive", "release_control", "unsubscribe"]


def test_chefbotd_has_the_same_manners(full: TextIO, monkeypatch: pytest.MonkeyPatch) -> None:
    """``chefbotd check-config`` onto a full disk is an error with a message."""
    monkeypatch.setattr(sys, "stdout", full)
    with pytest.raises(SystemExit) as ended:
        chefbotd(["check-config"])
    assert ended.value.code == Exit.FAILED


@pytest.mark.parametrize(
    "args", [["status", "--json"], ["pid", "get", "--json"], ["pid", "--json"], ["pid", "--json", "get"]]
)
def test_json_may_follow_the_command(control: Control, args: list[str]) -> None:
    """``--json`` means the same after the command as before the first."""
    assert isinstance(json.loads(control(*args).stdout), dict)


def test_json_before_the_command_of_chefbotd() -> None:
    """It is taken in both places, too."""
    before = CliRunner().invoke(chefbotd, ["--json", "check-config"])
    assert json.loads(before.stdout) == json.loads(
        CliRunner().invoke(chefbotd, ["check-config", "--json"]).stdout
    )


def test_failures_are_json_wherever_it_was_asked_for(control: Control, daemon: FakeDaemon) -> None:
    """After the command it holds for stderr as well, for both programs."""
    daemon.refuse["arm"] = "link_down"
    assert json.loads(control("arm", "--json").stderr)["error"]["kind"] == "link_down"
    refused = CliRunner().invoke(chefbotd, ["run", "--log-level", "loud", "--json"])
    assert json.loads(refused.stderr)["error"]["exit_code"] == Exit.BAD_CONFIGURATION


@pytest.mark.parametrize("args", [["teleop"], ["pid", "tune"]])
def test_a_screen_needs_a_terminal(control: Control, daemon: FakeDaemon, args: list[str]) -> None:
    """Without one nothing is drawn and nothing asked of the robot; the message says what is missing."""
    result = control(*args)
    assert (result.exit_code, result.stdout, daemon.calls) == (Exit.USAGE, "", [])
    assert (
        "needs a terminal, but there is none on standard input, standard output, standard error"
        in result.stderr
    )


def test_a_terminal_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a real one, here a pseudo-terminal's, a screen may be drawn."""
    ours, theirs = os.openpty()
    with os.fdopen(theirs, "w") as terminal:
        for name in ("stdin", "stdout", "stderr"):
            monkeypatch.setattr(sys, name, terminal)
        need_terminal()
        monkeypatch.undo()
    os.close(ours)


DRAWS = """
import click
from chefbotd.cli.common.console import Printer
from chefbotd.cli.programs.program import CommandGroup

program = CommandGroup("program")
program.add_command(click.Command("draw", callback=lambda: Printer().print("turned by 5\\u00b0")))
program(["draw"])
"""


def test_a_terminal_that_knows_no_degree_sign() -> None:
    """``PYTHONIOENCODING=ascii``: a question mark stands for what cannot be drawn, and nothing fails."""
    ended = subprocess.run(
        (sys.executable, "-c", DRAWS),
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        timeout=PATIENCE_S,
        check=False,
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, b"turned by 5?\n", b"")


def test_a_mistyped_command_is_answered_with_the_one_that_was_meant() -> None:
    """Also where the module of that command is loaded late."""
    result = CliRunner().invoke(chefbotd, ["replai"])
    assert result.exit_code == Exit.USAGE
    assert "Did you mean 'replay'?" in result.stderr


def test_a_command_of_an_add_on_that_is_absent_says_how_to_install_it() -> None:
    """It is not listed; typed all the same, its words are not looked at, and the exit code is 7."""

    @click.group(cls=CommandGroup)
    def program() -> None:
        """A program."""

    assert isinstance(program, CommandGroup)
    program.add_late("chefbot_absent.commands", "fly")
    assert "fly" not in CliRunner().invoke(program, ["--help"]).stdout
    refused = CliRunner().invoke(program, ["fly", "--high"])
    assert refused.exit_code == 7
    assert "is in chefbot-absent: in a checkout of chefbotd, " in refused.stderr
    assert how_to_add_folder("./addons/chefbot-absent") in refused.stderr
