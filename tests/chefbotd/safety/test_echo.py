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
            self.state = echo.say(self.state, self.now_s, self.said[-1])
            true = self.said[-1 - self.late] if len(self.said) > self.late else (0, 0)
            seen = shown if shown is not None and cycle % every == 0 else true
            self.state, fault = echo.hear(P, self.state, self.now_s, (float(seen[0]), float(seen[1])))
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
    wire.state = echo.say(wire.state, wire.now_s, (91, 45))
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
