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


FRONT_AND_REAR = (("front", (0.16, 0.03, 0.2)), ("rear", (-0.17, -0.02, 2.9)))
"""Two lidars, each blind behind itself."""

REAR_LATE_S = 0.0595
"""So long before the front one's turn the rear one's ended: half a step of the tour, as odometry has it."""


def measured_by_two(
    first: int, last: int, seed: int = 1, begin_s: float = 50.0
) -> Iterator[ScanSeen | OdometrySeen]:
    """The tour seen by two lidars that look 110 degrees to either side; the rear one's turns end half a step before."""
    walls, chance = furnished_flat(), np.random.default_rng(seed)
    bearings = np.linspace(-1.92, 1.92, BEAMS // 2)
    driven = odometry(TRUTH, seed)
    for k in range(max(first, 1), last):
        stamp_s = begin_s + PERIOD_S * k
        turns = zip(
            FRONT_AND_REAR,
            (TRUTH[k], (TRUTH[k - 1] + TRUTH[k]) / 2),
            (stamp_s, stamp_s - REAR_LATE_S),
            strict=True,
        )
        front, rear = [
            ScanSeen(at_s, name, mount, floats(bearings), floats(seen), floats(np.zeros(len(bearings))))
            for (name, mount), pose, at_s in turns
            for seen in [_ranges(walls, chance, pose, mount, bearings)]
        ]
        yield rear
        yield OdometrySeen(stamp_s - 0.02, *map(float, driven[k]), 0.1, 0.0)
        yield front
        yield OdometrySeen(stamp_s + 0.001, *map(float, driven[k]), 0.1, 0.0)


def _ranges(
    walls: Floats,
    chance: np.random.Generator,
    pose: Floats,
    mount: tuple[float, float, float],
    bearings: Floats,
) -> Floats:
    x, y, heading = pose
    at_x = x + mount[0] * math.cos(heading) - mount[1] * math.sin(heading)
    at_y = y + mount[0] * math.sin(heading) + mount[1] * math.cos(heading)
    ranges = cast(walls, np.array([at_x, at_y, heading + mount[2]]), np.zeros((0, 3)), bearings)
    return np.where(ranges < 12.0, ranges + chance.normal(0, 0.01, len(bearings)), 0.0)


def measured(
    first: int, last: int, seed: int = 1, begin_s: float = 50.0
) -> Iterator[ScanSeen | OdometrySeen]:
    """Scans ``first`` to ``last`` of the tour, each between odometry of its time, as it comes in life."""
    bearings = -math.pi + math.tau / BEAMS * np.arange(BEAMS)
    walls, chance = furnished_flat(), np.random.default_rng(seed)
    driven = odometry(TRUTH, seed)
    for k in range(first, last):
        ranges = _ranges(walls, chance, TRUTH[k], MOUNT, bearings)
        stamp_s = begin_s + PERIOD_S * k
        yield OdometrySeen(stamp_s - 0.02, *map(float, driven[k]), 0.1, 0.0)
        yield ScanSeen(stamp_s, "top", MOUNT, floats(bearings), floats(ranges), floats(np.zeros(BEAMS)))
        yield OdometrySeen(stamp_s + 0.001, *map(float, driven[k]), 0.1, 0.0)
