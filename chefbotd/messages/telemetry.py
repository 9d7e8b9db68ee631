"""The data of each topic: what a client reads, in SI units and REP-103 axes."""

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Literal, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, create_model

from chefbotd.core.events import BatteryLevelStatus, Direction, RangeStatus, StatsSampled


class TopicData(BaseModel):
    """Telemetry: SI units, REP-103 axes; a number that is not finite is sent as null."""

    model_config = ConfigDict(frozen=True, defer_build=True)


def _fields_of(event: type[Any]) -> dict[str, Any]:
    """An event's fields as they stand, all required, without the stamp that every topic has beside its data."""
    types = get_type_hints(event)
    return {field.name: (types[field.name], ...) for field in fields(event) if field.name != "stamp_s"}


class OdometryData(TopicData):
    """Dead reckoning: the base's pose in ``odom``, its twist in its own frame."""

    x_m: float
    y_m: float
    heading_rad: float = Field(description="CCW positive, in (-pi, pi]")
    linear_m_s: float
    angular_rad_s: float
    covariance: tuple[float, ...] = Field(description="3x3, row by row, over x, y, heading")
    frame_id: Literal["odom"] = "odom"
    child_frame_id: Literal["base_footprint"] = "base_footprint"


class WheelsData(TopicData):
    """A joint state after a control step, all lists in the order of the configured wheels."""

    name: tuple[str, ...]
    position_rad: tuple[float, ...]
    velocity_rad_s: tuple[float, ...]
    target_rad_s: tuple[float, ...]
    duty: tuple[int, ...]
    excluded: tuple[str, ...] = Field(
        (), description="wheels that disagree with their mates on the same side, and do not count in odometry"
    )


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


class LinkData(TopicData):
    """The serial link; ``reason`` says why it is down, or up and not healthy."""

    state: Literal["up", "down"]
    device: str
    reason: str
    healthy: bool | None = Field(
        default=False, description="whether a board talks; null until it can be told"
    )
    condition: str = Field(
        default="down",
        description="healthy, silent, wrong_baud, wrong_device, echo_stuck, judging or down",
    )


class ResetData(TopicData):
    """How far a restart of the board that was asked for has come; ``reason`` says what to do, if anything is."""

    stage: str = Field(
        description="stopping, asked; at the end restarted, not_restarted, no_answer or link_lost"
    )
    reason: str


class SafetyData(TopicData):
    """The gate: its mode and why, which source's command is in force, whether the robot may move, and who drives."""

    mode: str
    reason: str
    source: str | None
    armed: bool
    control: dict[str, str] = Field(
        description="for each source that someone has control of, the client's name"
    )
    fault: str | None = Field(None, description="stable name of the fault that has latched")
    limited_by: str | None = Field(None, description="what keeps the command from being followed as given")


class TextData(TopicData):
    """A line of text from the board."""

    text: str


class RawData(TopicData):
    """A line as it stood on the wire; bytes beyond ASCII are escaped in hexadecimal."""

    direction: Direction
    line: str


if TYPE_CHECKING:

    class StatsData(TopicData, StatsSampled):
        """For type checkers: the fields of the event, which they cannot see being copied."""
else:
    StatsData = create_model(
        "StatsData",
        __base__=TopicData,
        __doc__="Counters since the daemon started, and the worst of the last second.",
        **_fields_of(StatsSampled),
    )


class SimData(TopicData):
    """Where the simulated robot really is, in the world's frame."""

    x_m: float
    y_m: float
    heading_rad: float
    linear_m_s: float
    angular_rad_s: float
    in_contact: bool


class UnknownData(TopicData):
    """The data of a topic that this version has no model of: its members as attributes, as they came."""

    model_config = ConfigDict(frozen=True, extra="allow")

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...


DATA_BY_TOPIC: Mapping[str, type[TopicData]] = {
    "odometry": OdometryData,
    "wheels": WheelsData,
    "imu": ImuData,
    "ranges": RangesData,
    "battery": BatteryData,
    "link": LinkData,
    "safety": SafetyData,
    "reset": ResetData,
    "text": TextData,
    "raw": RawData,
    "stats": StatsData,
    "sim": SimData,
}
"""What a client reads each topic as."""
