"""Whether the IMU turns as the wheels do, in the long run, and if not, what it is most like.

A slip or a push lasts for a moment. An IMU that is mounted upside down, whose quaternion is read in another order, or
whose scale is wrong, disagrees with every turn, and in the same way. So turns of half a radian by the wheels are
compared with what the IMU shows of them, as it is read and as it would be read otherwise (least squares).
"""

import math
from enum import StrEnum
from typing import Final

from msgspec import field

from chefbotd.core.geometry import wrap_angle
from chefbotd.core.record import MutableState
from chefbotd.core.sentence import Sentence

TURN_RAD: Final = 0.5
"""A turn by the wheels that is compared; a shorter one says little, as headings come late and are coarse."""

LONGEST_S: Final = 5.0
"""A turn that takes longer is not compared: the IMU may have drifted as far meanwhile."""

MEMORY_TURNS: Final = 12.0
FIRST_TURNS, MANY_TURNS = 2, 6
MIRRORED, NOTHING, LIKE = -0.5, 0.3, (0.7, 1.4)
TOO_MUCH, TOO_LITTLE, LINEAR = 1.6, 0.6, 0.98
"""Shares of the wheels' turn. A wrong scale shows the same share of every turn; slipping wheels do not."""


class ImuFault(StrEnum):
    """What an IMU that lastingly disagrees with the wheels is most like."""

    NONE = ""
    MIRRORED = "mirrored"
    W_FIRST = "w_first"
    SCALE = "scale"


class Turns(MutableState):
    """Sums over turns, which fade: of the wheels' squared, of the products, of the IMU's squared."""

    wheels2: float = 0.0
    product: float = 0.0
    imu2: float = 0.0

    def add(self, wheels_rad: float, imu_rad: float) -> None:
        """Add a turn."""
        kept = 1 - 1 / MEMORY_TURNS
        self.wheels2 = kept * self.wheels2 + wheels_rad * wheels_rad
        self.product = kept * self.product + wheels_rad * imu_rad
        self.imu2 = kept * self.imu2 + imu_rad * imu_rad

    @property
    def share(self) -> float:
        """How much of the wheels' turn the IMU shows."""
        return self.product / self.wheels2 if self.wheels2 else 1.0

    @property
    def is_linear(self) -> bool:
        """Whether it is the same share of every turn."""
        return self.product * self.product > LINEAR * self.wheels2 * self.imu2 > 0


class ImuAgreement(MutableState):
    """Compares the present turn, and remembers those before."""

    turns: int = 0
    as_read: Turns = field(default_factory=Turns)
    w_first: Turns = field(default_factory=Turns)
    began_s: float = -math.inf
    wheels_rad: float = 0.0
    imu_rad: float = 0.0
    w_first_rad: float = 0.0
    last_rad: float | None = None
    last_w_first_rad: float | None = None
    fault: ImuFault = ImuFault.NONE

    def add_heading(self, heading_rad: float, orientation: tuple[float, ...] | None) -> None:
        """Add a heading of the IMU, and the quaternion that it was read from."""
        if self.last_rad is not None:
            self.imu_rad += wrap_angle(heading_rad - self.last_rad)
        self.last_rad = heading_rad
        if orientation is not None:
            w, x, y, z = orientation
            other_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
            if self.last_w_first_rad is not None:
                self.w_first_rad += wrap_angle(other_rad - self.last_w_first_rad)
            self.last_w_first_rad = other_rad

    def add_rate(self, turned_rad: float) -> None:
        """Add a turn by the gyroscope."""
        self.imu_rad += turned_rad

    def add_wheels(self, stamp_s: float, turned_rad: float) -> bool:
        """Add a turn of the wheels; returns whether a turn was compared, and the IMU agreed with it."""
        if self.began_s == -math.inf or stamp_s - self.began_s > LONGEST_S:
            self._begin(stamp_s)
        self.wheels_rad += turned_rad
        if abs(self.wheels_rad) < TURN_RAD:
            return False
        self.turns += 1
        self.as_read.add(self.wheels_rad, self.imu_rad)
        self.w_first.add(self.wheels_rad, self.w_first_rad)
        agrees = LIKE[0] <= self.imu_rad / self.wheels_rad <= LIKE[1]
        self._begin(stamp_s)
        return agrees

    def forget_turn(self) -> None:
        """What is under way cannot be compared."""
        self.began_s = -math.inf

    def _begin(self, stamp_s: float) -> None:
        self.began_s, self.wheels_rad, self.imu_rad, self.w_first_rad = stamp_s, 0.0, 0.0, 0.0

    @property
    def contradicts(self) -> bool:
        """Whether, as far as can be told by now, the IMU turns the other way."""
        opposite_now = (
            self.wheels_rad * self.imu_rad < 0 and min(abs(self.wheels_rad), abs(self.imu_rad)) > 0.05
        )
        return (self.turns > 0 and self.as_read.share < 0) or opposite_now

    def judge(self, *, wheels_slip: bool) -> ImuFault:
        """What is wrong with the IMU; where the ``wheels_slip`` in every turn, its scale cannot be told."""
        share = self.as_read.share
        if self.turns < FIRST_TURNS or not self.as_read.wheels2:
            return ImuFault.NONE
        if share < MIRRORED:
            return ImuFault.MIRRORED
        if abs(share) < NOTHING and LIKE[0] <= self.w_first.share <= LIKE[1]:
            return ImuFault.W_FIRST
        if self.turns < MANY_TURNS or wheels_slip or not self.as_read.is_linear:
            return ImuFault.NONE
        return ImuFault.SCALE if share > TOO_MUCH or 0 < share < TOO_LITTLE else ImuFault.NONE

    def reason(self) -> str:
        """What the fault is, for people; empty without one."""
        share = self.as_read.share
        match self.fault:
            case ImuFault.MIRRORED:
                return Sentence(
                    "driving.imu_mirrored",
                    "the IMU shows {share:.2f} of the wheels' turns, the other way: most likely its z axis "
                    "points down (the configuration of the IMU can say so), or its rates have the other sign. It "
                    "is left out",
                    share=share,
                )
            case ImuFault.W_FIRST:
                return Sentence(
                    "driving.imu_w_first",
                    "the IMU's heading does not follow the wheels' turns, and would if its quaternion were read "
                    "as w x y z: the sketch must print x y z w. It is left out",
                )
            case ImuFault.SCALE:
                return Sentence(
                    "driving.imu_scale",
                    "the IMU shows {share:.2f} of every turn of the wheels: its scale is wrong, which a "
                    "calibration of the IMU finds, or the wheels' track. It is left out",
                    share=share,
                )
        return ""
