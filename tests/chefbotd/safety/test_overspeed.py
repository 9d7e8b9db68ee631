"""Wheels that are faster than they were asked to be."""

import pytest

from chefbotd.safety import overspeed
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.overspeed import OverspeedParameters, OverspeedState

P = OverspeedParameters()
NAMES = ("left", "right")
REST = overspeed.at_rest(2)

Step = tuple[tuple[float, float], tuple[float, float], float]
"""Asked in m/s, driven in m/s, for so long in s."""


def after(*steps: Step, cycle_s: float = 0.05, state: OverspeedState = REST) -> tuple[float, Fault | None]:
    """The seconds until the first fault, or all of them without one."""
    now_s = 0.0
    for asked, driven, seconds in steps:
        for _ in range(round(seconds / cycle_s)):
            now_s += cycle_s
            travel = (driven[0] * cycle_s, driven[1] * cycle_s)
            state, fault = overspeed.watch(P, NAMES, state, asked, travel, cycle_s)
            if fault is not None:
                return now_s, fault
    return now_s, None


def test_a_feedforward_for_another_scale_is_found() -> None:
    """Allowed are 0.2 * 1.15 + 0.04 = 0.27 m/s: at 0.377 it is 16 mm too far after 0.15 s, and 0.1 s later a fault."""
    found_s, fault = after(((0.2, 0.2), (0.377, 0.377), 1.0))
    assert found_s == pytest.approx(0.25)
    assert fault is not None
    assert fault.kind is FaultKind.OVERSPEED
    assert fault.reason.startswith("left and right much faster than asked (0.38 m/s instead of 0.20)")


@pytest.mark.parametrize("cycle_s", [0.004, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_one_wheel_is_enough_in_either_direction_at_any_rate(way: float, cycle_s: float) -> None:
    """Asked for 0.1 m/s and driven at 0.377 the wheel is named within half a second."""
    asked, driven = (0.21 * way, 0.1 * way), (0.2 * way, 0.377 * way)
    found_s, fault = after((asked, driven, 2.0), cycle_s=cycle_s)
    assert found_s <= 0.5
    assert fault is not None
    assert fault.reason.startswith("right much faster")


@pytest.mark.parametrize("speed_m_s", [0.02, 0.2, -0.34])
def test_a_tenth_too_fast_is_no_fault(speed_m_s: float) -> None:
    """Nor is an overshoot of 0.1 m/s for a tenth of a second."""
    other = speed_m_s / 3
    steady = ((speed_m_s, other), (1.1 * speed_m_s, 1.1 * other), 30.0)
    overshoot = ((speed_m_s, other), (speed_m_s + 0.1, other), 0.1)
    assert after(steady, overshoot, steady)[1] is None


@pytest.mark.parametrize("cycle_s", [0.02, 0.05])
def test_a_wheel_that_brakes_is_no_fault(cycle_s: float) -> None:
    """From 0.34 m/s the setpoint is at 0.05 at once, and the wheel goes on as before for 0.1 s and slows by 1 m/s2."""
    braking: list[Step] = [((0.34, -0.3), (0.34, -0.3), 1.0), ((0.05, -0.05), (0.34, -0.3), 0.1)]
    braking += [((0.05, -0.05), (speed, -speed), cycle_s) for speed in (0.3, 0.25, 0.2, 0.15, 0.1, 0.05)]
    assert after(*braking, cycle_s=cycle_s)[1] is None


def test_what_is_hardly_beyond_the_allowance_is_found_late_or_never() -> None:
    """Asked for 0.3 m/s, allowed are 0.385: 0.387 m/s is 15 mm beyond after 7.5 s, 0.384 m/s never."""
    found_s, fault = after(((0.3, 0.25), (0.387, 0.25), 10.0))
    assert fault is not None
    assert 7.5 < found_s < 8.0
    assert after(((0.3, 0.25), (0.384, 0.25), 60.0))[1] is None


def test_a_wheel_that_does_not_brake_is_found() -> None:
    """Asked for 0.05 m/s after 0.34, and still as fast a second later."""
    fast, still_fast = ((0.34, 0.34), (0.34, 0.34), 1.0), ((0.05, 0.05), (0.34, 0.34), 1.0)
    found_s, fault = after(fast, still_fast)
    assert fault is not None
    assert 1.2 < found_s < 1.8


def test_a_second_of_silence_is_judged_by_what_was_asked_before_it() -> None:
    """0.2 m/s for a quarter of a second, and nothing since, is 50 mm in a reading that took 1.1 s."""
    state, fault = overspeed.watch(P, NAMES, REST, (0.2, 0.19), (0.01, 0.0095), 0.05)
    assert fault is None
    _, fault = overspeed.watch(P, NAMES, state, (0.001, 0.0), (0.07, 0.066), 1.1)
    assert fault is None


def test_one_leap_of_a_damaged_reading_is_no_fault() -> None:
    """10 cm ahead, and back with the next reading."""
    state: OverspeedState = REST
    for travel in (0.01, 0.1, -0.08, 0.01, 0.01, 0.01):
        state, fault = overspeed.watch(P, NAMES, state, (0.2, 0.2), (travel, 0.01), 0.05)
        assert fault is None


def test_lines_that_come_together_are_no_fault() -> None:
    """Readings that were held up for 50 ms come at once, with stamps that are as late: again and again."""
    state: OverspeedState = REST
    for _ in range(50):
        for dt_s in (0.05, 0.0, 0.0, 0.0, 0.0):
            state, fault = overspeed.watch(P, NAMES, state, (0.34, 0.3), (0.0034, 0.003), dt_s)
            assert fault is None


def test_who_is_left_out_or_not_driven_is_not_judged() -> None:
    """A wheel whose encoder is not believed may show anything; a robot that stands may be pushed."""
    state: OverspeedState = REST
    for _ in range(100):
        state, fault = overspeed.watch(P, NAMES, state, (0.2, 0.2), (0.05, 0.01), 0.05, excluded=(0,))
        assert fault is None
    assert after(((0.0, 0.0), (0.5, -0.4), 5.0))[1] is None


def test_a_leap_and_then_just_what_is_allowed_is_no_fault() -> None:
    """10 cm in one reading counts 12 mm; at 0.2 * 1.15 + 0.04 = 0.27 m/s nothing is added to it or taken off."""
    state, fault = overspeed.watch(P, NAMES, REST, (0.2, -0.1), (0.1, -0.005), 0.05)
    assert fault is None
    for _ in range(40):
        state, fault = overspeed.watch(P, NAMES, state, (0.2, -0.1), (0.0135, -0.005), 0.05)
        assert fault is None
    assert state[0].ahead_m == pytest.approx(0.012)


@pytest.mark.parametrize(
    ("asked", "driven", "told"),
    [
        ((-0.1, -0.1), (-0.5, -0.45), "(-0.50 m/s instead of -0.10)"),
        ((-0.3, -0.05), (-0.6, -0.5), "(-0.50 m/s instead of -0.05)"),
    ],
)
def test_the_worst_of_two_wheels_is_told_in_numbers(
    asked: tuple[float, float], driven: tuple[float, float], told: str
) -> None:
    """Backwards: the wheel that is farthest beyond what it was asked for, not the fastest."""
    _, fault = after((asked, driven, 1.0))
    assert fault is not None
    assert fault.reason.startswith(f"left and right much faster than asked {told}")
