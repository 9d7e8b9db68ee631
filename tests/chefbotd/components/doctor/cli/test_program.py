"""The real programs: chefbotctl doctor and ports in front of a simulated board on a pseudo-terminal."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tarfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.waiting import PATIENCE_S

pytestmark = [pytest.mark.slow, pytest.mark.realtime]

NOBODY = "--connect=127.0.0.1:9"
"""A port at which no daemon listens."""

MODULE = [sys.executable, "-m"]


class Board:
    """``chefbotd simulate``, with what it says about the truth."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process
        self.device = self._line()

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()

    def truth(self) -> dict[str, object]:
        """Where the robot is, and the duty in force."""
        assert self._process.stdin is not None
        self._process.stdin.write("truth\n")
        self._process.stdin.flush()
        answer: dict[str, object] = json.loads(self._line())
        return answer


@pytest.fixture
def board() -> Iterator[Board]:
    """The Tiva's sketch in a furnished room."""
    command = [*MODULE, "chefbotd.cli.programs.chefbotd", "simulate"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield Board(process)
        finally:
            process.terminate()


def doctor(*words: str) -> list[str]:
    """The command line of chefbotctl."""
    return [*MODULE, "chefbotd.cli.programs.chefbotctl", NOBODY, *words]


def run(*words: str) -> "subprocess.CompletedProcess[str]":
    """Run it with nobody at its keyboard."""
    return subprocess.run(
        doctor(*words), capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=3 * PATIENCE_S
    )


def test_without_a_daemon_it_opens_the_board_itself(board: Board, tmp_path: Path):
    """JSON with the sketch and the pose; nothing moved; and a bundle without the token that was given."""
    token = tmp_path / "token"
    token.write_text("drive 5e1f0a9c4b7d2836aa55cc33ee771199\n")
    bundle = tmp_path / "robot.tar.gz"
    words = ("--token-file", str(token), "doctor", "--json", "-y", "--seconds=2", "--port", board.device)
    result = run(*words, "--bundle", str(bundle))
    told = json.loads(result.stdout)
    findings = {each["check"]: each for each in told["findings"]}
    assert findings["socket"]["verdict"] == "skipped"
    assert "sketch A," in findings["sketch"]["measured"]
    assert findings["pose"]["verdict"] == "ok"
    assert findings["motors"]["verdict"] == "skipped"
    assert result.returncode == {"ok": 0, "warning": 8, "problem": 9}[told["verdict"]]
    assert board.truth()["x_m"] == 0.0
    with tarfile.open(bundle) as archive:
        members = {entry.name: archive.extractfile(entry).read() for entry in archive}  # type: ignore[union-attr]
    assert b"5e1f0a9c4b7d2836aa55cc33ee771199" not in b"".join(members.values())
    assert b"link opened" in members["robot/doctor.txt"]


def test_a_board_that_is_held_is_not_opened(board: Board):
    """Another program has it open: named, the exit code says problem, and it goes on undisturbed."""
    descriptor = os.open(board.device, os.O_RDWR | os.O_NOCTTY)
    try:
        result = run("doctor", "-y", "--port", board.device)
    finally:
        os.close(descriptor)
    assert result.returncode == 9
    assert f"{board.device} is held by" in result.stdout
    assert f"(pid {os.getpid()})" in result.stdout


def test_ports_finds_the_board_by_listening(board: Board):
    """Its sketch and its rate."""
    result = run("ports", "--listen", "--json", board.device)
    (port,) = json.loads(result.stdout)["ports"]
    assert port["behind"]["kind"] == "board"
    assert port["behind"]["baud"] == 115_200
    assert "sketch A," in port["behind"]["told"]


@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, 130), (signal.SIGTERM, 130), (signal.SIGHUP, 130), (signal.SIGKILL, -9)],
    ids=["INT", "TERM", "HUP", "KILL"],
)
def test_a_signal_in_mid_drive_stops_the_motors(board: Board, number: signal.Signals, code: int):
    """While a wheel turns: the duty in force is zero soon after, and stays; after a kill by the guard."""
    command = doctor("doctor", "--motors", "--seconds=1", "--port", board.device)
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        process.stdin.write("yes\n")
        process.stdin.flush()
        with contextlib.ExitStack() as stack:
            stack.callback(process.kill)
            assert _until(lambda: any(board.truth()["duty"]), PATIENCE_S)  # type: ignore[call-overload]
            process.send_signal(number)
            assert _until(lambda: not any(board.truth()["duty"]), PATIENCE_S)  # type: ignore[call-overload]
            assert process.wait(PATIENCE_S) == code
        time.sleep(0.3)
        assert board.truth()["duty"] == [0, 0]


def _until(happened: object, patience_s: float) -> bool:
    ends_s = time.monotonic() + patience_s
    while time.monotonic() < ends_s:
        if happened():  # type: ignore[operator]
            return True
        time.sleep(0.02)
    return False
