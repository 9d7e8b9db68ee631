"""Wheels that do not do what their motors are told."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.wheels import WheelWatchParameters, WheelWatchState, at_rest, note_jump, watch

PARAMETERS = WheelWatchParameters()
NAMES = ("left_wheel", "right_wheel")
CYCLE_S = 0.05


def watched(
    *readings: tuple[tuple[float, float], tuple[float, float]], cycle_s: float = CYCLE_S
) -> tuple[float | None, Fault | None]:
    """Efforts and travels, reading by reading: when the first fault came (in seconds), and the fault."""
    state = at_rest(2)
    for count, (effort, travel_rad) in enumerate(readings, start=1):
        state, fault = watch(PARAMETERS, NAMES, state, effort, travel_rad, cycle_s)
        if fault is not None:
            return count * cycle_s, fault
    return None, None


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("wheel", "travel_rad"), [(0, (0.0, 0.2)), (1, (0.2, 0.0))])
def test_a_wheel_that_is_driven_and_stands_is_stalled(
    direction: int, wheel: int, travel_rad: tuple[float, float]
):
    """The first reading begins the push, the fault comes 1.75 s later, names the wheel and says what to check."""
    there = (travel_rad[0] * direction, travel_rad[1] * direction)
    at_s, fault = watched(*[((0.5 * direction, 0.5 * direction), there)] * 60)
    assert at_s == pytest.approx(CYCLE_S + 1.75)
    assert fault.kind is FaultKind.WHEEL_STALLED
    assert fault.reason.startswith(NAMES[wheel])
    assert "motor has power" in fault.reason


def test_a_wheel_that_stands_for_a_while_and_then_turns_is_no_fault():
    """Static friction that takes 1.5 s to be overcome, again and again, is not a stall: 0.1 rad is a new start."""
    stuck, turned = ((0.5, 0.5), (0.0, 0.0)), ((0.5, 0.5), (0.1, 0.1))
    assert watched(*([stuck] * 30 + [turned]) * 5) == (None, None)


def test_a_wheel_that_is_hardly_driven_may_stand():
    """Below a fifth of the duty range friction may well hold it."""
    assert watched(*[((0.19, -0.19), (0.0, 0.0))] * 200) == (None, None)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_wheel_that_turns_against_its_motor_is_reversed(direction: int):
    """At 5 rad/s the wrong way, 0.25 rad a reading, 1 rad is four readings after the one that begins the push."""
    readings = [((0.5 * direction, 0.5 * direction), (0.25 * direction, -0.25 * direction))] * 20
    at_s, fault = watched(*readings)
    assert at_s == pytest.approx(5 * CYCLE_S)
    assert fault.kind is FaultKind.WHEEL_REVERSED
    assert fault.reason.startswith("right_wheel")
    assert "wired backwards" in fault.reason


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
@settings(max_examples=50)
def test_wheels_that_follow_their_motors_are_never_at_fault(story: list[tuple[float, float]], cycle_s: float):
    """Whatever the effort, a wheel that turns its way by 0.1 rad or more a reading raises nothing."""
    readings = []
    for effort, extra_rad in story:
        travel_rad = (0.1 + extra_rad) * (1 if effort > 0 else -1)
        readings.append(((effort, -effort), (travel_rad, -travel_rad)))
    assert watched(*readings, cycle_s=cycle_s) == (None, None)


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
            state, fault = watch(PARAMETERS, NAMES, state, (0.5, 0.5), (0.2, 0.2), CYCLE_S)
            assert fault is None
    assert state.jumps == (0.0, 0.0)
