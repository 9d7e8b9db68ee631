"""Ultrasonic range finder (HC-SR04): whole centimetres to a range, or to the reason why there is none."""

import math
from typing import Self

from pydantic import Field, model_validator

from chefbotd.core.events import RangeMeasured, RangeStatus, UltrasonicEchoed
from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters


class UltrasonicParameters(Parameters):
    """The band in which the sensor is trusted, its cone (full angle), and its place in ``base_footprint``.

    It reads by ``offset_m`` too far. Only the robot's description needs ``mount_z_m``, the height above the floor; the
    default is that of the axles.
    """

    name: str = Field(default="front", min_length=1)
    """The sensor's name in topics and messages."""
    min_range_m: float = Field(default=0.02, ge=0, le=10)
    """Nearer readings are not trusted."""
    max_range_m: float = Field(default=4.0, gt=0, le=10)
    """Farther readings count as nothing in sight."""
    offset_m: float = Field(default=0.0, ge=-0.5, le=0.5)
    """The sensor reads so much too far."""
    field_of_view_rad: float = Field(default=0.26, gt=0, le=math.pi)
    """The full angle of its cone."""
    mount_x_m: float = Field(default=0.0, ge=-5, le=5)
    """How far ahead of the wheels' middle it is."""
    mount_y_m: float = Field(default=0.0, ge=-5, le=5)
    """How far to the left of the robot's middle it is."""
    mount_z_m: float | None = Field(default=None, ge=0, le=5)
    """Its height above the floor, for the description; left out, that of the axles."""
    mount_heading_rad: float = Field(default=0.0, ge=-math.pi, le=math.pi)
    """Where it points, counter-clockwise from straight ahead."""

    @model_validator(mode="after")
    def _has_a_band(self) -> Self:
        if self.min_range_m >= self.max_range_m:
            raise ValueError(
                f"min_range_m must be below max_range_m, got {self.min_range_m} and {self.max_range_m}"
            )
        return self

    @property
    def base_from_sensor(self) -> Pose2D:
        """The sensor's mount; its beam leaves along its own x axis."""
        return Pose2D(self.mount_x_m, self.mount_y_m, self.mount_heading_rad)


def interpret(params: UltrasonicParameters, echoed: UltrasonicEchoed) -> RangeMeasured:
    """The range of a reading. 0 cm is no echo; a distance outside the band is never passed on as a distance."""
    distance_m = echoed.distance_cm / 100 - params.offset_m
    status = RangeStatus.NO_ECHO if echoed.distance_cm == 0 else _status(params, distance_m)
    return RangeMeasured(
        stamp_s=echoed.stamp_s,
        arrival_s=echoed.arrival_s,
        sensor=params.name,
        status=status,
        range_m=distance_m if status is RangeStatus.OK else None,
        min_range_m=params.min_range_m,
        max_range_m=params.max_range_m,
        field_of_view_rad=params.field_of_view_rad,
    )


def _status(params: UltrasonicParameters, distance_m: float) -> RangeStatus:
    if distance_m < params.min_range_m:
        return RangeStatus.TOO_NEAR
    if distance_m > params.max_range_m:
        return RangeStatus.TOO_FAR
    return RangeStatus.OK
