"""The robot's limits: speeds, both axes together, and the curvature that is kept."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from chefbotd.core.geometry import STANDING, Twist2D
from chefbotd.motion.limits import AT_REST, AngularLimits, LimiterState, LinearLimits, MotionLimits, limit
from tests.budget import examples

DT_S = 0.1


def limits(*, keep_curvature: bool = False, jerk: float | None = None, **linear: float) -> MotionLimits:
    """0.5 m/s at 1 m/s2 and 5 rad/s at 2 rad/s2, as the published planner; in reverse 0.2 m/s."""
    values = {"max_forward_m_s": 0.5, "max_reverse_m_s": 0.2, "acceleration_m_s2": 1.0} | linear
    return MotionLimits(
        linear=LinearLimits.model_validate(values | {"jerk_m_s3": jerk}),
        angular=AngularLimits(max_left_rad_s=5.0, acceleration_rad_s2=2.0, jerk_rad_s3=jerk),
        keep_curvature=keep_curvature,
    )


def follow(
    params: MotionLimits, target: Twist2D, steps: int, state: LimiterState = AT_REST
) -> list[LimiterState]:
    """The states after each of so many steps towards a target."""
    states = []
    for _ in range(steps):
        state = limit(params, state, target, DT_S)
        states.append(state)
    return states


def moving(linear_m_s: float, angular_rad_s: float) -> LimiterState:
    """Moving steadily."""
    return LimiterState(Twist2D(linear_m_s, angular_rad_s))


def test_both_axes_ramp_by_their_own_limit() -> None:
    """In 0.1 s from rest 0.1 m/s and 0.2 rad/s, with the accelerations to match."""
    (state,) = follow(limits(), Twist2D(0.5, 5.0), 1)
    assert (state.twist.linear_m_s, state.twist.angular_rad_s) == pytest.approx((0.1, 0.2))
    assert (state.acceleration.linear_m_s, state.acceleration.angular_rad_s) == pytest.approx((1.0, 2.0))


@pytest.mark.parametrize(
    ("target", "reached"),
    [
        (Twist2D(3.0, 0.0), Twist2D(0.5, 0.0)),
        (Twist2D(-3.0, 0.0), Twist2D(-0.2, 0.0)),
        (Twist2D(0.0, 9.0), Twist2D(0.0, 5.0)),
        (Twist2D(0.0, -9.0), Twist2D(0.0, -5.0)),
    ],
)
def test_speeds_end_at_their_limits(target: Twist2D, reached: Twist2D) -> None:
    """Whatever is asked, forward and reverse, left and right each stop at their own most."""
    assert follow(limits(), target, 40)[-1].twist == reached


def test_what_is_left_out_is_filled_in() -> None:
    """Reverse is as forward, braking as accelerating, reverse braking as braking, and jerk has no limit."""
    axis = LinearLimits(max_forward_m_s=0.5, acceleration_m_s2=1.0, deceleration_m_s2=3.0).axis
    assert (axis.max_reverse, axis.reverse_acceleration, axis.reverse_deceleration) == (0.5, 1.0, 3.0)
    assert math.isinf(axis.jerk)
    axis = AngularLimits(max_left_rad_s=5, acceleration_rad_s2=2, right_acceleration_rad_s2=1).axis
    assert (axis.max_reverse, axis.deceleration, axis.reverse_acceleration) == (5, 2, 1)


def test_reverse_has_limits_of_its_own() -> None:
    """Out of reverse at 4 m/s2: 0.05 s to zero, and 0.05 s forward at 1 m/s2."""
    params = limits(reverse_deceleration_m_s2=4.0)
    assert limit(params, moving(-0.2, 0.0), Twist2D(0.5, 0.0), DT_S).twist.linear_m_s == pytest.approx(0.05)


def test_a_robot_may_be_forbidden_to_reverse() -> None:
    """A limit of zero in reverse is a limit."""
    assert follow(limits(max_reverse_m_s=0.0), Twist2D(-0.1, 0.0), 3)[-1].twist == STANDING


@pytest.mark.parametrize("dt_s", [0.0, -1.0])
def test_no_time_no_change(dt_s: float) -> None:
    """A step without duration returns the very state."""
    state = moving(0.1, 0.2)
    assert limit(limits(), state, Twist2D(0.5, 5.0), dt_s) is state


def test_a_speed_limit_keeps_the_curvature() -> None:
    """1 m/s and 2 rad/s with at most 0.5 m/s is half of both; without keeping it, 2 rad/s are allowed."""
    assert follow(limits(keep_curvature=True), Twist2D(1.0, 2.0), 40)[-1].twist == Twist2D(0.5, 1.0)
    assert follow(limits(), Twist2D(1.0, 2.0), 40)[-1].twist == Twist2D(0.5, 2.0)


def test_the_slower_axis_sets_the_pace() -> None:
    """0.1 m/s needs 0.1 s, 2 rad/s needs 1 s: both are half way after half a second, and there after one."""
    states = follow(limits(keep_curvature=True), Twist2D(0.1, 2.0), 10)
    assert (states[4].twist.linear_m_s, states[4].twist.angular_rad_s) == pytest.approx((0.05, 1.0))
    assert (states[9].twist.linear_m_s, states[9].twist.angular_rad_s) == pytest.approx((0.1, 2.0))


def test_from_a_straight_line_both_axes_arrive_together() -> None:
    """From (0.5, 0) to (0.3, 2) takes 0.2 s against 1 s: at half a second it is (0.4, 1)."""
    states = follow(limits(keep_curvature=True), Twist2D(0.3, 2.0), 10, moving(0.5, 0.0))
    assert (states[4].twist.linear_m_s, states[4].twist.angular_rad_s) == pytest.approx((0.4, 1.0))
    assert states[9].twist.linear_m_s == pytest.approx(0.3)


arcs = st.tuples(st.floats(-0.2, 0.5), st.floats(-5, 5))
jerks = st.none() | st.floats(1, 50)


@given(arcs, st.floats(0.1, 0.9), jerks)
@settings(max_examples=examples(60))
def test_an_arc_is_one_circle_from_its_beginning(
    arc: tuple[float, float], slower: float, jerk: float | None
) -> None:
    """From rest to an arc, and then slower along it, the curvature is the one asked for at every step."""
    params = limits(keep_curvature=True, jerk=jerk)
    away = follow(params, Twist2D(*arc), 60)
    back = follow(params, Twist2D(arc[0] * slower, arc[1] * slower), 60, away[-1])
    for state in away + back:
        cross = state.twist.linear_m_s * arc[1] - state.twist.angular_rad_s * arc[0]
        assert cross == pytest.approx(0.0, abs=1e-6)


def test_a_stop_does_not_wait_for_the_slower_axis() -> None:
    """From (0.3, 2) the robot has stopped rolling after 0.3 s, although its turn takes a second to end."""
    states = follow(limits(keep_curvature=True), STANDING, 11, moving(0.3, 2.0))
    assert states[2].twist.linear_m_s == pytest.approx(0.0, abs=1e-15)
    assert states[2].twist.angular_rad_s == pytest.approx(1.4)
    assert states[10].twist == STANDING


@given(arcs, arcs, arcs, st.integers(1, 10), jerks)
@settings(max_examples=examples(60))
def test_a_target_changed_on_the_way_is_still_reached(
    first: tuple[float, float],
    second: tuple[float, float],
    third: tuple[float, float],
    after: int,
    jerk: float | None,
) -> None:
    """Changes in the middle of ramps never leave the limiter hanging."""
    params, state = limits(keep_curvature=True, jerk=jerk), AT_REST
    for target in (first, second):
        state = follow(params, Twist2D(*target), after, state)[-1]
    end = follow(params, Twist2D(*third), 300, state)[-1].twist
    assert (end.linear_m_s, end.angular_rad_s) == pytest.approx(third, abs=1e-6)


def test_jerk_limits_one_axis_and_so_both() -> None:
    """Only turning has a jerk limit, but the linear axis rises with it: the curvature 1 : 4 is kept."""
    params = MotionLimits(
        linear=LinearLimits(max_forward_m_s=0.5, acceleration_m_s2=1.0),
        angular=AngularLimits(max_left_rad_s=5.0, acceleration_rad_s2=2.0, jerk_rad_s3=4.0),
    )
    for state in follow(params, Twist2D(0.5, 2.0), 20):
        assert state.twist.angular_rad_s == pytest.approx(4 * state.twist.linear_m_s)


@pytest.mark.parametrize(
    ("key", "value"), [("acceleration_m_s2", 0.0), ("max_forward_m_s", -1.0), ("jerk_m_s3", math.inf)]
)
def test_limits_out_of_range_are_refused(key: str, value: float) -> None:
    """The message names the key."""
    with pytest.raises(ValidationError, match=key):
        LinearLimits.model_validate({"max_forward_m_s": 0.5, "acceleration_m_s2": 1.0, key: value})


@pytest.mark.parametrize(
    ("gap_m_s", "acceleration_m_s2"), [(0.02, 0.4), (0.05, 0.5), (0.1, 0.5), (0.01, 0.2)]
)
@pytest.mark.parametrize("direction", [1, -1])
def test_an_axis_that_already_accelerates_lands_at_its_target(
    gap_m_s: float, acceleration_m_s2: float, direction: int
) -> None:
    """The turn takes far longer, and still driving is not slowed so gently that it goes beyond what was asked for.

    With 0.4 m/s2 now and 0.02 m/s to go, the jerk has to be 0.4^2 / (2 * 0.02) = 4 m/s3 at least.
    """
    params = limits(keep_curvature=True, jerk=10.0, max_reverse_m_s=0.5)
    target = Twist2D(0.3 * direction, 2.0)
    before = LimiterState(
        Twist2D((0.3 - gap_m_s) * direction, 0.0), Twist2D(acceleration_m_s2 * direction, 0.0)
    )
    state = before
    for _ in range(300):
        state = limit(params, state, target, 0.01)
        assert abs(state.twist.linear_m_s) <= 0.3 + 1e-9
    assert (state.twist.linear_m_s, state.twist.angular_rad_s) == pytest.approx((0.3 * direction, 2.0))
