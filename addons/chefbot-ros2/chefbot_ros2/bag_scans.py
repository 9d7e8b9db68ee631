"""Others' `sensor_msgs/LaserScan` as a scan of ours: what is a reading, and what a driver writes where there is none.

REP-117 has infinity for "no return". Drivers write range_max too, a number above it (65.535 is all ones of a 16-bit
millimetre), or one just below it, and each beam that saw nothing has that same number.
"""

from collections import Counter
from collections.abc import Iterable
from typing import Any, Final

import numpy as np

from chefbotd.core.scan import Floats, LaserScan

JUST_BELOW: Final = 0.97
"""A driver's own "no return" is at least this share of range_max."""

LEAST_SHARE: Final = 0.02
LEAST_READINGS: Final = 50
"""So many readings are the same number to the last bit: a wall's differ, by noise or by the angle it is seen at."""

ODDS: Final = 10.0
"""It is so many times as frequent as the next number near it: a lidar of whole centimetres repeats all its numbers."""


def usable_m(message: Any) -> tuple[float, float]:
    """The nearest and farthest reading that a message says its lidar has; limits that make no sense are none."""
    nearest, farthest = float(message.range_min), float(message.range_max)
    if not np.isfinite(nearest) or nearest < 0:
        nearest = 0.0
    if not farthest > nearest:
        farthest = np.inf
    return nearest, farthest


def no_return_m(messages: Iterable[Any]) -> float | None:
    """The number just below range_max that stands for "no return"; None where there is none."""
    counts: Counter[float] = Counter()
    total = 0
    for message in messages:
        nearest, farthest = usable_m(message)
        ranges = np.asarray(message.ranges, dtype=np.float64)
        good = ranges[np.isfinite(ranges) & (ranges > 0) & (ranges >= nearest) & (ranges < farthest)]
        total += good.size
        if np.isfinite(farthest):
            counts.update(good[good >= JUST_BELOW * farthest].tolist())
    if not counts:
        return None
    (value, count), *others = counts.most_common(2)
    is_frequent = count >= max(LEAST_READINGS, LEAST_SHARE * total)
    stands_out = not others or count >= ODDS * others[0][1]
    return value if is_frequent and stands_out else None


def scan_of(message: Any, stamp_s: float, *, upside_down: bool, no_return: float | None) -> LaserScan:
    """The message's readings; ``stamp_s`` is the time of its first beam. What is none has the range 0."""
    ranges = np.asarray(message.ranges, dtype=np.float64)
    count = ranges.size
    turned = message.angle_min + message.angle_increment * np.arange(count, dtype=np.float64)
    duration_s = message.time_increment * max(count - 1, 0)
    after_s: Floats = np.linspace(-duration_s, 0.0, count, dtype=np.float64)
    nearest, farthest = usable_m(message)
    with np.errstate(invalid="ignore"):
        good = np.isfinite(ranges) & (ranges > 0) & (ranges >= nearest) & (ranges < farthest)
    if no_return is not None:
        good &= ranges != no_return
    bearings = -turned if upside_down else turned
    return LaserScan(stamp_s + duration_s, bearings, np.where(good, ranges, 0.0), after_s)
