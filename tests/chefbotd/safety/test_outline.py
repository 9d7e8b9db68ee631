"""When a point touches the robot's outline: held against the motion itself, in small steps."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from chefbotd.core.geometry import Twist2D
from chefbotd.safety.outline import Box, Disc, Outline

OUTLINES = (Disc(0.18), Box(0.3, 0.15), Box(0.1, 0.25))


def touched_s(outline: Outline, x: float, y: float, twist: Twist2D, dt_s: float = 0.002) -> float:
    """The time after which the point is inside, by moving it step by step for half a turn, or 6 s; else infinity."""
    turning = abs(twist.angular_rad_s)
    times = np.arange(0, min(6.0, math.pi / turning) if turning else 6.0, dt_s)
    if turning:
        heading = twist.angular_rad_s * times
        radius = twist.linear_m_s / twist.angular_rad_s
        moved_x, moved_y = radius * np.sin(heading), radius * (1 - np.cos(heading))
    else:
        heading, moved_x, moved_y = np.zeros_like(times), twist.linear_m_s * times, np.zeros_like(times)
    dx, dy = x - moved_x, y - moved_y
    seen_x = np.cos(heading) * dx + np.sin(heading) * dy
    seen_y = np.cos(heading) * dy - np.sin(heading) * dx
    inside = np.flatnonzero(outline.distances(seen_x, seen_y) < 0)
    return float(times[inside[0]]) if len(inside) else math.inf


def predicted_s(outline: Outline, x: float, y: float, twist: Twist2D) -> float:
    """The same by the outline's own geometry."""
    one_x, one_y = np.array([x]), np.array([y])
    if twist.angular_rad_s == 0:
        way = outline.straight_ways(one_x, one_y, forward=twist.linear_m_s > 0)
        return float(way[0]) / abs(twist.linear_m_s)
    centre = twist.linear_m_s / twist.angular_rad_s
    angle = outline.arc_angles(one_x, one_y, centre, left=twist.angular_rad_s > 0)
    return float(angle[0]) / abs(twist.angular_rad_s)


@pytest.mark.parametrize("outline", OUTLINES, ids=str)
@given(
    x=st.floats(-1, 1),
    y=st.floats(-1, 1),
    linear=st.sampled_from([-0.4, -0.07, 0.0, 0.11, 0.5]),
    angular=st.sampled_from([-2.0, -0.3, 0.0, 0.05, 0.9]),
)
def test_touching_is_foretold_as_it_happens(
    outline: Outline, x: float, y: float, linear: float, angular: float
) -> None:
    """To 10 ms, or 4 mm of way, where a point grazes a corner; forwards, backwards, on arcs and on the spot."""
    assume(linear or angular)
    twist = Twist2D(linear, angular)
    assume(float(outline.distances(np.array([x]), np.array([y]))[0]) > 1e-6)
    smaller, larger = (touched_s(outline.grown(by_m), x, y, twist) for by_m in (-0.002, 0.002))
    told = predicted_s(outline, x, y, twist)
    if larger == math.inf:
        horizon = math.pi / abs(angular) if angular else 6.0
        assert told >= min(horizon, 6.0) - 0.01
    else:
        assert larger - 0.01 <= told <= smaller + 0.01


def test_a_point_straight_ahead_by_hand() -> None:
    """1 m ahead of a disc of 0.18: after 0.82 m; at 0.1 beside, sqrt(0.18^2 - 0.1^2) = 0.1497, so after 0.8503 m."""
    ways = Disc(0.18).straight_ways(np.array([1.0, 1.0, 1.0]), np.array([0.0, 0.1, 0.19]), forward=True)
    assert ways == pytest.approx([0.82, 0.8503, math.inf], abs=1e-4)
    assert Box(0.3, 0.15).straight_ways(np.array([-1.0]), np.array([0.1]), forward=False) == pytest.approx(
        [0.7]
    )


def test_turning_in_place_by_hand() -> None:
    """A box of 0.3 by 0.15 half: its corner is 0.3354 m from the middle, so (0.2, 0.27), 0.336 m away, is never met.

    A point 0.33 m away in that direction (53.47 degrees) is met by the left side, at asin(0.15 / 0.33) = 27.04 degrees:
    after turning left by 26.43.
    """
    x, y = 0.2 * np.array([1.0, 0.33 / 0.336]), 0.27 * np.array([1.0, 0.33 / 0.336])
    told = Box(0.3, 0.15).arc_angles(x, y, 0.0, left=True)
    assert told[0] == math.inf
    assert math.degrees(told[1]) == pytest.approx(26.43, abs=0.02)


def test_a_disc_turns_in_place_anywhere() -> None:
    """However near something is."""
    assert Disc(0.18).arc_angles(np.array([0.181]), np.array([0.0]), 0.0, left=True)[0] == math.inf


@pytest.mark.parametrize("outline", OUTLINES, ids=str)
@given(x=st.floats(-0.6, 0.6), y=st.floats(-0.6, 0.6), linear=st.floats(-1, 1), angular=st.floats(-2, 2))
def test_closing_is_how_fast_the_distance_falls(
    outline: Outline, x: float, y: float, linear: float, angular: float
) -> None:
    """The difference of two distances, a tenth of a millisecond apart; not where two sides are equally far."""
    box = isinstance(outline, Box)
    assume(not box or abs((abs(x) - outline.half_length_m) - (abs(y) - outline.half_width_m)) > 1e-3)
    assume(math.hypot(x, y) > 0.01 and (not box or min(abs(x), abs(y)) > 1e-3))
    step_s = 1e-4
    later_x, later_y = x - (linear - angular * y) * step_s, y - angular * x * step_s
    before, after = outline.distances(np.array([x, later_x]), np.array([y, later_y]))
    closing = outline.closing_speed_m_s(np.array([x]), np.array([y]), Twist2D(linear, angular))
    assert closing[0] == pytest.approx((before - after) / step_s, abs=0.02)
