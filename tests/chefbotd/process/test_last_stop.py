"""The program that stops the motors after its daemon was killed, against ports that fail."""

import fcntl
import math
import os
import termios
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO, TextIOWrapper

import pytest
import serial

from chefbotd.process import last_stop


class FailingPort:
    """Each attempt to open it meets the next of ``failures``; then it takes what is written."""

    def __init__(self, failures: list[Exception]) -> None:
        self.failures, self.written = failures, bytearray()

    def __call__(self, *_: object, **__: object) -> "FailingPort":
        return self

    def __enter__(self) -> "FailingPort":
        if self.failures:
            raise self.failures.pop(0)
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def fileno(self) -> int:
        """Any."""
        return 7

    def write(self, data: bytes) -> None:
        """Keep it."""
        self.written += data


@pytest.fixture
def slept_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What the program slept, which is all the time that passes."""
    slept: list[float] = []
    monkeypatch.setattr(last_stop.time, "sleep", slept.append)
    monkeypatch.setattr(last_stop.time, "monotonic", lambda: sum(slept))
    monkeypatch.setattr(last_stop, "_is_free", lambda _: True)
    return slept


def test_a_device_that_goes_away_while_it_is_opened_is_opened_again(
    monkeypatch: pytest.MonkeyPatch, slept_s: list[float]
):
    """The terminal's own error, which is no OSError, ends the program as little as a missing device does."""
    port = FailingPort([FileNotFoundError(2, "gone"), termios.error(5, "Input/output error")])
    monkeypatch.setattr(serial, "Serial", port)
    outcome = last_stop.stop_motors("/dev/nowhere", 115200, True, True, b"s 0 0\r")
    assert outcome == last_stop.WRITTEN
    assert bytes(port.written) == b"s 0 0\r" * last_stop.STOPS


def test_a_port_that_stays_away_is_waited_for_ten_seconds(
    monkeypatch: pytest.MonkeyPatch, slept_s: list[float]
):
    """Then the program gives up, rather than hold up the system for ever."""
    monkeypatch.setattr(serial, "Serial", FailingPort([FileNotFoundError(2, "gone")] * 1000))
    outcome = last_stop.stop_motors("/dev/nowhere", 115200, True, True, b"s 0 0\r")
    assert outcome == last_stop.AWAY
    assert sum(slept_s) == pytest.approx(10.0, abs=0.2)


@dataclass
class PortInUse:
    """A real pseudo-terminal whose lock another program holds, until so many looks of 0.1 s have been in vain."""

    board: int
    device: int
    path: str
    holder: int
    looks_left: float
    slept_s: float = 0.0

    def sleep(self, duration_s: float) -> None:
        """All the time that passes."""
        self.slept_s += duration_s
        self.looks_left -= 1
        if self.looks_left == 0:
            os.close(self.holder)

    @property
    def written(self) -> bytes:
        """What has reached the board before a mark, which is sent now: the kernel delivers in order, but later."""
        os.write(self.device, b"!")
        arrived = b""
        while not arrived.endswith(b"!"):
            arrived += os.read(self.board, 4096)
        return arrived[:-1]


@pytest.fixture
def port_in_use(monkeypatch: pytest.MonkeyPatch) -> Iterator[PortInUse]:
    """Held for ever, unless the test says how long."""
    board, device = os.openpty()
    tty.setraw(device)
    path = os.ttyname(device)
    holder = os.open(path, os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(holder, fcntl.LOCK_EX)
    port = PortInUse(board, device, path, holder, math.inf)
    monkeypatch.setattr(last_stop.time, "sleep", port.sleep)
    monkeypatch.setattr(last_stop.time, "monotonic", lambda: port.slept_s)
    yield port
    if port.looks_left > 0:
        os.close(holder)
    os.close(device)
    os.close(board)


@pytest.mark.parametrize("looks", [1, 30])
def test_the_lock_of_the_daemon_that_dies_is_waited_for(port_in_use: PortInUse, looks: int):
    """The pipe has ended, but the kernel has not let go of the port yet: on a busy computer that takes its time."""
    port_in_use.looks_left = looks
    assert last_stop.stop_motors(port_in_use.path, 115200, True, True, b"s 0 0\r") == last_stop.WRITTEN
    assert port_in_use.written == b"s 0 0\r" * last_stop.STOPS


def test_a_daemon_that_cannot_end_is_stopped_all_the_same(
    port_in_use: PortInUse, monkeypatch: pytest.MonkeyPatch
):
    """It holds the lock for ever, and is still this program's parent, so nobody else drives: no stop is late."""
    daemon = os.getpid()
    monkeypatch.setattr(last_stop.os, "getppid", lambda: daemon)
    assert (
        last_stop.stop_motors(port_in_use.path, 115200, True, True, b"s 0 0\r", None, daemon)
        == last_stop.WRITTEN
    )
    assert port_in_use.written == b"s 0 0\r" * last_stop.STOPS
    assert port_in_use.slept_s == pytest.approx(last_stop.STOPS * last_stop.APART_S)


def test_a_daemon_that_dies_while_it_waits_for_the_port_stops_nobody(port_in_use: PortInUse):
    """It is still this program's parent, but another process has the lock: that one's robot drives on."""
    assert (
        last_stop.stop_motors(port_in_use.path, 115200, True, True, b"s 0 0\r", None, os.getppid())
        == last_stop.IN_USE
    )
    assert port_in_use.written == b""


def test_a_port_that_another_program_keeps_is_left_to_it(port_in_use: PortInUse):
    """The daemon is gone, and the lock is still held ten seconds later: nothing is written, and the outcome says so."""
    assert last_stop.stop_motors(port_in_use.path, 115200, True, True, b"s 0 0\r") == last_stop.IN_USE
    assert port_in_use.written == b""
    assert port_in_use.slept_s == pytest.approx(10.0, abs=0.2)


def test_a_port_that_is_taken_between_two_stops_is_waited_for_ten_seconds_in_all(
    port_in_use: PortInUse, monkeypatch: pytest.MonkeyPatch
):
    """In use for 6 s before the first stop and for ever after the second: it is left to who has it, 10 s in all."""
    looks = iter([False] * 60 + [True] * 2)
    monkeypatch.setattr(last_stop, "_is_free", lambda _: next(looks, False))
    assert last_stop.stop_motors(port_in_use.path, 115200, True, True, b"s 0 0\r") == last_stop.WRITTEN
    assert port_in_use.written == b"s 0 0\r" * 2
    assert port_in_use.slept_s == pytest.approx(10.0, abs=0.2)


def test_a_terminal_that_has_the_number_of_a_simulated_board_gets_nothing() -> None:
    """The board is gone, and the next pseudo-terminal that is opened gets its number: not a byte is written there."""
    board, device = os.openpty()
    path = os.ttyname(device)
    simulated = last_stop.pseudo_terminal(path)
    assert simulated is not None
    os.close(device)
    os.close(board)
    assert last_stop.stop_motors(path, 115200, True, True, b"s 0 0\r", simulated) == last_stop.NOT_OURS
    terminal, device = os.openpty()
    while last_stop.pseudo_terminal(path) == simulated:  # made within one tick of the kernel's clock
        os.close(device)
        os.close(terminal)
        terminal, device = os.openpty()
    try:
        assert last_stop.stop_motors(path, 115200, True, True, b"s 0 0\r", simulated) == last_stop.NOT_OURS
        os.set_blocking(terminal, False)
        with pytest.raises(BlockingIOError):
            os.read(terminal, 100)
    finally:
        os.close(terminal)
        os.close(device)


@pytest.mark.parametrize(
    ("there", "expected"),
    [
        (True, "the motors on /dev/nowhere were told to stop"),
        (False, "was not back within 10 s: the motors could not"),
    ],
)
def test_what_came_of_it_is_in_the_systems_log(
    monkeypatch: pytest.MonkeyPatch, slept_s: list[float], there: bool, expected: str
):
    """Nobody else is left to tell it."""
    told: list[str] = []
    monkeypatch.setattr(serial, "Serial", FailingPort([] if there else [FileNotFoundError(2, "gone")] * 1000))
    monkeypatch.setattr(last_stop.syslog, "syslog", lambda level, text: told.append(text))
    monkeypatch.setattr(last_stop.signal, "signal", lambda *_: None)
    monkeypatch.setattr(
        last_stop.sys, "argv", ["", "/dev/nowhere", "115200", "1", "1", b"s 0 0\r".hex(), "0"]
    )
    monkeypatch.setattr(last_stop.sys, "stdin", TextIOWrapper(BytesIO(b"")))
    last_stop.main()
    assert len(told) == 1
    assert expected in told[0]
