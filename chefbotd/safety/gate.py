"""The final decision on every command: whether the robot may move, and which command is in force.

Three modes. ``ARMED``: the highest live command is followed. ``DISARMED``: a fault has latched. ``ESTOPPED``: someone
pressed stop in earnest. The latter two brake at once and end only with ``arm``.

Two times end a command, as a multiplexer's and a drive controller's do in a classic stack. Its source's ``timeout_s`` is
for how long it is live, which keeps lower sources out; the dead-man's ``command_timeout_s`` is for how long any command
moves the robot. So a command moves it until the first of the two. If that is the dead-man's, the robot brakes, and no
lower source drives before ``timeout_s``; if it is the source's, the highest one that is still live takes over at once,
through the motion limits, and without one the robot brakes. That a silent driver is why it brakes is told until the
second of the two has passed. What feeds either time is commands, never a heartbeat.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Self, TypeGuard

from pydantic import Field, model_validator

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import STANDING, Motion, WheelVelocities
from chefbotd.core.parameters import Parameters, section
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence
from chefbotd.safety.battery_monitor import BatteryMonitorParameters
from chefbotd.safety.echo import EchoParameters
from chefbotd.safety.encoder_timeout import EncoderTimeoutParameters
from chefbotd.safety.faults import RECOVERABLE, UNSTOPPED, FaultKind
from chefbotd.safety.guard import GuardParameters
from chefbotd.safety.off_target import OffTargetParameters
from chefbotd.safety.overspeed import OverspeedParameters
from chefbotd.safety.unresponsive import UnresponsiveParameters
from chefbotd.safety.wheels import WheelWatchParameters


class SourceParameters(Parameters):
    """One source of velocity commands: 0 (weakest) to 255, and for how long its last command is live."""

    priority: int = Field(ge=0, le=255)
    """From 0 (weakest) to 255: the strongest source that is live drives."""
    timeout_s: float = Field(gt=0, le=10)
    """For how long a source's last command keeps weaker ones out."""


CALIBRATION = "calibration"
"""The source of the robot's own calibration, which no client can drive as, and the only one that may drive by duties."""

PUBLISHED_SOURCES = {
    "safety": SourceParameters(priority=10, timeout_s=0.2),
    "teleop": SourceParameters(priority=7, timeout_s=1.0),
    CALIBRATION: SourceParameters(priority=6, timeout_s=0.5),
    "navigation": SourceParameters(priority=5, timeout_s=1.0),
}
"""The velocity arbitration of the published ChefBot, and between people and navigation the calibration."""


class Rearm(StrEnum):
    """How a fault that has passed is left: only by ``arm``, or by itself. An e-stop is always left by ``arm``."""

    MANUAL = "manual"
    AUTO = "auto"


class SafetyParameters(Parameters):
    """``command_timeout_s`` is the dead-man: no command of any source moves the robot for longer.

    A command that names no source counts as one of ``default_source``. A source that a stop holds is free when no
    command has come from it for ``stop_hold_s``, or for the dead-man's time if that is longer.
    """

    command_timeout_s: float = Field(default=0.5, ge=0.1, le=2.0)
    """The dead-man: no command of any source moves the robot for longer."""
    stop_hold_s: float = Field(default=1.0, ge=0.1, le=60.0)
    """Who was stopped while driving must not drive for so long before it may again."""
    rearm: Rearm = Rearm.MANUAL
    """Whether the robot may move by itself after a lost link or a restarted board: ``manual`` asks for
    ``arm``."""
    sources: Annotated[Mapping[str, SourceParameters], Field(min_length=1)] = PUBLISHED_SOURCES
    default_source: str = "teleop"
    """The source that a command counts as which names none."""
    encoders: EncoderTimeoutParameters = section()
    wheels: WheelWatchParameters = section()
    overspeed: OverspeedParameters = section()
    off_target: OffTargetParameters = section()
    unresponsive: UnresponsiveParameters = section()
    echo: EchoParameters = section()
    battery: BatteryMonitorParameters = section()
    guard: GuardParameters = section()

    @property
    def held_until_silent_s(self) -> float:
        """For how long a held source must be silent: a driver may repeat its command as rarely as the dead-man lets."""
        return max(self.stop_hold_s, self.command_timeout_s)

    @property
    def offered(self) -> tuple[str, ...]:
        """The sources that clients may drive as."""
        return tuple(name for name in self.sources if name != CALIBRATION)

    def above(self, source: str) -> tuple[str, ...]:
        """The sources that take over from this one."""
        own = self.sources[source].priority
        return tuple(name for name, parameters in self.sources.items() if parameters.priority > own)

    @model_validator(mode="after")
    def _has_its_default(self) -> Self:
        if self.default_source not in self.offered:
            names = ", ".join(self.offered)
            raise ValueError(f"default_source must be one of {names}, got {self.default_source!r}")
        return self


class Mode(StrEnum):
    """Whether the robot may move."""

    ARMED = "armed"
    DISARMED = "disarmed"
    ESTOPPED = "estopped"


class Trigger(StrEnum):
    """What changes the mode."""

    ARM = "arm"
    ESTOP = "estop"
    FAULT = "fault"
    RECOVERY = "recovery"


NEXT: Mapping[tuple[Mode, Trigger], Mode] = {
    (Mode.ARMED, Trigger.ARM): Mode.ARMED,
    (Mode.ARMED, Trigger.ESTOP): Mode.ESTOPPED,
    (Mode.ARMED, Trigger.FAULT): Mode.DISARMED,
    (Mode.ARMED, Trigger.RECOVERY): Mode.ARMED,
    (Mode.DISARMED, Trigger.ARM): Mode.ARMED,
    (Mode.DISARMED, Trigger.ESTOP): Mode.ESTOPPED,
    (Mode.DISARMED, Trigger.FAULT): Mode.DISARMED,
    (Mode.DISARMED, Trigger.RECOVERY): Mode.ARMED,
    (Mode.ESTOPPED, Trigger.ARM): Mode.ARMED,
    (Mode.ESTOPPED, Trigger.ESTOP): Mode.ESTOPPED,
    (Mode.ESTOPPED, Trigger.FAULT): Mode.ESTOPPED,
    (Mode.ESTOPPED, Trigger.RECOVERY): Mode.ESTOPPED,
}


class Command(Record, frozen=True):
    """A motion that a source asked for, and when."""

    source: str
    motion: Motion
    stamp_s: float


class GateState(Record, frozen=True):
    """The mode, the reason for it (``fault``: the fault that latched), and the newest command of each source."""

    mode: Mode = Mode.ARMED
    reason: str = Sentence("driving.started", "started")
    commands: tuple[Command, ...] = ()
    fault: FaultKind | None = None


class Decision(Record, frozen=True):
    """The motion to follow, and its source; ``halted`` means brake now, whatever the motion.

    ``limited_by`` says why a live command is not followed as it was given.
    """

    motion: Motion
    source: str | None
    halted: bool
    limited_by: str | None = None


HALT = Decision(STANDING, None, halted=True)
COME_TO_REST = Decision(STANDING, None, halted=False)

DEAD_MAN = "dead_man"
"""What limits a command that is too old to be followed, until it is past its source's time-out as well."""


def why_not_armed(mode: str, reason: str) -> str:
    """The mode of a robot that may not move, for people; one that waits for its board has only the reason."""
    if mode == Mode.ESTOPPED:
        return Sentence("driving.is_estopped", "the emergency stop is on ({reason})", reason=reason)
    if mode == Mode.DISARMED:
        return Sentence("driving.is_disarmed", "the robot is stopped ({reason})", reason=reason)
    return reason


def not_armed(mode: str, reason: str) -> Refused:
    """The refusal of a motion that was asked for meanwhile."""
    kind = RefusalKind.ESTOPPED if mode == Mode.ESTOPPED else RefusalKind.DISARMED
    if mode not in (Mode.ESTOPPED, Mode.DISARMED):
        return Refused(kind, reason)
    if mode == Mode.ESTOPPED:
        why = Sentence(
            "driving.estopped", "the emergency stop is on ({reason}); arm the robot first", reason=reason
        )
    else:
        why = Sentence(
            "driving.disarmed", "the robot is stopped ({reason}); arm the robot first", reason=reason
        )
    return Refused(kind, why)


def is_by_duty(motion: Motion) -> TypeGuard[WheelVelocities]:
    """Whether this motion drives the motors by duties, without a controller."""
    return isinstance(motion, WheelVelocities) and motion.duty is not None


def accept(parameters: SafetyParameters, state: GateState, command: Command) -> GateState:
    """Take a command into account.

    Raises:
        Refused: its source is not configured, or the robot is not armed; nothing changes.
        ValueError: it has duties, and its source is not the calibration.
    """
    if command.source not in parameters.sources:
        names = ", ".join(sorted(parameters.offered))
        raise Refused(
            RefusalKind.UNKNOWN_SOURCE,
            Sentence(
                "driving.unknown_source_of_command",
                "no source named {source!r}; there are {others}",
                source=command.source,
                others=names,
            ),
        )
    if is_by_duty(command.motion) and command.source != CALIBRATION:
        raise ValueError(f"only the source {CALIBRATION!r} may drive by duties, got {command.source!r}")
    if state.mode is not Mode.ARMED:
        raise not_armed(state.mode, state.reason)
    return replace(state, commands=(*release(state, command.source).commands, command))


def renew(parameters: SafetyParameters, state: GateState, command: Command) -> GateState | None:
    """The same command again, while the one before still moves the robot: it holds for longer. None: it is not so."""
    if state.mode is not Mode.ARMED:
        return None
    for given in state.commands:
        if given.source == command.source:
            age_s = command.stamp_s - given.stamp_s
            is_live = (
                age_s <= parameters.command_timeout_s and age_s <= parameters.sources[given.source].timeout_s
            )
            if not is_live or given.motion != command.motion:
                return None
            others = release(state, command.source).commands if len(state.commands) > 1 else ()
            return GateState(state.mode, state.reason, (*others, command), state.fault)
    return None


def release(state: GateState, source: str) -> GateState:
    """Forget the command of a source as if there had been none: lower sources go on at once."""
    return replace(state, commands=tuple(c for c in state.commands if c.source != source))


def stop(state: GateState) -> GateState:
    """Forget every command: the robot comes to rest within its deceleration limit. Nothing latches."""
    return replace(state, commands=())


def change_mode(state: GateState, trigger: Trigger, reason: str, fault: FaultKind | None = None) -> GateState:
    """Apply a trigger; for a fault with its kind.

    A change of mode forgets every command. A fault or a recovery that changes nothing keeps the reason, so that the
    first of several faults is the one that is reported. Two exceptions: a fault that needs a person replaces one that
    recovers by itself, and one of ``UNSTOPPED`` replaces every other, and the reason of an e-stop. Only a
    ``RECOVERABLE`` fault recovers.
    """
    mode = NEXT[state.mode, trigger]
    if fault in UNSTOPPED and state.mode is not Mode.ARMED:
        if state.fault is fault:
            return state
        both = Sentence(
            "driving.stopped_before",
            "{reason} ({mode} before that: {before})",
            reason=reason,
            mode=str(state.mode),
            before=state.reason,
        )
        return GateState(mode, both, fault=fault)
    if (
        mode is Mode.DISARMED
        and state.fault in RECOVERABLE
        and fault is not None
        and fault not in RECOVERABLE
    ):
        return GateState(mode, reason, fault=fault)
    if mode is state.mode and trigger is not Trigger.ESTOP:
        return state
    if trigger is Trigger.RECOVERY and state.fault not in RECOVERABLE:
        return state
    return GateState(mode, reason, fault=fault)


def decide(parameters: SafetyParameters, state: GateState, now_s: float) -> Decision:
    """The highest live command wins; of two with the same priority, the newer. One past the dead-man moves nothing.

    Without a live one, a command whose source has timed out before the dead-man did is what the robot brakes for.
    """
    if state.mode is not Mode.ARMED:
        return HALT
    if len(state.commands) == 1:
        (command,) = state.commands
        age_s = now_s - command.stamp_s
        if age_s <= parameters.command_timeout_s and age_s <= parameters.sources[command.source].timeout_s:
            return Decision(command.motion, command.source, halted=False)
    winner: Command | None = None
    rank = (False, -1, 0.0)
    for command in state.commands:
        source, age_s = parameters.sources[command.source], now_s - command.stamp_s
        if age_s > source.timeout_s and age_s > parameters.command_timeout_s:
            continue
        candidate = (age_s <= source.timeout_s, source.priority, command.stamp_s)
        if winner is None or candidate > rank:
            winner, rank = command, candidate
    if winner is None:
        return COME_TO_REST
    if not rank[0] or now_s - winner.stamp_s > parameters.command_timeout_s:
        return Decision(STANDING, winner.source, halted=False, limited_by=DEAD_MAN)
    return Decision(winner.motion, winner.source, halted=False)
