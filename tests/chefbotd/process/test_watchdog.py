"""The watchdog thread, beside a control loop that stands still for as long as the test says."""

import threading
import time
from dataclasses import dataclass, field

import pytest

from chefbotd.clock import ManualClock, SystemClock
from chefbotd.process.watchdog import Watchdog
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.watchdog import WatchdogParameters

SOON_S = 5.0
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
        assert loop.stopped.wait(SOON_S)
    assert loop.reported[0].kind is FaultKind.LOOP_BLOCKED
    assert loop.reported[0].reason.startswith(f"the control loop did not run for 1.02 s and {told}")


def test_a_short_pause_while_driving_is_stopped_and_left_to_the_loop():
    """The motors are stopped at once; whether it is a fault, the loop knows, which counts its pauses."""
    loop = StandingLoop()
    with watchdog(loop, now_s=0.12):
        assert loop.stopped.wait(SOON_S)
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
        assert loop.stopped.wait(SOON_S)
    assert not loop.reported


def test_the_thread_ends_with_its_context():
    """Nothing is left behind."""
    before = threading.active_count()
    with watchdog(StandingLoop(is_driving=False), 0.0):
        assert threading.active_count() == before + 1
    assert threading.active_count() == before


class CountingClock(ManualClock):
    """Counts how often it is read."""

    reads = 0

    def now_s(self) -> float:
        self.reads += 1
        return super().now_s()


def test_a_loop_at_rest_is_looked_at_when_it_can_have_stood_too_long():
    """It acted 0.02 s ago, of a patience of 2 s: nothing for a while; while it drives, eight looks in that time."""
    looks = []
    for is_driving in (False, True):
        clock, loop = CountingClock(10.0), StandingLoop(is_driving=is_driving, acted_s=9.98)
        parameters = WatchdogParameters(timeout_s=2.0)
        with Watchdog(parameters, clock, loop, loop.stop, loop.reported.append):
            time.sleep(0.6)
        looks.append(clock.reads)
    assert looks[0] == 1
    assert looks[1] >= 1
    assert not loop.reported


def test_a_loop_at_rest_that_stands_still_is_stopped_within_its_patience():
    """Acted at 0, looked at first 0.06 s later: the stop comes after 0.1 s, not after a whole patience more."""
    clock, loop = SystemClock(), StandingLoop(is_driving=False)
    loop.acted_s = clock.now_s() - 0.06
    with Watchdog(WatchdogParameters(timeout_s=0.4), clock, loop, loop.stop, loop.reported.append):
        assert not loop.stopped.wait(0.2)
        assert loop.stopped.wait(SOON_S)
        assert clock.now_s() - loop.acted_s > 0.4
