"""Dead reckoning: where the robot is in ``odom`` by how far its sides rolled, and how sure that is.

The pose follows the exact arc. The covariance grows with motion only: each side's travel is uncertain by a
variance proportional to its length (Chong and Kleeman, "Accurate Odometry and Error Modelling for a Mobile
Robot", ICRA 1997), and turning scrubs the tyres, which adds a variance proportional to the angle (the
rotational noise of Thrun, Burgard and Fox, "Probabilistic Robotics", 5.4).
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydantic import Field

from chefbotd.core.geometry import ORIGIN, STANDING, Pose2D, Twist2D
from chefbotd.core.parameters import Parameters

Matrix = npt.NDArray[np.float64]


class OdometryParameters(Parameters):
    """How fast certainty is lost.

    The defaults are one sigma of a centimetre per side after a metre, and of a degree after a turned radian.
    """

    travel_variance_m2_per_m: float = Field(default=1e-4, ge=0, le=1)
    turn_variance_rad2_per_rad: float = Field(default=3e-4, ge=0, le=1)


@dataclass(frozen=True, slots=True, eq=False)
class OdometryState:
    """The pose, the twist in the base frame, and the read-only covariance of (x, y, heading) in ``odom``."""

    odom_from_base: Pose2D
    twist: Twist2D
    covariance: Matrix


def _frozen(matrix: Matrix) -> Matrix:
    matrix.setflags(write=False)
    return matrix


CERTAIN: Matrix = _frozen(np.zeros((3, 3)))
START = OdometryState(ORIGIN, STANDING, CERTAIN)


def set_pose(state: OdometryState, pose: Pose2D) -> OdometryState:
    """Say where the robot is: the pose becomes certain, the twist goes on."""
    return OdometryState(pose, state.twist, CERTAIN)


def integrate(
    params: OdometryParameters,
    track_width_m: float,
    state: OdometryState,
    left_m: float,
    right_m: float,
    twist: Twist2D,
) -> OdometryState:
    """Roll the sides on by so much along the arc that they make; ``twist`` is how the robot moves now."""
    if left_m == 0 == right_m:
        return OdometryState(state.odom_from_base, twist, state.covariance)
    turned_rad = (right_m - left_m) / track_width_m
    travel_m = (left_m + right_m) / 2
    pose = state.odom_from_base.compose(_arc(travel_m, turned_rad))
    noise = _noise(params, left_m, right_m, turned_rad)
    inputs = _input_jacobian(travel_m, turned_rad, state.odom_from_base.heading_rad, track_width_m)
    covariance = _carry(state.covariance, state.odom_from_base, pose) + (inputs * noise) @ inputs.T
    return OdometryState(pose, twist, _frozen((covariance + covariance.T) / 2))


def _arc(travel_m: float, turned_rad: float) -> Pose2D:
    """The pose at an arc's end, seen from its start: the chord lies half of the turn off the heading."""
    half_rad = turned_rad / 2
    chord_m = travel_m * _sinc(half_rad)
    return Pose2D(chord_m * math.cos(half_rad), chord_m * math.sin(half_rad), turned_rad)


def _carry(covariance: Matrix, start: Pose2D, end: Pose2D) -> Matrix:
    """The covariance at the start as it stands at the end: an error of heading swings the way between."""
    jacobian = np.eye(3)
    jacobian[0, 2] = start.y_m - end.y_m
    jacobian[1, 2] = end.x_m - start.x_m
    carried: Matrix = jacobian @ covariance @ jacobian.T
    return carried


def _noise(params: OdometryParameters, left_m: float, right_m: float, turned_rad: float) -> Matrix:
    """Variances of the left travel, the right travel and the scrubbing."""
    per_m = params.travel_variance_m2_per_m
    scrub_rad2 = params.turn_variance_rad2_per_rad * abs(turned_rad)
    return np.array((per_m * abs(left_m), per_m * abs(right_m), scrub_rad2))


def _input_jacobian(travel_m: float, turned_rad: float, heading_rad: float, track_width_m: float) -> Matrix:
    """How the end (rows x, y, heading) answers to left travel, right travel and an extra turn (columns)."""
    half_rad = turned_rad / 2
    cos, sin = math.cos(heading_rad + half_rad), math.sin(heading_rad + half_rad)
    ratio, bend_m = _sinc(half_rad), travel_m * _sinc_slope(half_rad) / 2
    swing_m = travel_m * ratio / 2
    forward_x, forward_y = ratio * cos, ratio * sin
    turn_x, turn_y = bend_m * cos - swing_m * sin, bend_m * sin + swing_m * cos
    return np.array(
        (
            (forward_x / 2 - turn_x / track_width_m, forward_x / 2 + turn_x / track_width_m, turn_x),
            (forward_y / 2 - turn_y / track_width_m, forward_y / 2 + turn_y / track_width_m, turn_y),
            (-1 / track_width_m, 1 / track_width_m, 1.0),
        )
    )


def _sinc(angle_rad: float) -> float:
    """``sin(x) / x``, chord to arc: accurate everywhere but at zero, where its limit is 1."""
    return math.sin(angle_rad) / angle_rad if angle_rad else 1.0


def _sinc_slope(angle_rad: float) -> float:
    """The derivative of ``sin(x) / x``; near zero by its series, where the closed form cancels."""
    if abs(angle_rad) < 1e-3:
        return -angle_rad / 3
    return (math.cos(angle_rad) - _sinc(angle_rad)) / angle_rad
