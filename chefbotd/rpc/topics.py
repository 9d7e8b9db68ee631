"""The topics: for each, the events behind it, the model of its data, and how the one becomes the other.

A topic's state is its latest event, except where a row says how an event joins what came before (``ranges``
holds the latest beam of every sensor). States are cheap; data is made from them only for someone who asked.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from chefbotd.core import events
from chefbotd.messages.telemetry import (
    BatteryData,
    ImuData,
    LinkData,
    OdometryData,
    RangeData,
    RangesData,
    RawData,
    ResetData,
    SafetyData,
    SimData,
    StatsData,
    TextData,
    TopicData,
    WheelsData,
)

ARMED_MODE = "armed"


def _replace(previous: object, event: object) -> object:
    return event


@dataclass(frozen=True, slots=True)
class Topic:
    """A row of the table; events of an ``on_demand`` topic are not even made unless someone subscribes."""

    name: str
    events: tuple[type[Any], ...]
    model: type[TopicData]
    data: Callable[[Any], TopicData]
    join: Callable[[Any, Any], Any] = _replace
    on_demand: bool = False


def topics(wheel_names: tuple[str, ...], *, simulated: bool) -> dict[str, Topic]:
    """The topics of this robot by name; ``sim`` only where there is a truth to tell."""
    rows = [
        Topic("odometry", (events.OdometryUpdated,), OdometryData, _odometry),
        Topic("wheels", (events.WheelsDriven,), WheelsData, partial(_wheels, wheel_names)),
        Topic("imu", (events.ImuMeasured,), ImuData, _same_fields(ImuData)),
        Topic("ranges", (events.RangeMeasured,), RangesData, _ranges, join=_join_beam),
        Topic("battery", (events.BatteryMeasured,), BatteryData, _same_fields(BatteryData)),
        Topic(
            "link",
            (events.LinkOpened, events.LinkHealthChanged, events.LinkNotOpened, events.LinkClosed),
            LinkData,
            link_data,
        ),
        Topic(
            "safety",
            (events.SafetyChanged, events.ControlChanged),
            SafetyData,
            safety_data,
            join=_join_safety,
        ),
        Topic("reset", (events.BoardResetProgressed,), ResetData, _same_fields(ResetData)),
        Topic("text", (events.TextReceived,), TextData, _same_fields(TextData)),
        Topic("raw", (events.LineSeen,), RawData, _raw, on_demand=True),
        Topic("stats", (events.StatsSampled,), StatsData, _same_fields(StatsData)),
    ]
    if simulated:
        rows.append(Topic("sim", (events.TruthSimulated,), SimData, _sim))
    return {topic.name: topic for topic in rows}


def _same_fields(model: type[TopicData]) -> Callable[[object], TopicData]:
    return partial(model.model_validate, from_attributes=True)


def _odometry(event: events.OdometryUpdated) -> OdometryData:
    return OdometryData(
        x_m=event.odom_from_base.x_m,
        y_m=event.odom_from_base.y_m,
        heading_rad=event.odom_from_base.heading_rad,
        linear_m_s=event.twist.linear_m_s,
        angular_rad_s=event.twist.angular_rad_s,
        covariance=event.covariance.row_by_row,
    )


def _wheels(names: tuple[str, ...], event: events.WheelsDriven) -> WheelsData:
    return WheelsData(
        name=names,
        position_rad=event.position_rad,
        velocity_rad_s=event.velocity_rad_s,
        target_rad_s=event.target_rad_s,
        duty=event.duty,
        excluded=tuple([names[index] for index in event.excluded]),
    )


Beams = Mapping[str, events.RangeMeasured]


def _join_beam(beams: Beams | None, event: events.RangeMeasured) -> Beams:
    return {**(beams or {}), event.sensor: event}


def _ranges(beams: Beams) -> RangesData:
    return RangesData(
        ranges=tuple(RangeData.model_validate(beam, from_attributes=True) for beam in beams.values())
    )


LinkEvent = events.LinkOpened | events.LinkHealthChanged | events.LinkNotOpened | events.LinkClosed


def link_data(event: LinkEvent | None) -> LinkData:
    """The link's state; None: nothing has been heard of it, so it is down."""
    match event:
        case events.LinkOpened():
            return LinkData(state="up", device=event.device, reason="", healthy=None, condition="judging")
        case events.LinkHealthChanged():
            return LinkData(
                state="up",
                device=event.device,
                reason=event.reason,
                healthy=event.healthy,
                condition=event.condition,
            )
        case events.LinkNotOpened() | events.LinkClosed():
            return LinkData(state="down", device=event.device, reason=event.reason)
    return LinkData(state="down", device="", reason="not opened yet")


@dataclass(frozen=True, slots=True)
class SafetyState:
    """What the gate last said (None: nothing yet), and who drives."""

    gate: events.SafetyChanged | None = None
    holders: Mapping[str, str] = field(default_factory=dict)


def _join_safety(
    previous: SafetyState | None, event: events.SafetyChanged | events.ControlChanged
) -> SafetyState:
    known = previous or SafetyState()
    if isinstance(event, events.ControlChanged):
        return replace(known, holders=event.holders)
    return replace(known, gate=event)


def safety_data(state: SafetyState | None) -> SafetyData:
    """The gate's state and who drives; as long as the gate has not spoken nothing may move."""
    event, control = (state.gate, dict(state.holders)) if state is not None else (None, {})
    if event is None:
        reason = "the gate has not reported yet"
        return SafetyData(mode="unknown", reason=reason, source=None, armed=False, control=control)
    return SafetyData(
        mode=event.mode,
        reason=event.reason,
        source=event.source,
        armed=event.mode == ARMED_MODE,
        control=control,
        fault=event.fault,
        limited_by=event.limited_by,
    )


def _raw(event: events.LineSeen) -> RawData:
    return RawData(direction=event.direction, line=event.line.decode("ascii", "backslashreplace"))


def _sim(event: events.TruthSimulated) -> SimData:
    return SimData(
        x_m=event.world_from_base.x_m,
        y_m=event.world_from_base.y_m,
        heading_rad=event.world_from_base.heading_rad,
        linear_m_s=event.twist.linear_m_s,
        angular_rad_s=event.twist.angular_rad_s,
        in_contact=event.in_contact,
    )
