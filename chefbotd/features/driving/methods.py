"""Driving: the methods that move and stop the robot, and the topics ``wheels`` and ``safety``."""

from collections.abc import Collection, Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final, Protocol

from pydantic import ConfigDict, Field, field_validator, model_validator

from chefbotd.core import events
from chefbotd.core.commands import Allowed
from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import Record, replace
from chefbotd.features.driving.contenders import Contenders
from chefbotd.rpc.method import Caller, Method, method, methods_of
from chefbotd.rpc.models import DONE, SOURCE, Done, Params, TopicData
from chefbotd.rpc.roles import Role
from chefbotd.rpc.topics import Topic

if TYPE_CHECKING:
    from chefbotd.clock import Clock
    from chefbotd.rpc.control_leases import ControlLeases

ARMED_MODE: Final = "armed"
MOST_WHEELS: Final = 64
WheelName = Annotated[str, Field(min_length=1, max_length=64)]
MAX_REASON_CHARACTERS: Final = 200
NO_REASON: Final = "asked by a client"


class DriveParams(Params):
    """A velocity in the robot's frame: forward in m/s, turning in rad/s (CCW positive)."""

    linear_m_s: float
    angular_rad_s: float
    source: str | None = SOURCE


class SetWheelVelocitiesParams(Params):
    """Wheels by name, and how fast each of them is to turn (forward positive); the others stand."""

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
    """Nothing; whatever comes all the same is passed over."""

    model_config = ConfigDict(extra="ignore")

    @model_validator(mode="before")
    @classmethod
    def _whatever_comes(cls, params: Any) -> Any:
        return params if isinstance(params, dict) else {}


class ArmParams(Params):
    """What is to be cleared."""

    latch: int | None = Field(
        None, ge=0, description="the latch number from the topic safety; null: the newest"
    )


class EstopParams(StopParams):
    """Why, for the people who will ask; a reason that is no text, or empty, is none."""

    reason: Annotated[str, Field(description=f"truncated to {MAX_REASON_CHARACTERS} characters")] = NO_REASON

    @field_validator("reason", mode="before")
    @classmethod
    def _readable(cls, reason: Any) -> str:
        text = reason.encode(errors="replace").decode() if isinstance(reason, str) else ""
        return text.strip()[:MAX_REASON_CHARACTERS] or NO_REASON


class Stopped(Done):
    """Who was driving: the client's name by its source, the one that stopped the robot among them."""

    drivers: dict[str, str]


class Limited(Done):
    """It is carried out as far as the configured limits allow; ``limited_by`` is the key of the tightest."""

    limited_by: str | None = Field(
        None,
        description="null where it is carried out as requested; the topic safety tells what limits it now",
    )


class Driven(Limited):
    """The velocity that the robot goes for."""

    linear_m_s: float
    angular_rad_s: float


class WheelsDriven(Limited):
    """The velocities that the named wheels go for, in the order in which they were named."""

    name: list[str]
    velocity_rad_s: list[float]


class Robot(Protocol):
    """What carries the commands out, at once.

    What is not carried out raises ``chefbotd.core.commands.Refused``.
    """

    def drive(self, source: str, twist: Twist2D) -> Allowed[Twist2D]:
        """Take a velocity command of a source; what the limits allow of it."""
        ...

    def set_wheel_velocities(
        self, source: str, velocity_rad_s: Mapping[str, float]
    ) -> Allowed[Mapping[str, float]]:
        """Take a command for each wheel by name; wheels that are not named stand. What the limits allow of it."""
        ...

    def stop(self, by: str, excluded: Collection[str] = ()) -> None:
        """Come to rest; sources that are driven are held, but for the ``excluded`` ones, whose next drive moves."""
        ...

    def resume(self, sources: Collection[str]) -> None:
        """The drivers of these sources know of the stop and ask anew: nothing holds them any longer."""
        ...

    def estop(self, reason: str) -> None:
        """Stop the motors at once, and until armed again."""
        ...

    def arm(self, latch: int | None = None) -> None:
        """Allow motion, if nothing has latched after this number."""
        ...


class DrivingMethods:
    """``sources`` are the configured ones; a velocity command that names none is one of ``default_source``."""

    def __init__(
        self,
        robot: Robot,
        leases: "ControlLeases",
        clock: "Clock",
        *,
        sources: tuple[str, ...],
        default_source: str,
    ) -> None:
        self._robot, self._leases, self._clock = robot, leases, clock
        self._sources, self._default_source = sources, default_source
        self._contenders = Contenders(leases)

    @method(role=Role.DRIVE, moves=True)
    def drive(self, caller: Caller, params: DriveParams) -> Driven:
        """Drive at this velocity until the command is replaced or too old; repeat it to keep moving.

        It is too old after the dead-man time (0.5 s, KHAN 0.25 s). Without ``source`` it is one of the robot's default
        source. The answer is what the limits allow of it.
        """
        now_s, source = self._clock.now_s(), params.source or self._default_source
        self._require_control(source, caller, now_s)
        allowed = self._robot.drive(source, Twist2D(params.linear_m_s, params.angular_rad_s))
        self._leases.renew(source, caller.session, now_s)
        twist = allowed.command
        return Driven(
            linear_m_s=twist.linear_m_s, angular_rad_s=twist.angular_rad_s, limited_by=allowed.limited_by
        )

    def _require_control(self, source: str, caller: Caller, now_s: float) -> None:
        if source in self._sources:  # the robot refuses any other
            self._contenders.note_attempt(source, caller.session, now_s)
            self._leases.require(source, caller.session, now_s)

    @method(role=Role.DRIVE, moves=True)
    def set_wheel_velocities(self, caller: Caller, params: SetWheelVelocitiesParams) -> WheelsDriven:
        """Set the speed of each wheel, with the rules of ``drive``; wheels that are not named stand still."""
        now_s, source = self._clock.now_s(), params.source or self._default_source
        self._require_control(source, caller, now_s)
        allowed = self._robot.set_wheel_velocities(source, params.by_name())
        self._leases.renew(source, caller.session, now_s)
        speeds = [allowed.command[name] for name in params.name]
        return WheelsDriven(name=params.name, velocity_rad_s=speeds, limited_by=allowed.limited_by)

    @method(role=Role.OBSERVE, urgent=True, when_crowded=True)
    def stop(self, caller: Caller, params: StopParams) -> Stopped:
        """Come to rest within the deceleration limit; sources that others drive are held until they let go."""
        now_s, by = self._clock.now_s(), str(caller.session)
        drivers = self._leases.drivers(now_s)
        self._robot.stop(by, self._leases.tried(caller.session))
        self._contenders.stop(caller.session, by, now_s)
        return Stopped(drivers=drivers)

    @method(role=Role.OBSERVE, urgent=True, when_crowded=True)
    def estop(self, caller: Caller, params: EstopParams) -> Stopped:
        """Stop the motors at once, and until armed again."""
        now_s = self._clock.now_s()
        drivers = self._leases.drivers(now_s)
        self._robot.estop(params.reason)
        self._contenders.estop(now_s)
        return Stopped(drivers=drivers)

    @method(role=Role.DRIVE, moves=True)
    def arm(self, caller: Caller, params: ArmParams) -> Done:
        """Allow motion after an emergency stop or a fault; with ``latch``, only if that one is the newest."""
        self._robot.arm(params.latch)
        self._robot.resume(self._leases.tried(caller.session))
        self._contenders.arm(caller.session)
        return DONE


def methods(handlers: DrivingMethods, arm_role: Role) -> tuple[Method, ...]:
    """The methods of this feature; who may ``arm`` is configured."""
    return tuple(
        replace(each, role=arm_role) if each.name == "arm" else each for each in methods_of(handlers)
    )


class WheelsData(TopicData):
    """A joint state after a control step, all lists in the order of the configured wheels."""

    name: tuple[str, ...]
    position_rad: tuple[float, ...]
    velocity_rad_s: tuple[float, ...]
    target_rad_s: tuple[float, ...]
    duty: tuple[int, ...]
    excluded: tuple[str, ...] = Field(
        (), description="wheels that disagree with the others of their side; odometry excludes them"
    )


class SafetyData(TopicData):
    """The gate: its mode and why, which source's command is in force, whether the robot may move, and who drives."""

    mode: str
    reason: str
    source: str | None
    armed: bool
    control: dict[str, str] = Field(
        description="for each source that someone has control of, the client's name"
    )
    fault: str | None = Field(None, description="name of the latched fault; names never change")
    limited_by: str | None = Field(None, description="what keeps the command from being followed as given")
    latch: int = Field(
        0,
        description="number of the last emergency stop or fault, which no other start of the daemon has; for arm",
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


class SafetyState(Record, frozen=True):
    """What the gate last said (None: nothing yet), and who drives."""

    gate: events.SafetyChanged | None = None
    holders: Mapping[str, str] = {}


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
        reason = "the safety state is not known yet"
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
    )


def topics(wheel_names: tuple[str, ...]) -> tuple[Topic, ...]:
    """The topics ``wheels`` and ``safety``; ``wheel_names`` is the order of the tuples in ``WheelsDriven``."""
    gate = (events.SafetyChanged, events.ControlChanged)
    return (
        Topic("wheels", (events.WheelsDriven,), WheelsData, partial(_wheels, wheel_names)),
        Topic("safety", gate, SafetyData, safety_data, join=_join_safety, always_known=True),
    )
