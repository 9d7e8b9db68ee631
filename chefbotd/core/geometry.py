"""Poses and twists in the plane (REP-103: x forward, y left, counter-clockwise positive, SI units)."""

import math
from typing import NamedTuple, TypeAlias

from chefbotd.core.record import Record


def wrap_angle(angle_rad: float) -> float:
    """The same angle in (-pi, pi]."""
    wrapped = math.remainder(angle_rad, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


class Twist2D(Record, frozen=True):
    """Velocity in the robot's own frame: forward in m/s, turning in rad/s (CCW positive)."""

    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0


class WheelVelocities(NamedTuple):
    """The commanded speed of each wheel, in the order of the configured wheels (rad/s, forward positive).

    ``twist`` is how they move the robot as a whole, if none of them slips. It is a tuple because a recorded state tells
    it from a ``Twist2D`` by that: of two untagged records msgspec could not say which one was written.
    With a ``duty`` of each wheel no controller acts: the motors get these duties (forward positive), and the speeds
    are the highest that the wheels may reach with them.
    """

    rad_s: tuple[float, ...]
    twist: Twist2D
    duty: tuple[int, ...] | None = None

    def slowed(self, share: float) -> "WheelVelocities":
        """All wheels at this share of their speeds: the same arc, more slowly. Of duties, all or nothing."""
        if self.duty is not None:
            if share >= 1.0:
                return self
            return WheelVelocities((0.0,) * len(self.rad_s), Twist2D(), (0,) * len(self.rad_s))
        twist = Twist2D(self.twist.linear_m_s * share, self.twist.angular_rad_s * share)
        return WheelVelocities(tuple([velocity * share for velocity in self.rad_s]), twist)


class WheelDuties(Record, frozen=True):
    """The duty of each motor, in the order of the configured wheels (forward positive): a motion without a controller.

    Only the robot's own calibration drives so.
    """

    duty: tuple[int, ...]


Motion: TypeAlias = Twist2D | WheelVelocities
"""A commanded motion: a twist of the robot, or a speed of each wheel."""


class Pose2D(Record, frozen=True):
    """The pose of one frame in another: ``odom_from_base`` maps points of ``base_footprint`` into ``odom``."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0

    def compose(self, other: "Pose2D") -> "Pose2D":
        """``a_from_b.compose(b_from_c)`` is ``a_from_c``; the heading is wrapped to (-pi, pi]."""
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return Pose2D(
            self.x_m + cos * other.x_m - sin * other.y_m,
            self.y_m + sin * other.x_m + cos * other.y_m,
            wrap_angle(self.heading_rad + other.heading_rad),
        )

    def inverse(self) -> "Pose2D":
        """``a_from_b.inverse()`` is ``b_from_a``."""
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return Pose2D(
            -cos * self.x_m - sin * self.y_m,
            sin * self.x_m - cos * self.y_m,
            wrap_angle(-self.heading_rad),
        )


class PoseCovariance(Record, frozen=True, array_like=True):
    """The covariance of a pose: the upper triangle of the symmetric 3x3 matrix over (x, y, heading h), in m, rad.

    Six numbers and no array: at the rate of the encoders, arithmetic on small arrays would cost more than all the rest.
    """

    xx: float = 0.0
    xy: float = 0.0
    xh: float = 0.0
    yy: float = 0.0
    yh: float = 0.0
    hh: float = 0.0

    def turned(self, angle_rad: float) -> "PoseCovariance":
        """The same in a frame in which all headings are greater by this angle."""
        cos, sin = math.cos(angle_rad), math.sin(angle_rad)
        across = (self.xx - self.yy) * cos * sin + self.xy * (cos * cos - sin * sin)
        return PoseCovariance(
            self.xx * cos * cos - 2 * self.xy * cos * sin + self.yy * sin * sin,
            across,
            self.xh * cos - self.yh * sin,
            self.xx * sin * sin + 2 * self.xy * cos * sin + self.yy * cos * cos,
            self.xh * sin + self.yh * cos,
            self.hh,
        )

    @property
    def row_by_row(self) -> tuple[float, ...]:
        """All nine numbers of the matrix."""
        return (self.xx, self.xy, self.xh, self.xy, self.yy, self.yh, self.xh, self.yh, self.hh)


STANDING = Twist2D()
ORIGIN = Pose2D()
CERTAIN = PoseCovariance()
