"""A board whose echo shows what it was not told."""

import random

import pytest

from chefbotd.safety import echo
from chefbotd.safety.echo import UNKNOWN, EchoParameters, EchoState
from chefbotd.safety.faults import Fault, FaultKind

P = EchoParameters()


class Wire:
    """Commands that differ each time, and their echoes ``late`` cycles of 20 ms later."""

    def __init__(self, late: int = 2) -> None:
        self.state: EchoState = UNKNOWN
        self.now_s, self.late = 10.0, late
        self.said: list[tuple[int, int]] = []
        self.fault: Fault | None = None

    def go(self, cycles: int, shown: tuple[float, float] | None = None, every: int = 1) -> Fault | None:
        """So many cycles; in one of ``every`` the board shows something else."""
        for cycle in range(cycles):
            self.now_s += 0.02
            self.said.append((60 + len(self.said) % 17, -3 - len(self.said) % 5))
            self.state = echo.note_command(self.state, self.now_s, self.said[-1])
            true = self.said[-1 - self.late] if len(self.said) > self.late else (0, 0)
            seen = shown if shown is not None and cycle % every == 0 else true
            self.state, fault = echo.note_echo(P, self.state, self.now_s, (float(seen[0]), float(seen[1])))
            self.fault = self.fault or fault
        return self.fault


def test_pieces_of_commands_are_found() -> None:
    """(6637, 0), as a 63-byte ring made it: eight in a row are 0.16 s, and both are told."""
    wire = Wire()
    assert wire.go(20) is None
    assert wire.go(7, (6637.0, 0.0)) is None
    fault = wire.go(1, (6637.0, 0.0))
    assert fault is not None
    assert fault.kind is FaultKind.ECHO_MISMATCH
    assert "'6637 0'" in fault.reason


def test_late_echoes_fit() -> None:
    """A second late, at 50 commands a second, every echo shows a command of late."""
    assert Wire(late=50).go(500) is None


def test_an_old_command_that_is_still_in_force_is_found() -> None:
    """One that was said last 3 s ago, and others since."""
    wire = Wire()
    wire.go(10)
    wire.state = echo.note_command(wire.state, wire.now_s, (91, 45))
    assert wire.go(100, (91.0, 45.0)) is None
    assert wire.go(100, (91.0, 45.0)) is not None


@pytest.mark.slow
def test_one_line_in_eight_may_be_damaged() -> None:
    """At random, for ten minutes."""
    chance, wire = random.Random(7), Wire()
    wire.go(20)
    for _ in range(30_000):
        damaged = (float(chance.randrange(1, 999)), -3.0) if chance.random() < 0.125 else None
        assert wire.go(1, damaged) is None


def test_an_echo_in_metres_per_second_is_never_judged() -> None:
    """A fork that shows 0.21 and -0.04 never showed one of our commands."""
    assert Wire().go(1000, (0.21, -0.04)) is None


def test_zero_is_always_well() -> None:
    """A board that starts anew, or stops one motor of its own accord."""
    wire = Wire()
    wire.go(20)
    assert wire.go(500, (0.0, 0.0)) is None
    wire = Wire(late=0)
    wire.go(20)
    for _ in range(200):
        assert wire.go(1, (float(60 + len(wire.said) % 17), 0.0)) is None


def believed() -> EchoState:
    """A board that has shown five commands that were not zero, the last of them (0, -44) at 2 s."""
    state = UNKNOWN
    for number in range(5):
        assert not echo.is_believed(P, state)
        state = echo.note_command(state, 2.0, (0, -40 - number))
        state, fault = echo.note_echo(P, state, 2.0, (0.0, -40.0 - number))
        assert fault is None
    assert echo.is_believed(P, state)
    return state


def faults(state: EchoState, now_s: float, *shown: tuple[float, float]) -> list[bool]:
    """Whether each of these echoes is a fault."""
    found = []
    for each in shown:
        state, fault = echo.note_echo(P, state, now_s, each)
        found.append(fault is not None)
    return found


WRONG, STILL, RIGHT = (70.0, -44.0), (0.0, 0.0), (0.0, -44.0)


def test_each_echo_that_fits_takes_half_of_one_off_and_none_more_than_there_is() -> None:
    """Seven that do not fit, less one for two that do, of zero or of what was said: two more are too many."""
    for fits in (STILL, RIGHT):
        assert faults(believed(), 2.1, fits, fits, *[WRONG] * 7, fits, fits, WRONG, WRONG) == [False] * 12 + [
            True
        ]


def test_after_a_fault_the_counting_begins_anew() -> None:
    """Sixteen in a row are two faults."""
    assert faults(believed(), 2.1, *[WRONG] * 16) == ([False] * 7 + [True]) * 2


def test_zero_proves_no_echo_and_needs_no_command() -> None:
    """A board that only ever says zero is not believed; one that is believed may say it with nothing said lately."""
    state = echo.note_command(UNKNOWN, 2.0, (50, -40))
    for _ in range(20):
        state, _ = echo.note_echo(P, state, 2.1, STILL)
    assert not echo.is_believed(P, state)
    assert faults(believed(), 60.0, *[STILL] * 20) == [False] * 20


def test_a_command_that_is_repeated_is_remembered_once() -> None:
    """300 times (50, -40) within 2.9 s; the board may still show what was said before it."""
    state = echo.note_command(believed(), 3.0, (90, -12))
    for number in range(300):
        state = echo.note_command(state, 3.0 + 0.0096 * number, (50, -40))
    assert not any(faults(state, 5.9, *[(90.0, -12.0)] * 20))


def test_256_different_commands_are_remembered() -> None:
    """The one before them is not."""
    state = echo.note_command(believed(), 3.0, (90, -12))
    for number in range(255):
        state = echo.note_command(state, 3.0, (91 + number, -40))
    assert not any(faults(state, 3.1, *[(90.0, -12.0)] * 8))
    state = echo.note_command(state, 3.0, (91 + 255, -40))
    assert any(faults(state, 3.1, *[(90.0, -12.0)] * 8))
