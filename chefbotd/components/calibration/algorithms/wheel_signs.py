"""A first look at the wheels and the lidar's direction, in closed form, that needs no start near the truth.

The two linear steps of Censi, Franchi, Marchionni and Oriolo (2013): the turns tell each radius over the track, with
its sign; then the travel tells how the lidar looks.
"""

import math

import numpy as np

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.wheel_fit import RecordedDrive
from chefbotd.components.calibration.algorithms.wheel_model import NOMINAL, dead_reckon
from chefbotd.core.poses import between, wrap
from chefbotd.core.record import Record

LEAST_TURN_RAD = 0.3
FAR_OFF = 0.4
"""A wheel whose share of the turns is so far from what is configured is not merely worn."""


class Signs(Record, frozen=True):
    """What a wheel does for a turn, 1 where it is as configured, and the direction of the lidar (None: unknown)."""

    left: float
    right: float
    yaw_rad: float | None


def signs(track_m: float, drive: RecordedDrive) -> Signs | None:
    """What the motions say; None where the robot did not turn enough to say it.

    Each motion should be of less than half a turn: a lidar cannot tell a turn from a turn and a half.
    """
    rolled = [_sums(one)[drive.last] - _sums(one)[drive.first] for one in (drive.left_m, drive.right_m)]
    by_sides = np.stack([-rolled[0], rolled[1]], axis=1) / track_m
    is_short = np.abs(by_sides.sum(axis=1)) < 0.8 * math.pi
    sides, turned = by_sides[is_short], drive.motion[is_short, 2]
    if len(turned) < 2 or np.abs(turned).max() < LEAST_TURN_RAD:
        return None
    left, right = np.linalg.lstsq(sides, turned, rcond=None)[0].tolist()
    return Signs(left, right, _yaw(track_m, drive))


def _sums(steps: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(steps)])


def _yaw(track_m: float, drive: RecordedDrive) -> float | None:
    """The direction of travel as the lidar sees it, turned round: where motions are nearly straight."""
    poses = dead_reckon(NOMINAL, track_m, drive.left_m, drive.right_m)
    rolled = between(poses[drive.first], poses[drive.last])
    is_straight = (np.abs(wrap(rolled[:, 2])) < 0.1) & (np.hypot(rolled[:, 0], rolled[:, 1]) > 0.1)
    if not is_straight.any():
        return None
    ahead, seen = rolled[is_straight, 0], drive.motion[is_straight]
    return math.atan2(-float(ahead @ seen[:, 1]), float(ahead @ seen[:, 0]))


def wrong_sides(shown: Signs, configured_yaw_rad: float) -> str:
    """What is wired wrongly, or measured very wrongly (empty: nothing)."""
    yaw_off = (
        0.0 if shown.yaw_rad is None else abs(math.remainder(shown.yaw_rad - configured_yaw_rad, math.tau))
    )
    if shown.left < 0 and shown.right < 0:
        if yaw_off > math.pi / 2:
            return "both encoders count backwards (or the lidar looks backwards and the encoders are swapped)"
        return "the left and the right encoder are swapped"
    for side, value in (("left", shown.left), ("right", shown.right)):
        if value < 0:
            return f"the {side} encoder counts backwards: turn its sign round"
        if abs(value - 1) > FAR_OFF:
            return (
                f"the {side} wheel turns the robot {value:.2f} times as much as its radius and the track say; "
                "check the counts of a wheel turn, its radius and the track width"
            )
    return ""
