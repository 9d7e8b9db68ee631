"""Smooths the points of a lidar along the surfaces that they belong to: a wall is a line, and not a band of noise.

A range has a noise of about a centimetre (one sigma: LD19, data sheet). Of a hundred points on a wall a few are 2.5 cm
before it, so whoever keeps 2 cm from every point never passes where there are 3 cm. Beside the robot the beams lie so
dense that a dozen of them hit the same few centimetres of a wall: their mean is three times as exact as one of them.

A point is moved to the mean of itself and its neighbours on the same surface, and no farther than ``MOST_M``. What
stands alone, such as a leg, has no neighbours but its own, and stays. A right-angled corner is rounded by up to 13 mm.
"""

from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.scan import Floats

Flags: TypeAlias = NDArray[np.bool_]

BEAMS: Final = 6
"""Neighbours are among so many beams on either side,"""

ACROSS_M: Final = 0.02
"""so near across the beam,"""

ALONG_M: Final = 0.03
"""and so near along it: three times the noise."""

MOST_M: Final = 0.015
"""No point is moved farther than this."""


def smooth_points(points_m: Floats, sensor_m: Floats) -> Floats:
    """The points, each moved to the mean of its surface about it.

    Args:
        points_m: (n, 2), in the order of the beams.
        sensor_m: where they were seen from: one place (2,), or one for each point (n, 2), in the same frame.
    """
    count = len(points_m)
    if count < 2:
        return points_m
    seen = points_m - sensor_m
    beam = seen / np.maximum(np.hypot(seen[:, 0], seen[:, 1]), 1e-9)[:, None]
    total, members = np.zeros_like(points_m), np.ones(count)
    for step in range(1, min(BEAMS, (count - 1) // 2) + 1):
        for shift in (step, -step):
            apart = np.roll(points_m, shift, axis=0) - points_m
            along_m = apart[:, 0] * beam[:, 0] + apart[:, 1] * beam[:, 1]
            across_m = apart[:, 0] * beam[:, 1] - apart[:, 1] * beam[:, 0]
            is_same = (np.abs(along_m) <= ALONG_M) & (np.abs(across_m) <= ACROSS_M)
            total += apart * is_same[:, None]
            members += is_same
    move = total / members[:, None]
    length_m = np.hypot(move[:, 0], move[:, 1])
    move *= np.minimum(1.0, MOST_M / np.maximum(length_m, 1e-9))[:, None]
    result: Floats = points_m + move
    return result
