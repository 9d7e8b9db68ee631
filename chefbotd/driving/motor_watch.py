"""Compares the wheels' motion with their commands: stuck, backwards, too fast, or moving although told to stand."""

from collections.abc import Callable, Iterable, Iterator
from operator import add

from msgspec import field

from chefbotd.core.events import DutyEchoed, EncodersCounted
from chefbotd.core.geometry import Motion, Twist2D
from chefbotd.core.record import MutableState, Record, StatefulPart, replace
from chefbotd.core.sentence import Sentence
from chefbotd.driving.wheel_reader import WheelsRead
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.safety import commands_lost, echo, off_target, overspeed, unresponsive, wheels
from chefbotd.safety.commands_lost import BoardSays
from chefbotd.safety.echo import EchoState
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.gate import SafetyParameters
from chefbotd.safety.in_force import InForce, WrittenCommand
from chefbotd.safety.unresponsive import UnresponsiveState

ECHO_AGE_S = 1.5
"""An older echo does not show the present duty; the sketch's cycle lasts a second at most."""

Credit = Callable[[WheelsRead, tuple[float, ...]], tuple[float, ...]]
"""The effort of each wheel, with that of its substitute where a wheel is not believed (``WheelReader.effort``)."""

PAUSE_S = 0.25
"""A control loop that has not run for this long was blocked, or the whole program was frozen."""

LATE_READINGS_S = 1.0
"""After a pause, readings may be older than the commands for this long."""


JUDGED_S = 0.035
"""Driven wheels are judged by what they did in so long or in one reading, whichever is longer.

All that is judged adds up, so a fault is found as before, but for up to this much later.
"""

OFF_TARGET_PERIOD_S = 0.25
"""How often it is looked at whether wheels are off their target; a reading alone tells little of that."""


SETTLING_READINGS = 3
"""The wheel loop needs so many to bring a wheel to another speed; a board that waits for echoes gives one a second."""

LEVEL_M_S = 0.01
"""Wheels that are asked for speeds no farther apart than this do not drag each other."""


class SteadyWheels(Record, frozen=True):
    """Since when the same speeds have been asked for, where the wheels were then, and how many readings were before."""

    asked_m_s: tuple[float, ...] = ()
    since_s: float = float("-inf")
    position_rad: tuple[float, ...] = ()
    readings: int = 0


class Unjudged(Record, frozen=True):
    """How far each wheel turned, and in how long, since the wheels were judged last."""

    travel_rad: tuple[float, ...] = ()
    dt_s: float = 0.0


NOTHING_UNJUDGED = Unjudged()


class MotorWatchState(MutableState):
    """The detectors' states, when the control loop last ran, until when readings may be old, and the commands.

    ``pushed`` is the effort of the newest command when the wheels were judged last.
    """

    wheels: wheels.WheelWatchState
    overspeed: tuple[overspeed.Excess, ...]
    pace: tuple[off_target.Pace, ...]
    unresponsive: UnresponsiveState = unresponsive.DRIVEN
    echo: EchoState = echo.UNKNOWN
    ran_s: float = float("-inf")
    blind_until_s: float = float("-inf")
    in_force: InForce = field(default_factory=InForce)
    steady: SteadyWheels = SteadyWheels()
    warning: str = ""
    board_says: BoardSays = BoardSays()
    lost_s: float = 0.0
    unjudged: Unjudged = NOTHING_UNJUDGED
    pushed: tuple[float, ...] = ()


class MotorWatch(StatefulPart[MotorWatchState]):
    """Runs the detectors, and keeps their states.

    Each of them asks ``in_force`` which commands the board can have obeyed while a reading was taken.
    """

    def __init__(
        self,
        parameters: SafetyParameters,
        chassis: ChassisParameters,
        counts_per_turn: float,
        free_m_s: float = 1.0,
    ) -> None:
        self._parameters, self.kinematics = parameters, Kinematics(chassis)
        self._play_rad = wheels.play_of(counts_per_turn)
        self._names = tuple(wheel.name for wheel in chassis.wheels)
        self._dragged = len(self._names) > 2
        self._counts_per_turn, self._free_m_s = counts_per_turn, free_m_s
        count = len(self._names)
        self.memory = MotorWatchState(
            wheels.at_rest(count), overspeed.at_rest(count), off_target.at_rest(count)
        )

    @property
    def in_force(self) -> InForce:
        """Which commands the board can have had in force."""
        return self.memory.in_force

    @property
    def warning(self) -> str:
        """What is odd about the wheels' speeds, for people; empty where nothing is."""
        return self.memory.warning

    def loop_runs(self, now_s: float) -> bool:
        """The control loop runs; returns whether it had paused.

        After a pause, the readings that waited on the line do not show the present commands.
        """
        paused, self.memory.ran_s = now_s - self.memory.ran_s > PAUSE_S, now_s
        if paused:
            self.memory.blind_until_s = now_s + LATE_READINGS_S
        return paused

    def slowed(self, motion: Motion, rim_m_s: float) -> Motion:
        """The same motion, with no rim faster than this."""
        if isinstance(motion, Twist2D):
            return self.kinematics.saturate(motion, rim_m_s)
        fastest_m_s = max(map(abs, self.kinematics.rims_at_m_s(motion.rad_s)))
        return motion if fastest_m_s <= rim_m_s else motion.slowed(rim_m_s / fastest_m_s)

    def start_anew(self) -> None:
        """The robot is armed: forget all suspicion."""
        self.memory.wheels = wheels.at_rest(len(self._names))
        self.memory.lost_s = 0.0
        self._forget_motion()

    def _forget_motion(self) -> None:
        self.memory.unjudged, self.memory.pushed = NOTHING_UNJUDGED, ()
        self.memory.overspeed = overspeed.at_rest(len(self._names))
        self.memory.unresponsive = unresponsive.DRIVEN

    def connected(self) -> None:
        """A board was connected: its echo must be confirmed again."""
        self.memory.echo = echo.UNKNOWN
        self.memory.in_force = InForce()
        self.memory.board_says, self.memory.lost_s = BoardSays(), 0.0
        self._forget_motion()

    def note_jump(self, jumped: tuple[int, ...]) -> Fault | None:
        """An encoder reading was refused because of these wheels."""
        missing = ("time ('t' lines)",) if not self.in_force.has_clock else ()
        if not self.memory.echo.shown:
            missing = (*missing, "echo of its duty ('s' lines)")
        self.memory.wheels, fault = wheels.note_jump(
            self._parameters.wheels, self._names, self.memory.wheels, jumped, missing
        )
        return fault

    def note_command(self, command: WrittenCommand, *, is_held_back: bool = False) -> None:
        """A command goes to the board; ``is_held_back``: it may still wait on this side of the wire."""
        self.note_repeated(command.since_s, command.duty, is_held_back=is_held_back)
        self.memory.in_force.note_command(command, is_held_back=is_held_back)

    def note_repeated(self, now_s: float, duty: tuple[int, ...], *, is_held_back: bool = False) -> None:
        """The newest command goes to the board again, or another one does, which is noted after this."""
        memory, is_driven = self.memory, any(duty)
        if not is_driven or memory.unresponsive is not unresponsive.DRIVEN:
            memory.unresponsive = unresponsive.record_command(memory.unresponsive, now_s, driven=is_driven)
        memory.echo = echo.note_command(memory.echo, now_s, duty)
        memory.in_force.note_way(is_held_back=is_held_back)

    def note_board(self, says: BoardSays) -> None:
        """What a board with our firmware says of itself."""
        self.memory.board_says = says

    def note_line(self, event: EncodersCounted) -> None:
        """An encoder line has come, whether or not it is believed."""
        has_clock = event.stamp_s not in (event.board_s, event.arrival_s)
        self.memory.in_force.note_line(event.stamp_s, event.arrival_s, has_clock=has_clock)

    def note_echo(self, event: DutyEchoed) -> Fault | None:
        """Take an echo. One that may have waited on the line is not judged."""
        memory, parameters, duty = self.memory, self._parameters.echo, event.duty
        if event.arrival_s < memory.blind_until_s:
            return None
        memory.echo, fault = echo.note_echo(parameters, memory.echo, event.arrival_s, duty)
        if memory.echo.fitting >= parameters.min_confirmations:
            memory.in_force.note_echo(event.stamp_s, duty)
        return fault

    def watch(self, now_s: float, seen: WheelsRead, credit: Credit) -> Iterable[Fault]:
        """A good reading. ``credit`` gives wheels that are not believed the effort of those that stand in for them.

        What the wheels did in a pause without readings is unknown; the pause counts as ``max_age_s`` at most. Readings
        that come fast are judged together, but not of a robot that must stand, where the push turns round, or while
        readings are refused, of which each good one takes off a part.
        """
        memory = self.memory
        before, commands = memory.unjudged, memory.in_force.commands
        if not commands:  # nothing has been said to this board yet
            return ()
        travel_rad, dt_s, effort = seen.reading.travel_rad, seen.dt_s, commands[0].effort
        if before.travel_rad:
            travel_rad, dt_s = tuple(map(add, before.travel_rad, travel_rad)), before.dt_s + dt_s
        is_driven = memory.unresponsive.told_s is None and now_s >= memory.blind_until_s
        is_believed = not any(memory.wheels.jumps)
        if dt_s < JUDGED_S and is_driven and is_believed and not _turn_round(effort, memory.pushed):
            memory.unjudged = Unjudged(travel_rad, dt_s)
            return ()
        memory.unjudged, memory.pushed = NOTHING_UNJUDGED, effort
        if travel_rad is not seen.reading.travel_rad:
            seen = WheelsRead(replace(seen.reading, travel_rad=travel_rad), dt_s, seen.same_side)
        return self._judge(now_s, seen, credit)

    def _judge(self, now_s: float, seen: WheelsRead, credit: Credit) -> Iterator[Fault]:
        envelope = self.in_force.over_reading()
        if envelope is None:
            return
        effort = credit(seen, envelope.effort) if seen.same_side.substitutes else envelope.effort
        longest_s = self._parameters.encoders.max_age_s
        dt_s = seen.dt_s if seen.dt_s < longest_s else longest_s
        if self.memory.board_says.dead_man:  # the motors are off, whatever was written
            effort = (0.0,) * len(effort)
        if self.memory.board_says.dead_man or self.memory.lost_s:
            yield from self._watch_line(now_s, dt_s)
        self.memory.wheels, fault = wheels.watch(
            self._parameters.wheels,
            self._names,
            self.memory.wheels,
            effort,
            seen.reading.travel_rad,
            dt_s,
            self._play_rad,
            envelope.may_turn_round,
        )
        if fault is not None:
            yield self._blame_line(now_s, fault)
        yield from self._watch_motion(now_s, envelope.asked_m_s, seen)
        if not envelope.is_steady or self.memory.board_says.dead_man:
            self.memory.steady = SteadyWheels()
        elif envelope.asked_m_s != self.memory.steady.asked_m_s:
            position_rad = seen.reading.position_rad
            self.memory.steady = SteadyWheels(envelope.asked_m_s, self.in_force.taken_s, position_rad)
        elif self.memory.steady.readings < SETTLING_READINGS:
            readings, position_rad = self.memory.steady.readings + 1, seen.reading.position_rad
            self.memory.steady = SteadyWheels(
                envelope.asked_m_s, self.in_force.taken_s, position_rad, readings
            )
        elif self.in_force.taken_s - self.memory.steady.since_s >= OFF_TARGET_PERIOD_S:
            self._watch_pace(effort, seen)

    def _watch_line(self, now_s: float, dt_s: float) -> Iterator[Fault]:
        """Whether commands reach a board that says when its dead-man stops."""
        if now_s < self.memory.blind_until_s:
            return
        driven = any(self.in_force.commands[0].duty)
        self.memory.lost_s, fault = commands_lost.watch(
            self.memory.lost_s, self.memory.board_says, dt_s, driven=driven
        )
        if fault is not None:
            yield fault

    def _blame_line(self, now_s: float, fault: Fault) -> Fault:
        """A wheel's fault, or the line's where the wheel stands as the board says that it is told to."""
        if fault.kind is not FaultKind.WHEEL_STALLED or self.memory.board_says.dead_man:
            return fault
        sent = self.in_force.commands[0].duty
        is_fresh = now_s - self.memory.echo.shown_s <= ECHO_AGE_S
        if any(sent) and is_fresh and echo.says_no_motor(self.memory.echo):
            return commands_lost.explain_unheard(fault, self.memory.echo.shown, sent)
        if not self.memory.echo.shown:
            reason = Sentence(
                "driving.wheel_stalled_without_echo",
                "{why}. This board sends no 's' lines, so nothing shows whether commands reach it: check its cable, too",
                why=fault.reason,
            )
            return Fault(fault.kind, reason)
        return fault

    def _watch_pace(self, effort: tuple[float, ...], seen: WheelsRead) -> None:
        """Whether wheels that are asked for a steady speed have it; wheels that drag each other are not judged."""
        steady, position_rad = self.memory.steady, seen.reading.position_rad
        turned_rad = tuple(
            [now - before for now, before in zip(position_rad, steady.position_rad, strict=True)]
        )
        self.memory.steady = SteadyWheels(
            steady.asked_m_s, self.in_force.taken_s, position_rad, SETTLING_READINGS
        )
        if self._dragged and max(steady.asked_m_s) - min(steady.asked_m_s) > LEVEL_M_S:
            return
        parameters, dt_s = self._parameters.off_target, self.in_force.taken_s - steady.since_s
        travel_m = self.kinematics.rims_at_m_s(turned_rad)
        self.memory.pace = off_target.watch(
            parameters, self.memory.pace, steady.asked_m_s, effort, travel_m, dt_s, self._free_m_s
        )
        sentence = off_target.sentence(
            parameters, self._names, self.memory.pace, self._free_m_s, self._counts_per_turn
        )
        if bool(sentence) is not bool(self.warning):
            self.memory.warning = sentence

    def _watch_motion(self, now_s: float, asked_m_s: tuple[float, ...], seen: WheelsRead) -> Iterator[Fault]:
        """Whether the robot is too fast, or moves although it must stand; None if neither can be decided."""
        if now_s < self.memory.blind_until_s:
            self.memory.overspeed = overspeed.at_rest(len(self._names))
            self.memory.unresponsive = unresponsive.record_command(
                unresponsive.DRIVEN, now_s, driven=self.memory.unresponsive.told_s is None
            )
            return
        travel_m = self.kinematics.rims_at_m_s(seen.reading.travel_rad)
        if self._dragged:  # the others may drag a wheel along at their speed
            asked_m_s = (max(map(abs, asked_m_s)),) * len(asked_m_s)
        self.memory.overspeed, fault = overspeed.watch(
            self._parameters.overspeed,
            self._names,
            self.memory.overspeed,
            asked_m_s,
            travel_m,
            seen.dt_s,
            seen.same_side.excluded,
        )
        if fault is not None:
            yield fault
        if self.memory.unresponsive.told_s is None:  # it is driven
            return
        self.memory.unresponsive, fault = unresponsive.watch(
            self._parameters.unresponsive,
            self.memory.unresponsive,
            self.in_force.taken_s,
            travel_m,
            self.kinematics.rims_at_m_s(seen.reading.velocity_rad_s),
            seen.dt_s,
            echoes_motion=self._echoes_motion(now_s),
        )
        if fault is not None:
            yield fault

    def _echoes_motion(self, now_s: float) -> bool:
        state = self.memory.echo
        is_fresh = now_s - state.shown_s <= ECHO_AGE_S
        return is_fresh and any(state.shown) and echo.is_believed(self._parameters.echo, state)


def _turn_round(effort: tuple[float, ...], before: tuple[float, ...]) -> bool:
    """Whether a wheel is pushed the other way than before, or nothing is known of before."""
    for push, push_before in zip(effort, before, strict=False):
        if push * push_before < 0:
            return True
    return not before
