"""The watchdog thread, beside a control loop that stands still for as long as the test says."""

import threading
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from chefbotd.clock import ManualClock
from chefbotd.process import watchdog as watchdog_module
from chefbotd.process.watchdog import Watchdog
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.watchdog import WatchdogParameters
from tests.waiting import PATIENCE_S

LOOKS_S = 0.1


@dataclass
class StandingLoop:
    """A control loop that last acted at 0, and what the watchdog does to it; ``stopped`` is set by the first stop."""

    takes_stop: bool = True
    is_driving: bool = True
    acted_s: float = 0.0
    stopped: threading.Event = field(default_factory=threading.Event)
    reported: list[Fault] = field(default_factory=list)

    def stop(self) -> bool:
        """Remember it."""
        self.stopped.set()
        return self.takes_stop


def watchdog(loop: StandingLoop, now_s: float) -> Watchdog:
    """A watchdog that looks every 12.5 ms, at a clock that stands at ``now_s``."""
    parameters = WatchdogParameters(timeout_s=0.1)
    return Watchdog(parameters, ManualClock(now_s), loop, loop.stop, loop.reported.append)


@pytest.mark.parametrize(
    ("takes_stop", "told"), [(True, "the watchdog stopped the motors"), (False, "the board accepted no stop")]
)
def test_a_loop_that_stands_still_while_driving_is_stopped(takes_stop: bool, told: str):
    """The stop is written first; after a second the fault is reported with the time and whether the stop went."""
    loop = StandingLoop(takes_stop)
    with watchdog(loop, now_s=1.02):
        assert loop.stopped.wait(PATIENCE_S)
    assert loop.reported[0].kind is FaultKind.LOOP_BLOCKED
    assert loop.reported[0].reason.startswith(f"the control loop did not run for 1.02 s and {told}")


def test_a_short_pause_while_driving_is_stopped_and_left_to_the_loop():
    """The motors are stopped at once; whether it is a fault, the loop knows, which counts its pauses."""
    loop = StandingLoop()
    with watchdog(loop, now_s=0.12):
        assert loop.stopped.wait(PATIENCE_S)
    assert not loop.reported


def test_a_loop_that_goes_on_is_left_alone():
    """Younger than the patience: no word from the watchdog."""
    loop = StandingLoop()
    with watchdog(loop, now_s=0.09):
        assert not loop.stopped.wait(LOOKS_S)
    assert not loop.reported


def test_a_loop_that_stands_still_at_rest_is_no_fault():
    """Its last stop may be unsent, or lost, so there are more of them; but nothing was driven, and nothing latches."""
    loop = StandingLoop(is_driving=False)
    with watchdog(loop, now_s=100.0):
        assert loop.stopped.wait(PATIENCE_S)
    assert not loop.reported


def test_the_thread_ends_with_its_context():
    """Nothing is left behind."""

    def names() -> list[str]:
        return [thread.name for thread in threading.enumerate()]

    with watchdog(StandingLoop(is_driving=False), 0.0):
        assert names().count("watchdog") == 1
    assert "watchdog" not in names()


class Passing:
    """In place of the event that ends the thread: time passes while it is waited for; it comes at the third wait."""

    def __init__(self, clock: ManualClock) -> None:
        self.clock = clock
        self.waits_s: list[float] = []

    def wait(self, seconds: float) -> bool:
        """The time passes at once."""
        self.waits_s.append(seconds)
        self.clock.advance(seconds)
        return len(self.waits_s) == 3

    def set(self) -> None:
        """It comes by itself."""


def looks_of(
    loop: StandingLoop, timeout_s: float, monkeypatch: pytest.MonkeyPatch
) -> tuple[list[float], list[float]]:
    """How long the thread waits before each of three looks from 10 s on, and when it stops the motors."""
    passing, stops_s = Passing(ManualClock(10.0)), list[float]()

    def stop() -> bool:
        stops_s.append(passing.clock.now_s())
        return True

    threads = SimpleNamespace(Thread=threading.Thread, Event=lambda: passing)
    monkeypatch.setattr(watchdog_module, "threading", threads)
    parameters = WatchdogParameters(timeout_s=timeout_s)
    with Watchdog(parameters, passing.clock, loop, stop, loop.reported.append):
        pass
    return passing.waits_s, stops_s


@pytest.mark.parametrize("is_driving", [False, True])
def test_a_loop_is_looked_at_when_it_can_have_stood_too_long(
    is_driving: bool, monkeypatch: pytest.MonkeyPatch
):
    """It acted 0.02 s ago, of a patience of 2 s: nothing for 1.98 s; while it stands still, eight looks in that time."""
    waits_s, stops_s = looks_of(StandingLoop(is_driving=is_driving, acted_s=9.98), 2.0, monkeypatch)
    assert waits_s == pytest.approx([1.981, 0.25, 0.25])
    assert stops_s == pytest.approx([11.981, 12.231])


@pytest.mark.parametrize("is_driving", [False, True])
def test_a_loop_that_stands_still_is_stopped_as_soon_as_its_patience_has_passed(
    is_driving: bool, monkeypatch: pytest.MonkeyPatch
):
    """Acted 0.06 s before: of a patience of 0.4 s the rest is waited for, not a whole patience more."""
    _, stops_s = looks_of(StandingLoop(is_driving=is_driving, acted_s=9.94), 0.4, monkeypatch)
    assert stops_s[0] == pytest.approx(9.94 + 0.401)
