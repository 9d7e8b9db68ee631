"""The IMU's rates and headings as odometry takes them: summed, unwrapped, and checked for jumps and for rest."""

import math
from typing import Final

from chefbotd.core.geometry import wrap_angle
from chefbotd.core.record import MutableState, Record

GAP_S: Final = 0.3
"""After a longer silence nobody knows how the robot has turned meanwhile."""

RATE_JUMP_RAD_S: Final = 3.0
"""No robot changes its rate so much between two samples. Up to ``MOST_JUMPS`` in a row are passed over."""

MOST_JUMPS: Final = 3
SAMPLES: Final = 10
"""The rate's mean and variance are those of about so many samples."""

STILL_VARIANCE: Final = 0.01**2
"""Rates of a robot at rest vary less (rad²/s²)."""


class RateTrack(MutableState):
    """The sum of a gyroscope's rates, between two samples by the trapezoidal rule, and held beyond the last one."""

    stamp_s: float = -math.inf
    rate_rad_s: float = 0.0
    turned_rad: float = 0.0
    used_rad: float | None = None
    jumps: int = 0
    samples: int = 0
    mean_rad_s: float = 0.0
    variance: float = 0.0

    def add(self, stamp_s: float, rate_rad_s: float) -> bool:
        """Add a sample; one that is not newer than the last, not finite or a jump is passed over. False for a jump."""
        dt_s = stamp_s - self.stamp_s
        if dt_s <= 0 or not math.isfinite(rate_rad_s):
            return True
        if dt_s > GAP_S:
            self.used_rad, self.samples = None, 0
        elif abs(rate_rad_s - self.rate_rad_s) > RATE_JUMP_RAD_S and self.jumps < MOST_JUMPS:
            self.jumps += 1
            return False
        else:
            self.turned_rad += (rate_rad_s + self.rate_rad_s) / 2 * dt_s
        self.jumps, self.samples = 0, min(self.samples + 1, SAMPLES)
        off = rate_rad_s - self.mean_rad_s
        self.mean_rad_s += off / self.samples
        self.variance += (off * (rate_rad_s - self.mean_rad_s) - self.variance) / self.samples
        self.stamp_s, self.rate_rad_s = stamp_s, rate_rad_s
        return True

    def turned_until(self, stamp_s: float) -> float | None:
        """The turn since the last call (rad, with the bias); None where samples are missing, and the first time."""
        after_s = stamp_s - self.stamp_s
        if after_s > GAP_S:
            self.used_rad = None
            return None
        turned_rad, before = self.turned_rad + self.rate_rad_s * after_s, self.used_rad
        self.used_rad = turned_rad
        return None if before is None else turned_rad - before

    @property
    def is_still(self) -> bool:
        """Whether the last rates vary as little as those of a robot at rest."""
        return self.samples == SAMPLES and self.variance < STILL_VARIANCE


class Heading(Record, frozen=True):
    """A heading of the IMU at its time, and the mean of it and the one before, at the mean of their times.

    Two that follow each other and differ lie on both sides of the true one, however coarse they are: so their mean is
    nearer to it than either. ``is_new``: they differ, so it says something. All headings are unwrapped.
    """

    stamp_s: float
    heading_rad: float
    middle_s: float
    middle_rad: float
    is_new: bool


class HeadingTrack(MutableState):
    """The last heading, unwrapped, and divided by ``scale``: how much the gyroscope behind it shows of a turn."""

    stamp_s: float = -math.inf
    reading_rad: float = 0.0
    heading_rad: float = 0.0

    def add(self, stamp_s: float, reading_rad: float, scale: float, expected_rad: float) -> Heading | None:
        """The next heading; None where it is not newer than the last.

        After a gap it is unwrapped towards the expected one.
        """
        dt_s = stamp_s - self.stamp_s
        if dt_s <= 0 or not math.isfinite(reading_rad):
            return None
        if dt_s > GAP_S:
            heading_rad = expected_rad + wrap_angle(reading_rad - expected_rad)
            heading = Heading(stamp_s, heading_rad, stamp_s, heading_rad, is_new=True)
        else:
            turned_rad = wrap_angle(reading_rad - self.reading_rad) / scale
            heading_rad = self.heading_rad + turned_rad
            middle_s, middle_rad = stamp_s - dt_s / 2, heading_rad - turned_rad / 2
            heading = Heading(stamp_s, heading_rad, middle_s, middle_rad, is_new=turned_rad != 0)
        self.stamp_s, self.reading_rad, self.heading_rad = stamp_s, reading_rad, heading_rad
        return heading
