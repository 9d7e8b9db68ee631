"""A real daemon drives the firmware's image in simavr and is killed, frozen or cut off: how long the motors run on.

``python -m tests.firmware.killed 100`` tries each 100 times, and the same with a process that drives the image in QEMU
(``tests.firmware.feeder``). What counts is the board's own clock, from the last byte that came in to duty 0: an emulator
may lag behind the computer's clock, as it is a process like others.
"""

import argparse
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import psutil

from benchmarks import rig
from benchmarks.rpc import Caller, CallFailed
from chefbotd.process import last_stop
from chefbotd.settings import packaged
from chefbotd.transport.ports import reserve_port
from tests.firmware.emulator import built
from tests.firmware.feeder import ran_on_us
from tests.firmware.qemu import Qemu
from tests.scenarios.process import BUSY_COMPUTER

STARTS_WITHIN_S = 300.0
"""On a busy computer."""

SETTLED_S = 0.6
"""Of the board's time without a byte: what was in the pseudo-terminal has been read, and the dead-man is over."""

MOST_S = 0.26
"""The dead-man's 250 ms, a tick of the board's clock, and the time that a line takes."""

SPEED_RAD_S = 1.0
"""On the spot: after a hundred drives straight on it would stand before a wall."""

PROGRAM = [sys.executable, "-m", "chefbotd.cli.programs.chefbotd"]


class Board:
    """``chefbotd simulate --sketch emulated`` in a process of its own."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [*PROGRAM, "simulate", "--sketch", "emulated"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.device = self._line()

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.communicate()

    def say(self, word: str) -> str:
        """One of its words, and its answer."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{word}\n")
        self._process.stdin.flush()
        return self._line()

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()

    def truth(self) -> dict[str, Any]:
        """The duty of the motors, and the board's times."""
        truth: dict[str, Any] = json.loads(self.say("truth"))
        return truth

    def drives(self) -> bool:
        """Whether the motors have a duty."""
        return any(self.truth()["duty"])

    def ran_on_s(self) -> float | None:
        """Once nothing comes in any more: how long the motors ran on; None if they had no duty when the last byte came.

        Raises:
            AssertionError: they run still.
        """
        while (truth := self.truth())["board_s"] - truth["heard_s"] < SETTLED_S:
            time.sleep(0.05)
        assert not any(truth["duty"]), f"the motors run on: {truth}"
        ran_on_s: float = truth["duty_since_s"] - truth["heard_s"]
        return ran_on_s if ran_on_s > 0 else None


@contextlib.contextmanager
def driving(board: Board) -> Iterator[tuple[int, int]]:
    """A daemon that drives the board: the numbers of its process and of its guard's, which are killed at the end."""
    port = reserve_port()
    words = ["--config", str(packaged("chefbot")), "--port", board.device, "--listen", f"127.0.0.1:{port}"]
    keys = {**BUSY_COMPUTER, "CHEFBOTD_ENCODERS__COUNTED_BY": "firmware"}
    environment = [f"{name}={value}" for name, value in keys.items()]
    with (
        rig.running(["env", *environment, *PROGRAM, "run", *words], port) as daemon,
        rig.connect(daemon, STARTS_WITHIN_S) as caller,
    ):
        guard = _guard_of(daemon.process.pid)
        try:
            _drive(caller, board)
            yield daemon.process.pid, guard
        finally:
            for process in (guard, daemon.process.pid):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)


def _guard_of(daemon: int) -> int:
    """The number of its second process, once that runs its own program."""
    guards: list[int] = []

    def is_there() -> bool:
        with contextlib.suppress(psutil.Error):
            children = psutil.Process(daemon).children()
            guards[:] = [child.pid for child in children if last_stop.__name__ in child.cmdline()]
        return bool(guards)

    rig.until(is_there, "it has no guard", STARTS_WITHIN_S)
    return guards[0]


def _drive(caller: Caller, board: Board) -> None:
    """Until the motors have a duty in the checked mode, and a moment longer."""
    until_s = time.monotonic() + STARTS_WITHIN_S
    left = random.randrange(5, 25)
    while left:
        with contextlib.suppress(CallFailed):  # not armed: a busy computer
            caller.call("drive", linear_m_s=0.0, angular_rad_s=SPEED_RAD_S)
        time.sleep(0.03)
        left -= _is_checked(caller) and board.drives()
        if time.monotonic() > until_s:
            raise rig.NotReady("it does not drive")


def _is_checked(caller: Caller) -> bool:
    topic = caller.call("get_state")["topics"].get("firmware")
    return topic is not None and topic["data"]["mode"] == "checked"


def kill(board: Board, daemon: int, guard: int) -> None:
    """``kill -9`` of both; of the guard first, or it would stop the motors."""
    os.kill(guard, signal.SIGKILL)
    os.kill(daemon, signal.SIGKILL)


def freeze(board: Board, daemon: int, guard: int) -> None:
    """The computer stands still; as far as the board can tell."""
    os.kill(guard, signal.SIGSTOP)
    os.kill(daemon, signal.SIGSTOP)


def unplug(board: Board, daemon: int, guard: int) -> None:
    """The cable is pulled."""
    board.say("unplug")


FAULTS: dict[str, Callable[[Board, int, int], None]] = {
    "kill -9 of the daemon and its guard": kill,
    "frozen computer": freeze,
    "pulled cable": unplug,
}


def ran_on_s(fault: Callable[[Board, int, int], None], times: int) -> list[float]:
    """How long the motors ran on after each of so many faults.

    Raises:
        AssertionError: they ran on for ever, or too few of the tries found them running.
    """
    built()
    figures: list[float] = []
    board = Board()
    try:
        for _ in range(2 * times + 5):  # a busy computer may let the dead-man come before the fault
            with driving(board) as (daemon, guard):
                fault(board, daemon, guard)
                figure = board.ran_on_s()
            if fault is unplug:
                board.device = board.say("plug")
            if figure is not None:
                figures.append(figure)
            if len(figures) == times:
                return figures
    finally:
        board.close()
    raise AssertionError(f"only {len(figures)} of {times} found the motors running")


def report(name: str, figures: Sequence[float]) -> None:
    """Print how many stopped in time, and the extremes."""
    stopped = sum(figure <= MOST_S for figure in figures)
    extremes = f"{min(figures):.3f} to {max(figures):.3f} s"
    sys.stdout.write(f"{name}: within {MOST_S} s {stopped} of {len(figures)}; {extremes}\n")
    sys.stdout.flush()


def main() -> None:
    """Try each fault on both emulators, and print how long the motors ran on."""
    parser = argparse.ArgumentParser(prog="python -m tests.firmware.killed")
    parser.add_argument("times", type=int, nargs="?", default=100)
    times = parser.parse_args().times
    for name, fault in FAULTS.items():
        report(f"simavr, {name}", ran_on_s(fault, times))
    board = Qemu()
    try:
        board.wait_for("firmware\t1\t")
        for number in (signal.SIGKILL, signal.SIGSTOP):
            report(f"QEMU, {number.name}", [ran_on_us(board, number) / 1e6 for _ in range(times)])
    finally:
        board.close()


if __name__ == "__main__":
    main()
