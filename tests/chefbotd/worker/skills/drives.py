"""A drive through the simulated flat, as the worker gets it: scans and odometry with their times."""

import math
from collections.abc import Iterator

import numpy as np

from chefbotd.worker.messages import OdometrySeen, ScanSeen
from tests.chefbotd.mapping.slam.flat import TOUR, Floats, cast, furnished_flat, odometry, poses_along

BEAMS, PERIOD_S = 240, 0.1
MOUNT = (0.07, -0.02, 0.4)
"""Beside the robot's middle, and turned."""

TRUTH = poses_along(TOUR)


def floats(values: Floats) -> bytes:
    """As they go over the wire."""
    return values.astype("<f4").tobytes()


def measured(
    first: int, last: int, seed: int = 1, begin_s: float = 50.0
) -> Iterator[ScanSeen | OdometrySeen]:
    """Scans ``first`` to ``last`` of the tour, each between odometry of its time, as it comes in life."""
    bearings = -math.pi + math.tau / BEAMS * np.arange(BEAMS)
    walls, chance = furnished_flat(), np.random.default_rng(seed)
    driven = odometry(TRUTH, seed)
    for k in range(first, last):
        x, y, heading = TRUTH[k]
        at_x = x + MOUNT[0] * math.cos(heading) - MOUNT[1] * math.sin(heading)
        at_y = y + MOUNT[0] * math.sin(heading) + MOUNT[1] * math.cos(heading)
        ranges = cast(walls, np.array([at_x, at_y, heading + MOUNT[2]]), np.zeros((0, 3)), bearings)
        ranges = np.where(ranges < 12.0, ranges + chance.normal(0, 0.01, BEAMS), 0.0)
        stamp_s = begin_s + PERIOD_S * k
        yield OdometrySeen(stamp_s - 0.02, *map(float, driven[k]), 0.1, 0.0)
        yield ScanSeen(stamp_s, "top", MOUNT, floats(bearings), floats(ranges), floats(np.zeros(BEAMS)))
        yield OdometrySeen(stamp_s + 0.001, *map(float, driven[k]), 0.1, 0.0)
