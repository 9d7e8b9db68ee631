"""Finds lone points of a lidar: readings that neither a beam beside them nor an earlier turn confirms.

Sunlight, dust and worn lidars make points where nothing is, each alone in its direction and in its turn. What is
really there is hit by several beams side by side, or again in the next turn. A leg of 2 cm gets two beams or more of
an LD19 (450 beams a turn) up to 0.7 m away, and farther off one beam in most turns.

How to use it, in a guard or for obstacles on a map::

    points, sensor = joined_points(band_m, turns, track)          # beam by beam, in any frame
    lone = find_lone(points, sensor, earlier=(previous_turn, the_one_before))  # in the same frame, unfiltered
    believed = points[~lone]

Keep the unfiltered points of the last turns for the next call: a point that was lone in its own turn confirms the same
place in the next one. Who needs no memory leaves ``earlier`` away; then only a beam beside it confirms a point. ROS's
``laser_filters`` (speckle filter) and LDROBOT's driver (fewer than three points in a group) test for neighbours too.
"""

import math
from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.scan import Floats

Flags: TypeAlias = NDArray[np.bool_]

ALIKE_M: Final = 0.04
"""Two readings of one thing differ by so much at most: an LD19's noise is 1 cm (one sigma), a leg is round."""

OBLIQUE: Final = 5.0
"""A wall that is seen at 11 degrees has its points five times as far apart as one that is seen straight on."""

BEAMS_BESIDE: Final = 2
"""One beam between two that see a thing may be lost, or be noise itself."""

WIDEST_GAP_RAD: Final = 0.07
"""What lies farther apart confirms nothing: four degrees, three beams of an RPLIDAR A1."""

SAME_PLACE_M: Final = 0.05
"""A point of an earlier turn so near is the same thing: noise, the error of odometry, and the beams' distance."""

SAME_PLACE_AT_SENSOR_M, SAME_PLACE_PER_M = 0.02, 0.025
"""Closer to the sensor it must be nearer: many beams are within 5 cm there, and a thing is hit by several of them."""


def find_lone(
    points_m: Floats, sensor_m: Floats, *, earlier: Sequence[Floats] = (), alike_m: float = ALIKE_M
) -> Flags:
    """Which points are confirmed neither by a beam beside them nor by an earlier turn.

    Args:
        points_m: (n, 2), in the order of the beams.
        sensor_m: where they were seen from: one place (2,), or one for each point (n, 2).
        earlier: the points of earlier turns in the same frame, lone ones included; none: no turn confirms anything.
        alike_m: how far apart two neighbouring readings of one thing may be, in addition to what an oblique wall needs.
    """
    lone = ~has_neighbour(points_m, sensor_m, alike_m=alike_m)
    seen = points_m - sensor_m
    range_m = np.hypot(seen[:, 0], seen[:, 1])
    within_m = np.minimum(SAME_PLACE_AT_SENSOR_M + SAME_PLACE_PER_M * range_m, SAME_PLACE_M)
    for turn in earlier:
        candidates = np.flatnonzero(lone)
        if not len(candidates):
            break
        lone[candidates] = ~_is_near(points_m[candidates], turn, within_m[candidates])
    return lone


def has_neighbour(points_m: Floats, sensor_m: Floats, *, alike_m: float = ALIKE_M) -> Flags:
    """Which points have another one beside them, among the next two beams on either side, that may be the same thing."""
    count = len(points_m)
    confirmed = np.zeros(count, np.bool_)
    seen = points_m - sensor_m
    range_m, bearing_rad = np.hypot(seen[:, 0], seen[:, 1]), np.arctan2(seen[:, 1], seen[:, 0])
    for step in range(1, min(BEAMS_BESIDE, count - 1) + 1):
        other = np.roll(np.arange(count), -step)
        gap_rad = np.abs((bearing_rad[other] - bearing_rad + math.pi) % math.tau - math.pi)
        across_m = gap_rad * np.minimum(range_m, range_m[other])
        alike = np.abs(range_m[other] - range_m) <= alike_m + OBLIQUE * across_m
        alike &= gap_rad <= WIDEST_GAP_RAD
        confirmed |= alike
        confirmed[other] |= alike
    return confirmed


def _is_near(points_m: Floats, others_m: Floats, within_m: Floats) -> Flags:
    """Which points have another one so near."""
    if not len(others_m):
        return np.zeros(len(points_m), np.bool_)
    square_m2 = (points_m[:, None, 0] - others_m[None, :, 0]) ** 2
    square_m2 += (points_m[:, None, 1] - others_m[None, :, 1]) ** 2
    near: Flags = square_m2.min(axis=1) <= within_m * within_m
    return near
