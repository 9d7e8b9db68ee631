"""Sensors: the topics ``imu``, ``ranges`` and ``battery``."""

from collections.abc import Mapping

from chefbotd.core.events import (
    BatteryData,
    BatteryMeasured,
    ImuData,
    ImuMeasured,
    RangeMeasured,
    RangeStatus,
)
from chefbotd.core.record import Record
from chefbotd.rpc.topics import Topic, same_names


class RangeData(Record, frozen=True):
    """One beam; ``range_m`` is null unless ``status`` is ``ok``."""

    sensor: str
    status: RangeStatus
    range_m: float | None
    min_range_m: float
    max_range_m: float
    field_of_view_rad: float
    stamp_s: float


class RangesData(Record, frozen=True):
    """The latest beam of each range sensor, each with its own stamp."""

    ranges: tuple[RangeData, ...]


Beams = Mapping[str, RangeMeasured]


def _join_beam(beams: Beams | None, event: RangeMeasured) -> Beams:
    return {**(beams or {}), event.sensor: event}


def _ranges(beams: Beams) -> RangesData:
    return RangesData(tuple([same_names(RangeData)(beam) for beam in beams.values()]))


TOPICS = (
    Topic("imu", (ImuMeasured,), ImuData, same_names(ImuData)),
    Topic("ranges", (RangeMeasured,), RangesData, _ranges, join=_join_beam, for_guests=True),
    Topic("battery", (BatteryMeasured,), BatteryData, same_names(BatteryData), for_guests=True),
)
