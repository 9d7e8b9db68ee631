"""Driving: what moves and stops the robot, and the topics ``wheels`` and ``safety``."""

from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, Final

from msgspec import Meta
from pydantic import ConfigDict, Field, field_validator, model_validator

from chefbotd.core import events
from chefbotd.core.printable import one_line
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence
from chefbotd.rpc.models import SOURCE, Done, MotionParams, Params
from chefbotd.rpc.topics import Topic, same_names

ARMED_MODE: Final = "armed"
MOST_WHEELS: Final = 64
WheelName = Annotated[str, Field(min_length=1, max_length=64)]
MAX_REASON_CHARACTERS: Final = 200
NO_REASON: Final = "asked by a client"


class DriveParams(MotionParams):
    """A velocity in the robot's frame: forward in m/s, turning in rad/s (CCW positive)."""

    linear_m_s: float
    angular_rad_s: float
    source: str | None = SOURCE


class SetWheelVelocitiesParams(MotionParams):
    """The speed of each named wheel (forward positive); other wheels stand."""

    name: list[WheelName] = Field(min_length=1, max_length=MOST_WHEELS)
    velocity_rad_s: list[float] = Field(min_length=1, max_length=MOST_WHEELS)
    source: str | None = SOURCE

    @model_validator(mode="after")
    def _one_for_each(self) -> "SetWheelVelocitiesParams":
        if len(self.name) != len(self.velocity_rad_s):
            raise ValueError(f"{len(self.name)} names for {len(self.velocity_rad_s)} velocities")
        if repeated := sorted({name for name in self.name if self.name.count(name) > 1}):
            raise ValueError(f"each wheel may be named once, repeated: {', '.join(map(ascii, repeated))}")
        return self

    def by_name(self) -> dict[str, float]:
        """The velocity of each wheel."""
        return dict(zip(self.name, self.velocity_rad_s, strict=True))


class StopParams(Params):
    """No parameters; any that are sent are ignored."""

    model_config = ConfigDict(extra="ignore")

    @model_validator(mode="before")
    @classmethod
    def _whatever_comes(cls, params: Any) -> Any:
        return params if isinstance(params, dict) else {}


class ArmParams(Params):
    """The latched stop or fault to clear."""

    latch: int | None = Field(
        None, ge=0, description="the latch number from the topic safety; null: the newest"
    )


class EstopParams(StopParams):
    """The reason, for people; an empty one, or one that is not text, counts as none."""

    reason: Annotated[str, Field(description=f"truncated to {MAX_REASON_CHARACTERS} characters")] = NO_REASON

    @field_validator("reason", mode="before")
    @classmethod
    def _readable(cls, reason: Any) -> str:
        text = reason.encode(errors="replace").decode() if isinstance(reason, str) else ""
        return one_line(text.strip()).strip()[:MAX_REASON_CHARACTERS] or NO_REASON


class Stopped(Done, frozen=True, kw_only=True):
    """Who was driving: the clients' names by source, including the client that stopped the robot."""

    drivers: dict[str, str]
    stop_number: Annotated[
        int, Meta(description="that of this stop, or of a later one: see the topic safety")
    ] = 0


class Limited(Done, frozen=True):
    """The command is carried out as far as the limits allow; ``limited_by`` is the key of the tightest limit."""

    limited_by: Annotated[
        str | None,
        Meta(
            description="null where it is carried out as requested; the topic safety tells what limits it now"
        ),
    ] = None


class Driven(Limited, frozen=True, kw_only=True):
    """The velocity that the robot will reach."""

    linear_m_s: float
    angular_rad_s: float


class WheelSpeedsSet(Limited, frozen=True, kw_only=True):
    """The velocities that the named wheels will reach, in the order of the request."""

    name: list[str]
    velocity_rad_s: list[float]


class WheelsData(Record, frozen=True):
    """A joint state after a control step, all lists in the order of the configured wheels."""

    name: tuple[str, ...]
    position_rad: tuple[float, ...]
    velocity_rad_s: tuple[float, ...]
    target_rad_s: tuple[float, ...]
    duty: tuple[int, ...]
    excluded: Annotated[
        tuple[str, ...],
        Meta(description="wheels that disagree with the others of their side; odometry excludes them"),
    ] = ()


class DriveWarningData(Record, frozen=True):
    """Wheels that do not follow their commands, though nothing stops the robot."""

    reason: Annotated[str, Meta(description="what was measured and what to do; empty while nothing is wrong")]


class SafetyData(Record, frozen=True):
    """The gate: its mode and reason, the source in force, whether the robot may move, and who drives."""

    mode: str
    reason: str
    source: str | None
    armed: bool
    control: Annotated[
        dict[str, str], Meta(description="for each source that someone has control of, the client's name")
    ]
    fault: Annotated[str | None, Meta(description="name of the latched fault; names never change")] = None
    limited_by: Annotated[
        str | None, Meta(description="what keeps the command from being followed as given")
    ] = None
    latch: Annotated[
        int,
        Meta(
            description="number of the last emergency stop or fault, which no other start of the daemon has; for arm"
        ),
    ] = 0
    stop_number: Annotated[
        int,
        Meta(
            description="number of the last stop, emergency stop or fault, which no other start of the daemon has; "
            "for if_stop_number"
        ),
    ] = 0
    guard_warning: Annotated[
        str,
        Meta(
            description="that sensors see obstacles while the obstacle guard is off; empty: it is on, or none do"
        ),
    ] = ""


def _wheels(names: tuple[str, ...], event: events.WheelsDriven) -> WheelsData:
    return WheelsData(
        name=names,
        position_rad=event.position_rad,
        velocity_rad_s=event.velocity_rad_s,
        target_rad_s=event.target_rad_s,
        duty=event.duty,
        excluded=tuple([names[index] for index in event.excluded]),
    )


class SafetyState(Record, frozen=True):
    """The gate's last event (None: none so far), and who drives."""

    gate: events.SafetyChanged | None = None
    holders: Mapping[str, str] = {}


def _join_safety(
    previous: SafetyState | None, event: events.SafetyChanged | events.ControlChanged
) -> SafetyState:
    state = previous or SafetyState()
    if isinstance(event, events.ControlChanged):
        return replace(state, holders=event.holders)
    return replace(state, gate=event)


def safety_data(state: SafetyState | None) -> SafetyData:
    """The gate's state and who drives. Before the gate's first event nothing may move."""
    event, control = (state.gate, dict(state.holders)) if state is not None else (None, {})
    if event is None:
        reason = Sentence("driving.state_unknown", "the safety state is not known yet")
        return SafetyData(mode="unknown", reason=reason, source=None, armed=False, control=control)
    return SafetyData(
        mode=event.mode,
        reason=event.reason,
        source=event.source,
        armed=event.mode == ARMED_MODE,
        control=control,
        fault=event.fault,
        limited_by=event.limited_by,
        latch=event.latch,
        stop_number=event.stop_number,
        guard_warning=event.guard_warning,
    )


def topics(wheel_names: tuple[str, ...]) -> tuple[Topic, ...]:
    """The topics ``wheels`` and ``safety``; ``wheel_names`` is the order of the tuples in ``WheelsDriven``."""
    gate = (events.SafetyChanged, events.ControlChanged)
    return (
        Topic("wheels", (events.WheelsDriven,), WheelsData, partial(_wheels, wheel_names)),
        Topic("safety", gate, SafetyData, safety_data, join=_join_safety, always_known=True, for_guests=True),
        Topic("drive_warning", (events.DriveWarned,), DriveWarningData, same_names(DriveWarningData)),
    )
