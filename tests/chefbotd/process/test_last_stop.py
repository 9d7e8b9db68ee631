"""The program that stops the motors after its daemon was killed, against ports that fail."""

import termios

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
    assert last_stop.stop_motors("/dev/nowhere", 115200, True, True, b"s 0 0\r")
    assert bytes(port.written) == b"s 0 0\r" * last_stop.STOPS


def test_a_port_that_stays_away_is_waited_for_a_minute(monkeypatch: pytest.MonkeyPatch, slept_s: list[float]):
    """Then the program gives up, rather than hold up the system for ever."""
    monkeypatch.setattr(serial, "Serial", FailingPort([FileNotFoundError(2, "gone")] * 1000))
    assert not last_stop.stop_motors("/dev/nowhere", 115200, True, True, b"s 0 0\r")
    assert sum(slept_s) == pytest.approx(60.0, abs=0.2)
