"""Dead reckoning in the plain way: an arc, composed with the pose, and the response of its end to each error."""

import math
from collections.abc import Iterable
from typing import TypeAlias

from chefbotd.core.geometry import Pose2D, PoseCovariance, Twist2D
from chefbotd.motion.odometry import OdometryParameters, OdometryState

Response: TypeAlias = tuple[float, float, float]
"""How far x (m), y (m) and the heading (rad) move per unit of an error."""


def integrate(
    params: OdometryParameters,
    track_width_m: float,
    state: OdometryState,
    left_m: float,
    right_m: float,
    twist: Twist2D,
) -> OdometryState:
    """The state after the sides have rolled this far along an arc; ``twist`` is the present motion."""
    if left_m == 0 == right_m:
        return OdometryState(state.odom_from_base, twist, state.covariance)
    turned_rad = (right_m - left_m) / track_width_m
    travel_m = (left_m + right_m) / 2
    ratio = _sinc(turned_rad / 2)
    pose = state.odom_from_base.compose(_arc(travel_m, turned_rad, ratio))
    moved_x_m, moved_y_m = pose.x_m - state.odom_from_base.x_m, pose.y_m - state.odom_from_base.y_m
    errors = zip(
        _responses(travel_m, turned_rad, ratio, state.odom_from_base.heading_rad, track_width_m),
        (
            params.travel_variance_m2_per_m * abs(left_m),
            params.travel_variance_m2_per_m * abs(right_m),
            params.turn_variance_rad2_per_rad * abs(turned_rad),
        ),
        strict=True,
    )
    return OdometryState(pose, twist, _carry(state.covariance, moved_x_m, moved_y_m, errors))


def _arc(travel_m: float, turned_rad: float, ratio: float) -> Pose2D:
    """The pose at an arc's end, in the frame of its start: the chord lies half of the turn off the heading.

    ``ratio`` is that of the chord to the arc.
    """
    half_rad = turned_rad / 2
    chord_m = travel_m * ratio
    return Pose2D(chord_m * math.cos(half_rad), chord_m * math.sin(half_rad), turned_rad)


def _carry(
    before: PoseCovariance, moved_x_m: float, moved_y_m: float, errors: Iterable[tuple[Response, float]]
) -> PoseCovariance:
    """The covariance at the start as it stands at the end: an error of heading swings the way between.

    ``F P F^T`` with the motion's Jacobian F = [[1, 0, -moved_y], [0, 1, moved_x], [0, 0, 1]], and ``v r r^T`` more for
    each independent error of variance v, which moves the pose by the response r per unit.
    """
    xx, xy, xh, yy, yh, hh = before.xx, before.xy, before.xh, before.yy, before.yh, before.hh
    swung_xh, swung_yh = xh - moved_y_m * hh, yh + moved_x_m * hh
    xx, xy = xx - moved_y_m * (xh + swung_xh), xy - moved_y_m * yh + moved_x_m * swung_xh
    yy, xh, yh = yy + moved_x_m * (yh + swung_yh), swung_xh, swung_yh
    for (x, y, heading), variance in errors:
        of_x, of_y, of_heading = variance * x, variance * y, variance * heading
        xx += of_x * x
        xy += of_x * y
        xh += of_x * heading
        yy += of_y * y
        yh += of_y * heading
        hh += of_heading * heading
    return PoseCovariance(xx, xy, xh, yy, yh, hh)


def _responses(
    travel_m: float, turned_rad: float, ratio: float, heading_rad: float, track_width_m: float
) -> tuple[Response, Response, Response]:
    """How the end (x, y, heading) answers to a little more left travel, right travel, and turn by scrubbing."""
    half_rad = turned_rad / 2
    cos, sin = math.cos(heading_rad + half_rad), math.sin(heading_rad + half_rad)
    bend_m = travel_m * _sinc_slope(half_rad) / 2
    swing_m = travel_m * ratio / 2
    forward_x, forward_y = ratio * cos / 2, ratio * sin / 2
    turn_x, turn_y = bend_m * cos - swing_m * sin, bend_m * sin + swing_m * cos
    per_m = 1 / track_width_m
    return (
        (forward_x - turn_x * per_m, forward_y - turn_y * per_m, -per_m),
        (forward_x + turn_x * per_m, forward_y + turn_y * per_m, per_m),
        (turn_x, turn_y, 1.0),
    )


def _sinc(angle_rad: float) -> float:
    """``sin(x) / x``, chord to arc: accurate everywhere but at zero, where its limit is 1."""
    return math.sin(angle_rad) / angle_rad if angle_rad else 1.0


def _sinc_slope(angle_rad: float) -> float:
    """The derivative of ``sin(x) / x``; near zero by its series, where the closed form cancels."""
    if abs(angle_rad) < 1e-3:
        return -angle_rad / 3
    return (math.cos(angle_rad) - _sinc(angle_rad)) / angle_rad
