"""Wheels that do not do what their motors are told."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.wheels import (
    WheelWatchParameters,
    WheelWatchState,
    at_rest,
    note_jump,
    play_of,
    watch,
)
from tests.budget import examples

PARAMETERS = WheelWatchParameters()
NAMES = ("left_wheel", "right_wheel")
CYCLE_S = 0.05
COUNT_RAD = math.tau / 4200

Readings = list[tuple[tuple[float, float], tuple[float, float]]]


def watched(
    *readings: tuple[tuple[float, float], tuple[float, float]],
    cycle_s: float = CYCLE_S,
    play_rad: float = 0.0,
) -> tuple[float | None, Fault | None]:
    """Efforts and travels, reading by reading: when the first fault came (in seconds), and the fault."""
    state = at_rest(2)
    for count, (effort, travel_rad) in enumerate(readings, start=1):
        state, fault = watch(PARAMETERS, NAMES, state, effort, travel_rad, cycle_s, play_rad)
        if fault is not None:
            return count * cycle_s, fault
    return None, None


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("wheel", "travel_rad"), [(0, (0.0, 0.2)), (1, (0.2, 0.0))])
def test_a_wheel_that_is_driven_and_stands_is_stalled(
    direction: int, wheel: int, travel_rad: tuple[float, float]
):
    """The fault comes after 1.75 s, names the wheel and says what to check."""
    there = (travel_rad[0] * direction, travel_rad[1] * direction)
    at_s, fault = watched(*[((0.5 * direction, 0.5 * direction), there)] * 60)
    assert at_s == pytest.approx(1.75)
    assert fault.kind is FaultKind.WHEEL_STALLED
    assert fault.reason.startswith(NAMES[wheel])
    assert "motor has power" in fault.reason


@pytest.mark.parametrize(("effort", "at_s"), [(0.25, 1.75), (0.75, 0.8), (-1.0, 0.45)])
def test_hard_driving_of_a_wheel_that_stands_counts_with_its_square(effort: float, at_s: float):
    """Up to half of the range time counts as it is; at 3/4 1.5^2 times (0.78 s), at full duty four times (0.44 s)."""
    turning = math.copysign(0.2, effort)
    assert watched(*[((effort, effort), (0.0, turning))] * 60)[0] == pytest.approx(at_s)


def test_a_wheel_that_stands_for_a_while_and_then_turns_is_no_fault():
    """Static friction that takes 1.5 s to be overcome, again and again, is not a stall: 0.1 rad is a new start."""
    stuck, turned = ((0.5, 0.5), (0.0, 0.0)), ((0.5, 0.5), (0.1, 0.1))
    assert watched(*([stuck] * 30 + [turned]) * 5) == (None, None)


@pytest.mark.parametrize("every", [10, 20, 35, 80])
def test_a_reading_that_the_next_one_takes_back_clears_no_wheel(every: int):
    """One reading in so many is damaged, looks like 0.3 rad ahead, and the next like 0.3 rad back: stalled by 1.9 s."""
    leaps = {every - 1: 0.3, 0: -0.3}
    lines = [((0.5, 0.5), (0.2, leaps.get(n % every, 0.0) if n else 0.0)) for n in range(200)]
    at_s, fault = watched(*lines)
    assert fault.kind is FaultKind.WHEEL_STALLED
    assert at_s <= 1.9


def test_a_wheel_that_is_hardly_driven_may_stand():
    """Below a fifth of the duty range friction may well hold it."""
    assert watched(*[((0.19, -0.19), (0.0, 0.0))] * 200) == (None, None)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_wheel_that_turns_against_its_motor_is_reversed(direction: int):
    """At 5 rad/s the wrong way, 0.25 rad a reading, 1 rad is four readings."""
    readings = [((0.5 * direction, 0.5 * direction), (0.25 * direction, -0.25 * direction))] * 20
    at_s, fault = watched(*readings)
    assert at_s == pytest.approx(4 * CYCLE_S)
    assert fault.kind is FaultKind.WHEEL_REVERSED
    assert fault.reason.startswith("right_wheel")
    assert "wired backwards" in fault.reason


@pytest.mark.parametrize("leap_rad", [-3.0, 3.0])
def test_a_reading_that_the_next_one_takes_back_reverses_no_wheel(leap_rad: float):
    """3 rad off to either side, then back: a third of a radian against the wheel, which 0.4 rad with it take off."""
    ahead = both(0.5, 0.2)
    wrong = both(0.5, 0.2 + leap_rad) + both(0.5, 0.2 - leap_rad)
    assert watched(*(ahead * 4 + wrong) * 20) == (None, None)


def test_a_reading_after_a_gap_weighs_as_much_as_its_time():
    """A reversed wheel that is heard every quarter of a second, and goes 1.2 rad meanwhile: found at once."""
    assert watched(*both(0.5, -1.2, 3), cycle_s=0.25)[0] == 0.25
    assert watched(*both(0.5, -1.2, 3), cycle_s=0.125)[0] == 0.25


def test_a_wheel_that_still_rolls_when_its_motor_turns_round_is_no_fault():
    """After a reversal the wheel coasts 0.9 rad before it follows: less than a reversed one goes."""
    onward, coasting, back = (
        ((0.5, 0.5), (0.3, 0.3)),
        ((-0.5, -0.5), (0.3, 0.3)),
        ((-0.5, -0.5), (-0.3, -0.3)),
    )
    assert watched(*[onward] * 10, *[coasting] * 4, *[back] * 10) == (None, None)


@given(
    st.lists(st.tuples(st.floats(-1, 1), st.floats(0.0, 0.4)), max_size=100),
    st.sampled_from([0.01, 0.05, 0.5]),
)
@settings(max_examples=examples(50))
def test_wheels_that_follow_their_motors_are_never_at_fault(story: list[tuple[float, float]], cycle_s: float):
    """Whatever the effort, a wheel that turns its way by 0.1 rad or more a reading raises nothing."""
    readings = []
    for effort, extra_rad in story:
        travel_rad = (0.1 + extra_rad) * (1 if effort > 0 else -1)
        readings.append(((effort, -effort), (travel_rad, -travel_rad)))
    assert watched(*readings, cycle_s=cycle_s) == (None, None)


def both(effort: float, travel_rad: float, times: int = 1) -> Readings:
    """So many readings in which both wheels were pushed and went alike."""
    return [((effort, effort), (travel_rad, travel_rad))] * times


@pytest.mark.parametrize("readings_a_push", [1, 4, 20])
def test_a_wheel_that_stands_is_stalled_however_often_the_direction_changes(readings_a_push: int):
    """To and fro every 0.05, 0.2 or 1 s: 1.75 s of driving are 1.75 s."""
    there, back = both(0.5, 0.0, readings_a_push), both(-0.5, 0.0, readings_a_push)
    at_s, fault = watched(*(there + back) * 20)
    assert at_s == pytest.approx(1.75)
    assert fault.kind is FaultKind.WHEEL_STALLED


@given(st.lists(st.tuples(st.sampled_from([1, -1]), st.integers(-1, 1)), min_size=36, max_size=60))
@settings(max_examples=examples(100))
def test_whatever_the_directions_a_wheel_that_only_dithers_is_found(story: list[tuple[int, int]]):
    """Driven without a pause, standing within a count to either side: found after exactly 1.75 s."""
    readings, at_counts = [], 0
    for direction, counts in story:
        effort, travel_rad = 0.3 * direction, (counts - at_counts) * COUNT_RAD
        readings.append(((effort, effort), (travel_rad, 0.2 * direction)))
        at_counts = counts
    at_s, fault = watched(*readings, play_rad=play_of(4200))
    assert at_s == pytest.approx(1.75)
    assert fault.reason.startswith("left_wheel")


def test_an_encoder_may_dither_within_three_counts():
    """Of 4200 counts per turn: 0.0045 rad from end to end, and half of that to take up from the middle."""
    assert play_of(4200) == pytest.approx(0.00449, abs=1e-5)
    nearly, beyond = 1.4 * COUNT_RAD, 1.6 * COUNT_RAD
    for reach_rad, pushed_s in ((nearly, 0.05), (beyond, 0.0)):
        params = WheelWatchParameters(turned_rad=0.05 * COUNT_RAD)
        state, _ = watch(params, NAMES, at_rest(2), (0.5, 0.5), (reach_rad, reach_rad), 0.05, play_of(4200))
        assert state.pushes[0].pushed_s == pushed_s


@pytest.mark.parametrize("direction", [1, -1])
def test_a_wheel_that_is_shaken_under_a_steady_push_is_stalled(direction: int):
    """Forward by 0.06 rad and back again, far beyond its play: it gets nowhere, pushed ahead or back."""
    shaken = both(0.5 * direction, 0.06 * direction) + both(0.5 * direction, -0.06 * direction)
    at_s, fault = watched(*shaken * 40)
    assert at_s == pytest.approx(1.75)
    assert fault.kind is FaultKind.WHEEL_STALLED


def test_a_healthy_wheel_may_be_rocked_for_ever():
    """Every 0.2 s the other way and 0.03 rad at a time: 0.0255 beyond the play, so that four pushes clear it."""
    there, back = both(0.5, 0.0, 3) + both(0.5, 0.03), both(-0.5, 0.0, 3) + both(-0.5, -0.03)
    assert watched(*(there + back) * 100, play_rad=play_of(4200)) == (None, None)


@pytest.mark.parametrize("readings_a_turn", [4, 8, 20])
def test_a_healthy_wheel_that_lags_behind_its_pushes_is_no_fault(readings_a_turn: int):
    """All inertia: pushed the way that it accelerates, it goes the wrong way for half of each push."""
    readings, before_rad = [], 0.0
    for count in range(1, 400):
        phase_rad = math.tau * count / readings_a_turn
        position_rad = 0.3 * math.sin(phase_rad)
        effort = -0.5 if math.sin(phase_rad - math.pi / readings_a_turn) > 0 else 0.5
        readings += both(effort, position_rad - before_rad)
        before_rad = position_rad
    assert watched(*readings) == (None, None)


def test_suspicion_outlasts_short_pauses():
    """0.5 s driven, 0.5 s not, which takes off 1.75 * 0.5 / 30 s: 1.41 s are left of three rounds, 7 readings to go."""
    rounds = both(0.5, 0.0, 10) + both(0.0, 0.0, 10)
    at_s, fault = watched(*rounds * 10)
    assert at_s == pytest.approx(3.35)
    assert fault.kind is FaultKind.WHEEL_STALLED


def test_a_long_pause_forgets():
    """After half a minute the 1.7 s of before are none."""
    assert watched(*(both(0.5, 0.0, 34) + both(0.0, 0.0, 601)) * 5) == (None, None)


@pytest.mark.parametrize("travel_rad", [0.11, -0.11])
def test_a_wheel_that_turns_while_it_is_not_driven_is_not_stalled(travel_rad: float):
    """Rolling on after a push, or pushed by hand: it is not blocked, and its encoder lives."""
    assert watched(*(both(0.5, 0.0, 30) + both(0.1, travel_rad)) * 5) == (None, None)


def test_a_fault_is_told_of_a_driven_wheel_only():
    """The reading after it, with the motors off, tells it no more: whoever looks then would disarm anew."""
    state = at_rest(2)
    for _ in range(36):
        state, fault = watch(PARAMETERS, NAMES, state, (0.5, 0.5), (0.0, 0.0), CYCLE_S, 0.0)
    assert fault is not None
    _, fault = watch(PARAMETERS, NAMES, state, (0.0, 0.0), (0.0, 0.0), CYCLE_S, 0.0)
    assert fault is None


def test_a_reversed_wheel_is_found_however_often_the_direction_changes():
    """Every 0.2 s: 0.05 rad on as before, which looks right, and 0.3 wrong: with the fourth push 1.05 rad."""
    there = both(0.5, 0.05) + both(0.5, -0.1, 3)
    back = both(-0.5, -0.05) + both(-0.5, 0.1, 3)
    at_s, fault = watched(*(there + back) * 5)
    assert at_s == pytest.approx(16 * CYCLE_S)
    assert fault.kind is FaultKind.WHEEL_REVERSED


def test_a_wheel_does_not_roll_on_for_ever():
    """Swapped encoders, found as one wheel turns back: 0.5 s may be rolling on, the four readings after it are not."""
    onward, other = both(0.5, 0.25, 8), both(-0.5, 0.25, 20)
    at_s, fault = watched(*onward, *other, cycle_s=0.125)
    assert at_s == (8 + 4 + 4) * 0.125
    assert fault.kind is FaultKind.WHEEL_REVERSED


def refuse(
    state: WheelWatchState, times: int, jumped: tuple[int, ...] = (1,)
) -> tuple[WheelWatchState, Fault | None]:
    """So many refused readings on end, and the last one's fault."""
    fault = None
    for _ in range(times):
        state, fault = note_jump(PARAMETERS, NAMES, state, jumped)
    return state, fault


def test_an_encoder_that_keeps_jumping_is_a_fault():
    """Nine refused readings are bad luck, ten are an encoder; the other wheel is not blamed."""
    state, fault = refuse(at_rest(2), 9)
    assert fault is None
    _, fault = refuse(state, 1)
    assert fault.kind is FaultKind.ENCODER_JUMPS
    assert fault.reason.startswith("right_wheel has")


def test_what_the_board_does_not_send_is_named_before_a_loose_contact():
    """Without the board's time a line that waited looks like a jump."""
    state, fault = at_rest(2), None
    for _ in range(10):
        state, fault = note_jump(
            PARAMETERS, NAMES, state, (0,), ("time ('t' lines)", "echo of its duty ('s' lines)")
        )
    assert fault.kind is FaultKind.ENCODER_JUMPS
    assert "the board sends no time ('t' lines) and no echo of its duty ('s' lines)" in fault.reason
    assert fault.reason.index("'t' lines") < fault.reason.index("loose contact")


def test_both_wheels_are_named_when_both_jump():
    """A common cause is told as such."""
    _, fault = refuse(at_rest(2), 10, (0, 1))
    assert fault.reason.startswith("left_wheel and right_wheel has")


def test_a_damaged_line_now_and_then_is_forgiven():
    """One refused reading in five: 1 - 4 * 0.25 = 0, so it goes on for ever without a fault."""
    state = at_rest(2)
    for _ in range(100):
        state, fault = refuse(state, 1)
        assert fault is None
        for _ in range(4):
            state, fault = watch(PARAMETERS, NAMES, state, (0.5, 0.5), (0.2, 0.2), CYCLE_S, 0.0)
            assert fault is None
    assert state.jumps == (0.0, 0.0)


@pytest.mark.parametrize("way", [1, -1])
def test_the_first_push_of_all_has_nothing_to_roll_on_from(way: int):
    """0.1 rad against it with each reading, 20 of them a second: reversed after 1 rad, 0.5 s, whichever way it goes."""
    at_s, fault = watched(*[((0.4 * way, 0.3 * way), (-0.1001 * way, 0.2 * way))] * 60)
    assert at_s == pytest.approx(0.5)
    assert fault.kind is FaultKind.WHEEL_REVERSED


def test_short_pauses_give_no_new_time_to_roll_on():
    """Backwards, 0.105 rad against it with each of four readings, then one undriven: the tenth driven one is enough."""
    pushed, paused = ((-0.4, -0.3), (0.105, -0.2)), ((0.0, 0.0), (0.0, 0.0))
    at_s, fault = watched(*[*[pushed] * 4, paused] * 5)
    assert at_s == pytest.approx(12 * CYCLE_S)
    assert fault.kind is FaultKind.WHEEL_REVERSED


def test_wrong_travel_is_no_debt():
    """Half a radian against the push, then 0.12 rad with it: that clears the wheel, and it is stalled 1.75 s later."""
    against, ahead, stands = [((0.4, 0.3), (travel, 0.2)) for travel in (-0.1, 0.06, 0.0)]
    at_s, fault = watched(*[against] * 5, *[ahead] * 2, *[stands] * 60)
    assert at_s == pytest.approx(7 * CYCLE_S + 1.75)
    assert fault.kind is FaultKind.WHEEL_STALLED


@pytest.mark.parametrize("effort", [0.2, -0.2])
def test_just_the_share_of_the_duty_range_is_driven(effort: float):
    """51 of 255 is 0.2: a wheel that stands at that is stalled after 1.75 s."""
    at_s, _ = watched(*[((effort, effort), (0.0, math.copysign(0.2, effort)))] * 40)
    assert at_s == pytest.approx(1.75)
