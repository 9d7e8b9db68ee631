"""A lidar's turn, and the scan that is made of it."""

import math
from hashlib import blake2b

import numpy as np
from msgspec import field
from numpy.typing import NDArray

from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import MutableState, Record
from chefbotd.core.scan import Floats, LaserScan
from chefbotd.perception.lone_points import Flags, has_neighbour
from chefbotd.sensing.lidar import LidarParameters

REMEMBERED_TURNS = 600
"""A minute of them: a line that replays less than that is found out."""

LEAST_READINGS = 30
"""Two turns with fewer readings may be alike by chance: in an empty hall both have none."""

MOVED_M = 0.03
REACH_M = 0.3
LONGEST_STEP_S = 0.2

LEAST_COVERED = 0.75
"""A turn with less coverage is dropped."""


class LidarTurn(Record, frozen=True):
    """What a lidar measured in one turn, in that order: angles as it counts them, clockwise from its zero mark.

    ``clockwise_rad`` rises, ``range_m`` is 0 where there was no reading, ``stamp_s`` is each beam's host time, and
    ``strength`` how strong its echo was, by the lidar's own scale (None: it does not tell).
    """

    clockwise_rad: Floats
    range_m: Floats
    stamp_s: Floats
    strength: Floats | None = None


def scan_of(lidar: LidarParameters, turn: LidarTurn) -> LaserScan:
    """The turn as a scan: counter-clockwise, and without what the lidar is not to look at.

    Seen from above, a lidar that is mounted upside down turns the other way round.
    """
    bearing_rad = turn.clockwise_rad if lidar.upside_down else -turn.clockwise_rad
    nearest_m, farthest_m = lidar.band_m
    good = (turn.range_m >= nearest_m) & (turn.range_m <= farthest_m)
    for begin, end in lidar.blind_sectors_rad:
        good &= (bearing_rad - begin) % math.tau > (end - begin) % math.tau
    if turn.strength is not None and lidar.weakest:
        good[_weak_and_lone(bearing_rad, turn.range_m, good, turn.strength < lidar.weakest)] = False
    stamp_s = float(turn.stamp_s[-1])
    return LaserScan(stamp_s, bearing_rad, np.where(good, turn.range_m, 0.0), turn.stamp_s - stamp_s)


MOST_WEAK = 0.5
"""Where more of the readings are weak, the lidar's scale is another one, or everything around is black."""


def _weak_and_lone(bearing_rad: Floats, range_m: Floats, good: Flags, weak: Flags) -> NDArray[np.int64]:
    """The indices of the good readings that are weak and have no neighbour: sunlight, dust."""
    seen = np.flatnonzero(good)
    is_weak = weak[seen]
    if not is_weak.any() or is_weak.mean() > MOST_WEAK:
        return np.zeros(0, np.int64)
    bearings, ranges = bearing_rad[seen], range_m[seen]
    points = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings)], axis=1)
    lone: NDArray[np.int64] = seen[is_weak & ~has_neighbour(points, np.zeros(2))]
    return lone


class RepeatFinder(MutableState):
    """Finds turns that were measured before the robot moved: bit for bit the same though it now stands elsewhere.

    Noise makes each turn of a real lidar different, but a simulated one without noise repeats itself while the robot
    stands. So a repetition is one only after ``MOVED_M`` of travel.
    """

    _travelled_m: dict[bytes, float] = field(default_factory=dict)
    """When each was first heard, by its digest: the same in every process, so that a replay finds it."""

    def is_repeated(self, turn: LidarTurn, travelled_m: float) -> bool:
        """Whether this turn is one of the last ``REMEMBERED_TURNS``, and the robot has moved on since then."""
        if np.count_nonzero(turn.range_m) < LEAST_READINGS:
            return False
        key = blake2b(turn.range_m.tobytes() + turn.clockwise_rad.tobytes(), digest_size=8).digest()
        first_m = self._travelled_m.setdefault(key, travelled_m)
        if len(self._travelled_m) > REMEMBERED_TURNS:
            del self._travelled_m[next(iter(self._travelled_m))]
        return travelled_m - first_m > MOVED_M


class Travel(MutableState):
    """How far a robot has moved, from its twists: metres of its middle, and of a point ``REACH_M`` away as it turns."""

    travelled_m: float = 0.0
    _stamp_s: float | None = None

    def add_twist(self, stamp_s: float, twist: Twist2D) -> None:
        """The robot has moved with this twist since the one before; a gap counts as ``LONGEST_STEP_S``."""
        if self._stamp_s is not None:
            step_s = min(max(stamp_s - self._stamp_s, 0.0), LONGEST_STEP_S)
            self.travelled_m += (abs(twist.linear_m_s) + REACH_M * abs(twist.angular_rad_s)) * step_s
        self._stamp_s = stamp_s
