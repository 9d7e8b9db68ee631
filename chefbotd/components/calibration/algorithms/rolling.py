"""How far the sides rolled, and when the robot stood, from what the encoders measured."""

from collections.abc import Iterable, Sequence

import numpy as np

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.wheel_model import WheelModel, dead_reckon
from chefbotd.core.events import WheelsMeasured
from chefbotd.core.record import Record
from chefbotd.motion.kinematics import ChassisParameters, Kinematics

STILL_RAD = 2e-3
"""A wheel that turns by no more from one reading to the next stands: two edges of ChefBot's encoders."""

REST_S, CALM_S = 0.25, 0.05
"""A shorter stand is none; and what the robot may still sway after the last edge."""


class Rolling(Record, frozen=True):
    """How far the left and the right side have rolled (n,) at ``stamp_s`` (n,), with the configured radii."""

    stamp_s: Floats
    left_m: Floats
    right_m: Floats

    def at(self, stamp_s: Floats) -> "Rolling":
        """The same with rows at these times too."""
        times = np.union1d(self.stamp_s, np.clip(stamp_s, self.stamp_s[0], self.stamp_s[-1]))
        return Rolling(
            times, np.interp(times, self.stamp_s, self.left_m), np.interp(times, self.stamp_s, self.right_m)
        )

    def row(self, stamp_s: float) -> int:
        """The last row that is no later."""
        return max(int(np.searchsorted(self.stamp_s, stamp_s, side="right")) - 1, 0)

    def poses(self, model: WheelModel, track_m: float) -> Floats:
        """Poses (n, 3) from (0, 0, 0) on."""
        return dead_reckon(model, track_m, np.diff(self.left_m), np.diff(self.right_m))

    def totals(self, track_m: float) -> Floats:
        """Travel in m and turn in rad, both without their signs, from the first row to each (n, 2)."""
        left, right = np.diff(self.left_m), np.diff(self.right_m)
        steps = np.stack([np.abs(left + right) / 2, np.abs(right - left) / track_m], axis=1)
        return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def rolling(chassis: ChassisParameters, wheels: Sequence[WheelsMeasured]) -> Rolling | None:
    """What the encoders measured; None where there are no two readings one after the other."""
    ordered = _rising(wheels)
    if len(ordered) < 2:
        return None
    kinematics = Kinematics(chassis)
    rolled_m = np.cumsum([reading.travel_rad for reading in ordered], axis=0) * np.array(kinematics.radii_m)
    sides = (rolled_m[:, list(side)].mean(axis=1) for side in (kinematics.left, kinematics.right))
    return Rolling(np.array([reading.stamp_s for reading in ordered]), *sides)


def _rising(wheels: Iterable[WheelsMeasured]) -> list[WheelsMeasured]:
    """The readings in the order of their times; one that is no later than the one before is left out."""
    ordered: list[WheelsMeasured] = []
    for reading in wheels:
        if not ordered or reading.stamp_s > ordered[-1].stamp_s:
            ordered.append(reading)
    return ordered


def rests(rolled: Rolling, radius_m: float) -> list[tuple[float, float]]:
    """From when to when the robot stood."""
    moves = np.maximum(np.abs(np.diff(rolled.left_m)), np.abs(np.diff(rolled.right_m))) > STILL_RAD * radius_m
    limits = np.flatnonzero(np.diff(np.concatenate([[True], moves, [True]]).astype(int)))
    spans = zip(rolled.stamp_s[limits[::2]] + CALM_S, rolled.stamp_s[limits[1::2]], strict=True)
    return [(begin, end) for begin, end in spans if end - begin >= REST_S]
