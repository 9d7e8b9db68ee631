"""Sensors: the topics ``imu``, ``ranges`` and ``battery``."""

from collections.abc import Mapping

from pydantic import Field

from chefbotd.core.events import BatteryLevelStatus, BatteryMeasured, ImuMeasured, RangeMeasured, RangeStatus
from chefbotd.rpc.models import TopicData
from chefbotd.rpc.topics import Topic


class ImuData(TopicData):
    """The IMU; what this variant does not measure is null."""

    orientation: tuple[float, float, float, float] | None = Field(description="unit quaternion x, y, z, w")
    heading_rad: float | None
    angular_velocity_rad_s: tuple[float, float, float] | None
    linear_acceleration_m_s2: tuple[float, float, float] | None


class RangeData(TopicData):
    """One beam; ``range_m`` is null unless ``status`` is ``ok``."""

    sensor: str
    status: RangeStatus
    range_m: float | None
    min_range_m: float
    max_range_m: float
    field_of_view_rad: float
    stamp_s: float


class RangesData(TopicData):
    """The latest beam of each range sensor, each with its own stamp."""

    ranges: tuple[RangeData, ...]


class BatteryData(TopicData):
    """The battery."""

    voltage_v: float
    percentage: float
    status: BatteryLevelStatus


Beams = Mapping[str, RangeMeasured]


def _join_beam(beams: Beams | None, event: RangeMeasured) -> Beams:
    return {**(beams or {}), event.sensor: event}


def _ranges(beams: Beams) -> RangesData:
    return RangesData(
        ranges=tuple(RangeData.model_validate(beam, from_attributes=True) for beam in beams.values())
    )


TOPICS = (
    Topic("imu", (ImuMeasured,), ImuData, ImuData.of),
    Topic("ranges", (RangeMeasured,), RangesData, _ranges, join=_join_beam),
    Topic("battery", (BatteryMeasured,), BatteryData, BatteryData.of),
)
