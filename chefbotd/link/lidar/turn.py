"""A lidar's turn, and the scan that is made of it."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from chefbotd.core.scan import Floats, LaserScan
from chefbotd.sensing.lidar import LidarParameters

REMEMBERED_TURNS = 600
"""A minute of them: a line that replays less than that is found out."""

LEAST_READINGS = 30
"""Two turns with fewer readings may be alike by chance: in an empty hall both have none."""

LEAST_COVERED = 0.75
"""A turn of which more is missing is no turn."""


@dataclass(frozen=True, slots=True)
class Turn:
    """What a lidar measured in one turn, in that order: angles as it counts them, clockwise from its zero mark.

    ``clockwise_rad`` rises, ``range_m`` is 0 where there was no reading, ``stamp_s`` is each beam's host time.
    """

    clockwise_rad: Floats
    range_m: Floats
    stamp_s: Floats


def scan_of(lidar: LidarParameters, turn: Turn) -> LaserScan:
    """The turn as a scan: counter-clockwise, and without what the lidar is not to look at.

    Seen from above, a lidar that is mounted upside down turns the other way round.
    """
    bearing_rad = turn.clockwise_rad if lidar.upside_down else -turn.clockwise_rad
    nearest_m, farthest_m = lidar.band_m
    good = (turn.range_m >= nearest_m) & (turn.range_m <= farthest_m)
    for begin, end in lidar.blind_sectors_rad:
        good &= (bearing_rad - begin) % math.tau > (end - begin) % math.tau
    stamp_s = float(turn.stamp_s[-1])
    return LaserScan(stamp_s, bearing_rad, np.where(good, turn.range_m, 0.0), turn.stamp_s - stamp_s)


class RepeatFinder:
    """Finds turns that were seen before, bit for bit: noise alone makes each turn of a lidar different."""

    def __init__(self) -> None:
        self._order: deque[int] = deque()
        self._seen: set[int] = set()

    def is_repeated(self, turn: Turn) -> bool:
        """Whether this turn is one of the last ``REMEMBERED_TURNS``; it is remembered as well."""
        if np.count_nonzero(turn.range_m) < LEAST_READINGS:
            return False
        key = hash(turn.range_m.tobytes() + turn.clockwise_rad.tobytes())
        if key in self._seen:
            return True
        self._seen.add(key)
        self._order.append(key)
        if len(self._order) > REMEMBERED_TURNS:
            self._seen.discard(self._order.popleft())
        return False
