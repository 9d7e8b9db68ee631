"""The prompt: it does what is typed, and stops the robot after whatever goes wrong."""

import asyncio
import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from chefbot_devtools.shell import RobotShell, configuration
from IPython.core.completer import provisionalcompleter

from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import Client, ConnectionLost

PROGRAM = [sys.executable, "-m", "chefbotd.cli.programs.chefbotctl"]
GENEROUS_S = 30.0


class Robot:
    """Counts how often it was stopped."""

    def __init__(self) -> None:
        self.stops = 0
        self.error: Exception | None = None

    def stop(self) -> None:
        """Count it."""
        self.stops += 1
        if self.error is not None:
            raise self.error


@pytest.fixture
def robot() -> Robot:
    """A robot that can only be stopped."""
    return Robot()


@pytest.fixture
def shell(robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RobotShell]:
    """A prompt without a terminal."""
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    config = configuration()
    config.HistoryManager.enabled = False
    shell = RobotShell(config=config, user_ns={"robot": robot})
    shell.connect(robot)
    yield shell
    shell.restore_sys_module_state()


@pytest.mark.parametrize("typed", ["rbot.drive(", "no_such_name", "1 / 0", "raise KeyboardInterrupt"])
def test_whatever_raises_an_error_stops_the_robot(shell: RobotShell, robot: Robot, typed: str) -> None:
    """Nonsense, a misspelled name, an error, Ctrl-C in a command; once each."""
    shell.run_cell(typed)
    assert robot.stops == 1


@pytest.mark.parametrize(
    "written", ["1 / 0", "raise KeyboardInterrupt", "def broken(", "import sys; sys.exit(1)"]
)
def test_a_program_that_is_run_and_fails_stops_the_robot(
    shell: RobotShell, robot: Robot, tmp_path: Path, written: str
) -> None:
    """By ``%run``, which shows the error and raises none. Once for each error, also within one input."""
    program = tmp_path / "program.py"
    program.write_text(written)
    shell.run_cell(f"%run {program}")
    assert robot.stops == 1
    shell.run_cell("%tb")
    assert robot.stops == 1
    shell.run_cell(f"%run {program}\n1 / 0")
    assert robot.stops == 3


def test_what_is_well_does_not(
    shell: RobotShell, robot: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An assignment, the robot itself, help, a program, and the end."""
    program = tmp_path / "program.py"
    program.write_text("y = 1")
    for typed in (f"%run {program}", "x = 1", "robot", "robot.stop?", "exit()"):
        shell.run_cell(typed)
    assert robot.stops == 0


def test_a_lost_daemon_is_said(shell: RobotShell, robot: Robot, capsys: pytest.CaptureFixture[str]) -> None:
    """The prompt goes on."""
    robot.error = ConnectionLost("the daemon is gone")
    shell.run_cell("1 / 0")
    assert "could not be told to stop (the daemon is gone)" in capsys.readouterr().out


def test_completion_knows_the_robots_methods(shell: RobotShell) -> None:
    """As Tab does."""
    with provisionalcompleter():
        completed = [completion.text for completion in shell.Completer.completions("robot.st", 8)]
    assert "stop" in [text.rpartition(".")[2] for text in completed]


def test_ctrl_c_at_the_prompt_stops_the_robot(tmp_path: Path) -> None:
    """On a real terminal, with a simulated robot."""

    async def scenario() -> str:
        async with simulated_daemon("chefbot", {"CHEFBOTD_WATCHDOG__TIMEOUT_S": "3.0"}) as (where, _):
            terminal, theirs = pty.openpty()
            environment = os.environ | {"IPYTHONDIR": str(tmp_path), "TERM": "dumb", "PYTHONUNBUFFERED": "1"}
            command = [*PROGRAM, "--connect", str(where), "shell"]
            process = await asyncio.create_subprocess_exec(
                *command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment, start_new_session=True
            )
            try:
                await _until(terminal, "In [")
                return await _until(terminal, "The robot was stopped", typing=b"\x03")
            finally:
                os.killpg(process.pid, signal.SIGKILL)
                await process.wait()
                os.close(terminal)
                os.close(theirs)

    assert "The robot was stopped" in asyncio.run(scenario())


def test_without_a_daemon_it_says_so() -> None:
    """Before there is a prompt."""
    run = subprocess.run(
        [*PROGRAM, "--connect", "127.0.0.1:9", "shell"], capture_output=True, text=True, check=False
    )
    assert run.returncode == 3
    assert "cannot connect to 127.0.0.1:9" in run.stderr


def test_lines_from_a_file_are_run_and_the_robot_drives(tmp_path: Path) -> None:
    """Through a pipe, on a simulated robot: 1 s at 0.2 m/s is at most 0.2 m, by odometry."""

    async def scenario() -> tuple[str, float]:
        async with simulated_daemon("chefbot", {"CHEFBOTD_WATCHDOG__TIMEOUT_S": "3.0"}) as (where, _):
            typed = (
                "_ = robot.wait_until_armed()\n_ = robot.drive_for(1.0, linear_m_s=0.2)\nnonsense\nexit()\n"
            )
            process = await asyncio.create_subprocess_exec(
                *PROGRAM,
                *("--connect", str(where), "shell"),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=os.environ | {"IPYTHONDIR": str(tmp_path)},
            )
            said, _ = await asyncio.wait_for(process.communicate(typed.encode()), GENEROUS_S)
            async with Client.connect(where.host, where.port) as robot:
                return said.decode(), (await robot.get_state()).odometry.x_m

    said, driven_m = asyncio.run(scenario())
    assert 0.1 < driven_m < 0.21
    assert "The robot was stopped" in said


async def _until(terminal: int, text: str, typing: bytes = b"") -> str:
    """What the terminal showed until it showed this; ``typing`` is typed again where a second long nothing happens."""
    seen, due_s = "", time.monotonic() + GENEROUS_S
    os.write(terminal, typing)
    while text not in seen and time.monotonic() < due_s:
        readable, _, _ = await asyncio.to_thread(select.select, [terminal], [], [], 1.0)
        if readable:
            seen += os.read(terminal, 4096).decode(errors="replace")
        else:
            os.write(terminal, typing)
    assert text in seen, seen
    return seen
