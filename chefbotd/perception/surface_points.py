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
    if count < 3:
        return points_m
    seen = points_m - sensor_m
    beam = seen / np.maximum(np.hypot(seen[:, 0], seen[:, 1]), 1e-9)[:, None]
    most = min(BEAMS, (count - 1) // 2)
    around_x, around_y = np.concatenate(
        (points_m[-most:], points_m, points_m[:most])
    ).T.copy()  # a turn has no ends
    (x, y), (beam_x, beam_y) = points_m.T.copy(), beam.T.copy()
    total_x, total_y, members = np.zeros(count), np.zeros(count), np.ones(count)
    for step in range(1, most + 1):
        for begin in (most - step, most + step):
            beside = slice(begin, begin + count)
            apart_x, apart_y = around_x[beside] - x, around_y[beside] - y
            along_m = apart_x * beam_x + apart_y * beam_y
            across_m = apart_x * beam_y - apart_y * beam_x
            is_same = (np.abs(along_m) <= ALONG_M) & (np.abs(across_m) <= ACROSS_M)
            total_x += apart_x * is_same
            total_y += apart_y * is_same
            members += is_same
    move = np.stack((total_x, total_y), axis=1) / members[:, None]
    length_m = np.hypot(move[:, 0], move[:, 1])
    move *= np.minimum(1.0, MOST_M / np.maximum(length_m, 1e-9))[:, None]
    result: Floats = points_m + move
    return result
