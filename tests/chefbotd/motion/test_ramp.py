"""One axis from one speed to another: ramps, S-curves, and the way through zero."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.motion.ramp import AxisLimits, advance, braking_distance
from tests.budget import examples


def limits(**changes: float) -> AxisLimits:
    """Forward 2 up and 4 down, in reverse 1 up and 3 down, without a jerk limit."""
    values = {
        "max_forward": 1.0,
        "max_reverse": 0.5,
        "acceleration": 2.0,
        "deceleration": 4.0,
        "reverse_acceleration": 1.0,
        "reverse_deceleration": 3.0,
        "jerk": math.inf,
    }
    return AxisLimits(**(values | changes))


@pytest.mark.parametrize(
    ("speed", "target", "reached"),
    [
        (0.0, 1.0, 0.2),  # away from rest at 2
        (0.5, 1.0, 0.7),  # faster at 2
        (0.5, 0.0, 0.1),  # braking at 4
        (0.0, -1.0, -0.1),  # into reverse at 1
        (-0.4, -1.0, -0.5),  # faster in reverse at 1
        (-0.4, 0.0, -0.1),  # braking in reverse at 3
        (0.5, 0.55, 0.55),  # no further than the target
        (0.5, 0.5, 0.5),
        (0.2, -1.0, -0.05),  # 50 ms to zero at 4, then 50 ms into reverse at 1
        (-0.15, 1.0, 0.1),  # 50 ms to zero at 3, then 50 ms forward at 2
        (0.8, -1.0, 0.4),  # zero not reached yet
    ],
)
def test_each_quarter_has_its_own_limit(speed: float, target: float, reached: float) -> None:
    """After 100 ms towards the target, the speed worked out by hand."""
    assert advance(limits(), speed, 0.0, target, 0.1)[0] == pytest.approx(reached, abs=1e-15)


def test_a_ramp_reports_its_mean_acceleration() -> None:
    """0.05 gained in 0.1 s is 0.5, although the ramp itself was steeper and then flat."""
    assert advance(limits(), 0.5, 0.0, 0.55, 0.1)[1] == pytest.approx(0.5)


def trace(
    axis: AxisLimits, speed: float, target: float, dt_s: float, steps: int
) -> list[tuple[float, float]]:
    """Speed and acceleration after each step, from rest of the acceleration."""
    points, acceleration = [(speed, 0.0)], 0.0
    for _ in range(steps):
        speed, acceleration = advance(axis, speed, acceleration, target, dt_s)
        points.append((speed, acceleration))
    return points


def test_an_s_curve_by_hand() -> None:
    """0 to 1 at 2 with a jerk of 4: rise 0.5 s to 0.5, fall 0.5 s, and never a hold.

    At 0.25 s the speed is 4 * 0.25**2 / 2 = 0.125; at 0.5 s it is 0.5 and the acceleration 2; at 1 s it is there.
    """
    points = trace(limits(jerk=4.0), 0.0, 1.0, 0.25, 5)
    expected = [(0, 0), (0.125, 1), (0.5, 2), (0.875, 1), (1, 0), (1, 0)]
    assert [value for point in points for value in point] == pytest.approx(
        [value for point in expected for value in point], abs=1e-12
    )


def test_an_s_curve_holds_its_acceleration() -> None:
    """0 to 1 at 1 with a jerk of 4: 0.25 s rise (0.125), 0.75 s hold (0.75), 0.25 s fall (0.125)."""
    points = trace(limits(jerk=4.0, acceleration=1.0), 0.0, 1.0, 0.125, 10)
    assert points[2] == pytest.approx((0.125, 1))
    assert points[8] == pytest.approx((0.875, 1))
    assert points[10] == (1.0, 0.0)


def test_an_acceleration_under_way_ends_before_the_speed_turns_round() -> None:
    """A stop asked for at 0.5 and rising by 2: the speed peaks at 0.5 + 2**2 / (2 * 8) = 0.75."""
    axis, speed, acceleration, peak = limits(jerk=8.0), 0.5, 2.0, 0.0
    for _ in range(200):
        speed, acceleration = advance(axis, speed, acceleration, 0.0, 0.01)
        peak = max(peak, speed)
    assert peak == pytest.approx(0.75, abs=1e-3)
    assert (speed, acceleration) == (0.0, 0.0)


def test_an_acceleration_too_large_to_end_in_time_overshoots_and_returns() -> None:
    """From 0.9 rising by 2 at a jerk of 4, a target of 1 is passed by 0.4 and then reached for good."""
    axis, speed, acceleration, peak = limits(jerk=4.0), 0.9, 2.0, 0.0
    for _ in range(300):
        speed, acceleration = advance(axis, speed, acceleration, 1.0, 0.01)
        peak = max(peak, speed)
    assert peak == pytest.approx(1.4, abs=1e-3)
    assert (speed, acceleration) == (1.0, 0.0)


def test_braking_into_reverse_is_as_gentle_at_zero_as_reverse_demands() -> None:
    """From 1 to -0.5 the braking limit of 4 gives way to the 1 of reverse, smoothly, by the time of zero."""
    axis = limits(jerk=20.0)
    points = trace(axis, 1.0, -0.5, 0.001, 1500)
    assert min(acceleration for speed, acceleration in points) == pytest.approx(-4.0, abs=1e-9)
    assert min(acceleration for speed, acceleration in points if speed <= 0) == pytest.approx(-1.0, abs=1e-9)
    assert points[-1] == (-0.5, 0.0)


def test_a_harder_acceleration_beyond_zero_waits_for_zero() -> None:
    """From reverse, braked at 1, to forward at 2: the acceleration passes 1 only beyond zero speed."""
    axis = limits(jerk=20.0, reverse_deceleration=1.0)
    points = trace(axis, -0.5, 1.0, 0.001, 2000)
    assert max(acceleration for speed, acceleration in points if speed < 0) == pytest.approx(1.0, abs=1e-9)
    assert max(acceleration for speed, acceleration in points) == pytest.approx(2.0, abs=1e-9)
    assert points[-1] == (1.0, 0.0)


speeds = st.floats(-1, 1)
rates = st.floats(0.1, 10)
axes = st.builds(
    AxisLimits,
    max_forward=st.just(1.0),
    max_reverse=st.just(1.0),
    acceleration=rates,
    deceleration=rates,
    reverse_acceleration=rates,
    reverse_deceleration=rates,
    jerk=st.floats(0.5, 200) | st.just(math.inf),
)
periods = st.lists(st.floats(0.001, 0.1), min_size=1, max_size=40)


@given(axes, speeds, speeds, periods)
@settings(max_examples=examples(150))
def test_the_target_is_approached_and_never_passed(
    axis: AxisLimits, speed: float, target: float, periods_s: list[float]
) -> None:
    """From a steady speed, each step goes towards the target or waits, and none goes beyond."""
    acceleration, direction = 0.0, math.copysign(1.0, target - speed)
    for dt_s in periods_s:
        before = speed
        speed, acceleration = advance(axis, speed, acceleration, target, dt_s)
        assert direction * (speed - before) >= -1e-12
        assert direction * (target - speed) >= -1e-12


@given(axes, speeds, speeds, periods)
@settings(max_examples=examples(150))
def test_acceleration_and_jerk_stay_within_their_limits(
    axis: AxisLimits, speed: float, target: float, periods_s: list[float]
) -> None:
    """From a steady speed no step changes the speed or the acceleration faster than allowed."""
    acceleration = 0.0
    for dt_s in periods_s:
        before, rate_before = speed, acceleration
        speed, acceleration = advance(axis, speed, acceleration, target, dt_s)
        steepest = max(axis.rate(v, target - before) for v in (before, speed)) if target != before else 0.0
        assert abs(speed - before) / dt_s <= steepest * (1 + 1e-6) + 1e-6
        if math.isfinite(axis.jerk):
            assert abs(acceleration - rate_before) <= axis.jerk * dt_s * (1 + 1e-6) + 1e-6


@given(axes, speeds, speeds, st.floats(0.001, 2.0), st.floats(0.05, 0.95))
@settings(max_examples=examples(150))
def test_the_way_does_not_depend_on_its_steps(
    axis: AxisLimits, speed: float, target: float, dt_s: float, cut: float
) -> None:
    """From a steady speed, one step or two that are together as long end at the same speed."""
    whole, _ = advance(axis, speed, 0.0, target, dt_s)
    between = advance(axis, speed, 0.0, target, dt_s * cut)
    parts, _ = advance(axis, *between, target, dt_s - dt_s * cut)
    assert parts == pytest.approx(whole, abs=1e-6)


@given(axes, speeds, st.floats(-1, 1), speeds)
@settings(max_examples=examples(60))
def test_every_target_is_reached(axis: AxisLimits, speed: float, acceleration: float, target: float) -> None:
    """However the axis moves now, it comes to exactly the target, without any acceleration left."""
    for _ in range(400):
        speed, acceleration = advance(axis, speed, acceleration, target, 0.2)
    assert (speed, acceleration) == (target, 0.0)


@given(
    st.floats(0.05, 2.0),
    st.sampled_from([math.inf, 1.0, 5.0, 20.0, 100.0]),
    st.booleans(),
    st.floats(0.0, 1.0),
)
@settings(deadline=None)
def test_no_moment_to_brake_needs_more_way_than_is_told(
    top: float, jerk: float, forward: bool, moment: float
):
    """Driven off towards the top speed and braked at any moment, it goes no farther than from the worst one."""
    axis, sign = limits(jerk=jerk), 1.0 if forward else -1.0
    speed, acceleration, gone, step_s = 0.0, 0.0, 0.0, 0.002
    gaining_s = 2 * (top + math.sqrt(top / jerk) + 3.0 / jerk) * moment
    for _ in range(int(gaining_s / step_s)):
        speed, acceleration = advance(axis, speed, acceleration, sign * top, step_s)
    _, needed = braking_distance(axis, top, forward=forward)
    while abs(speed) > 1e-9 or abs(acceleration) > 1e-9:
        before = speed
        speed, acceleration = advance(axis, speed, acceleration, 0.0, step_s)
        gone += abs(before + speed) / 2 * step_s
    assert gone <= needed + 0.002 * top


@pytest.mark.parametrize(
    ("jerk", "start", "way"),
    [
        (math.inf, 1.0, 1.0 / 8),  # 1^2 / (2 x 4)
        (32.0, 0.9375, 0.9375 / 16 + 1 / 384 + 0.5 * 0.375),  # gains 2, for 1/16 s more; then 1/4 + 4/32 s
        (1.0, 0.5, 0.5 + 1 / 3 + 1.0),  # gains 1 at most, for 1 s; then 2 s, at 1 at most
    ],
)
def test_the_way_to_rest_from_the_worst_moment(jerk: float, start: float, way: float) -> None:
    """To a top speed of 1, forward: worked out by hand."""
    assert braking_distance(limits(jerk=jerk), 1.0, forward=True) == pytest.approx((start, way))


@pytest.mark.parametrize(
    ("changes", "start", "target", "after_s", "expected"),
    [
        # 0.2 s to 4 and 0.05625 s there gain 0.625; 0.04375 s down to 3.125 gain 0.15586.
        ({"jerk": 20.0}, (1.0, 0.0), -0.5, 0.3, (0.21914, -3.125)),
        # At 1 after 0.15 s of fall, at zero speed after 0.40625 s; reverse has 1.
        ({"jerk": 20.0}, (1.0, 0.0), -0.5, 0.5, (-0.09375, -1.0)),
        # Peak sqrt(10 0.5 + 2^2 / 2) = 2.6458 after 0.26458 s, zero speed after 0.32915 s at 2, as forward has.
        ({"jerk": 10.0}, (-0.5, 0.0), 1.0, 0.6, (0.54170, 2.0)),
        # Slowing down when it is asked for more: peak sqrt(4 0.6 + 1 / 2) = 1.7029 after 0.67573 s, gained 0.23749.
        ({"jerk": 4.0}, (0.2, -1.0), 0.8, 0.5, (0.2, 1.0)),
        ({"jerk": 4.0}, (0.2, -1.0), 0.8, 1.0, (0.77939, 0.40585)),
        # It gains 2^2 / (2 4) = 0.5 in any case, which is 0.1 too much: straight through zero acceleration.
        ({"jerk": 4.0}, (0.5, 2.0), 0.9, 0.6, (0.98, -0.4)),
    ],
)
def test_s_curves_in_one_step_by_hand(
    changes: dict[str, float],
    start: tuple[float, float],
    target: float,
    after_s: float,
    expected: tuple[float, float],
) -> None:
    """Through zero either way, and from an acceleration that is under way: where the axis is after one long step."""
    assert advance(limits(**changes), *start, target, after_s) == pytest.approx(expected, abs=1e-4)
