"""Measures the passage ahead: how wide it is between what stands on its left and on its right."""

import math
from typing import Final

import numpy as np

from chefbotd.components.navigation.algorithms.arcs import MARGIN_M
from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.surroundings import Surroundings, standing_only
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record

SPARE_M: Final = 0.06
"""The robot passes what is so much wider than its outline."""

NOISE_M: Final = 0.01
"""What is measured narrower by no more than this may be wide enough."""

BEHIND_M, AHEAD_M, BIN_M = -0.1, 0.6, 0.05
"""Where along the robot's heading it is measured, and in what steps."""

BESIDE_M: Final = 0.15
"""What stands farther beside the outline than this is no side of a narrow passage."""

SURFACE_M: Final = 0.03
"""The points of one surface differ by so much at most, by their noise."""


class Passage(Record, frozen=True):
    """How wide the narrowest part ahead is, and where (in the frame of the robot's pose); what the robot needs."""

    width_m: float
    middle: Pose2D
    needed_m: float

    @property
    def is_too_narrow(self) -> bool:
        """Whether the robot does not pass."""
        return self.width_m < self.needed_m - NOISE_M


def measured_passage(outline: Footprint, near: Surroundings) -> Passage | None:
    """The narrowest place ahead that has walls of the map on both sides; None: there is none.

    What is less than half as wide as the robot is a wall ahead. What is not on the map may go away, such as a chair or
    somebody who stands there.
    """
    half_m = float(np.abs(outline.hull[:, 1]).max()) + outline.pad_m
    standing = standing_only(near)
    points = standing.points_m[standing.margin_m <= MARGIN_M]
    x, y = points[:, 0], points[:, 1]
    narrowest: Passage | None = None
    for begin_m in np.arange(BEHIND_M, AHEAD_M, BIN_M):
        within = (x >= begin_m) & (x < begin_m + BIN_M) & (np.abs(y) < half_m + BESIDE_M)
        left_m, right_m = _surface_m(y[within & (y > 0)]), -_surface_m(-y[within & (y < 0)])
        width_m = left_m - right_m
        if half_m < width_m < math.inf and (narrowest is None or width_m < narrowest.width_m):
            middle = Pose2D(float(begin_m) + BIN_M / 2, (left_m + right_m) / 2)
            narrowest = Passage(width_m, middle, 2 * half_m + SPARE_M)
    return narrowest


def _surface_m(away_m: Floats) -> float:
    """How far the nearest surface is, without the noise of its points; infinite: there is none."""
    if not len(away_m):
        return math.inf
    return float(np.median(away_m[away_m <= away_m.min() + SURFACE_M]))
