"""Compares the wheels' motion with their commands: stuck, backwards, too fast, or moving although told to stand."""

from collections.abc import Callable, Iterator

from msgspec import field

from chefbotd.core.events import DutyEchoed, EncodersCounted
from chefbotd.core.geometry import Motion, Twist2D
from chefbotd.core.record import Record
from chefbotd.driving.wheel_reader import WheelsRead
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.safety import commands_lost, echo, off_target, overspeed, unresponsive, wheels
from chefbotd.safety.commands_lost import BoardSays
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.gate import SafetyParameters
from chefbotd.safety.in_force import Command, InForce

ECHO_AGE_S = 1.5
"""An older echo does not show the present duty; the sketch's cycle lasts a second at most."""

Credit = Callable[[WheelsRead, tuple[float, ...]], tuple[float, ...]]
"""The effort of each wheel, with that of its substitute where a wheel is not believed (``WheelReader.effort``)."""

PAUSE_S = 0.25
"""A control loop that has not run for this long was blocked, or the whole program was frozen."""

LATE_READINGS_S = 1.0
"""After a pause, readings may be older than the commands for this long."""


OFF_TARGET_PERIOD_S = 0.25
"""How often it is looked at whether wheels are off their target; a reading alone tells little of that."""


SETTLING_READINGS = 3
"""The wheel loop needs so many to bring a wheel to another speed; a board that waits for echoes gives one a second."""

NO_ECHO = ". This board sends no 's' lines, so nothing shows whether commands reach it: check its cable, too"
"""What is added where a wheel stands and its board does not say what it obeys."""

LEVEL_M_S = 0.01
"""Wheels that are asked for speeds no farther apart than this do not drag each other."""


class SteadyWheels(Record, frozen=True):
    """Since when the same speeds have been asked for, where the wheels were then, and how many readings were before."""

    asked_m_s: tuple[float, ...] = ()
    since_s: float = float("-inf")
    position_rad: tuple[float, ...] = ()
    readings: int = 0


class MotorWatchState(Record, frozen=True):
    """The detectors' states, when the control loop last ran, until when readings may be old, and the commands."""

    wheels: wheels.WheelWatchState
    overspeed: tuple[overspeed.Excess, ...]
    unresponsive: unresponsive.UnresponsiveState
    echo: echo.EchoState
    ran_s: float
    blind_until_s: float
    in_force: InForce = field(default_factory=InForce)
    pace: tuple[off_target.Pace, ...] = ()
    steady: SteadyWheels = field(default_factory=SteadyWheels)
    warning: str = ""
    board_says: BoardSays = BoardSays()
    lost_s: float = 0.0


class MotorWatch:
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
        self._echo = echo.UNKNOWN
        self.in_force = InForce()
        self._counts_per_turn, self._free_m_s = counts_per_turn, free_m_s
        self._pace, self._steady, self.warning = off_target.at_rest(len(self._names)), SteadyWheels(), ""
        self._blind_until_s = self._ran_s = float("-inf")
        self._board_says, self._lost_s = BoardSays(), 0.0
        self.start_anew()

    def state(self) -> MotorWatchState:
        """Return the state of this part."""
        judged = self._wheels, self._overspeed, self._unresponsive, self._echo
        pace, line = (self._pace, self._steady, self.warning), (self._board_says, self._lost_s)
        return MotorWatchState(*judged, self._ran_s, self._blind_until_s, self.in_force, *pace, *line)

    def restore(self, state: MotorWatchState) -> None:
        """Restore this state."""
        self._wheels, self._overspeed = state.wheels, state.overspeed
        self._unresponsive, self._echo = state.unresponsive, state.echo
        self._ran_s, self._blind_until_s = state.ran_s, state.blind_until_s
        self.in_force, self.warning = state.in_force, state.warning
        self._pace, self._steady = state.pace or self._pace, state.steady
        self._board_says, self._lost_s = state.board_says, state.lost_s

    def loop_runs(self, now_s: float) -> bool:
        """The control loop runs; returns whether it had paused.

        After a pause, the readings that waited on the line do not show the present commands.
        """
        paused, self._ran_s = now_s - self._ran_s > PAUSE_S, now_s
        if paused:
            self._blind_until_s = now_s + LATE_READINGS_S
        return paused

    def slowed(self, motion: Motion, rim_m_s: float) -> Motion:
        """The same motion, with no rim faster than this."""
        if isinstance(motion, Twist2D):
            return self.kinematics.saturate(motion, rim_m_s)
        fastest_m_s = max(map(abs, self.kinematics.rims_at_m_s(motion.rad_s)))
        return motion if fastest_m_s <= rim_m_s else motion.slowed(rim_m_s / fastest_m_s)

    def start_anew(self) -> None:
        """The robot is armed: forget all suspicion."""
        self._wheels = wheels.at_rest(len(self._names))
        self._lost_s = 0.0
        self._forget_motion()

    def _forget_motion(self) -> None:
        self._overspeed = overspeed.at_rest(len(self._names))
        self._unresponsive = unresponsive.DRIVEN

    def connected(self) -> None:
        """A board was connected: its echo must be confirmed again."""
        self._echo = echo.UNKNOWN
        self.in_force = InForce()
        self._board_says, self._lost_s = BoardSays(), 0.0
        self._forget_motion()

    def note_jump(self, jumped: tuple[int, ...]) -> Fault | None:
        """An encoder reading was refused because of these wheels."""
        missing = ("time ('t' lines)",) if not self.in_force.has_clock else ()
        if not self._echo.shown:
            missing = (*missing, "echo of its duty ('s' lines)")
        self._wheels, fault = wheels.note_jump(
            self._parameters.wheels, self._names, self._wheels, jumped, missing
        )
        return fault

    def note_command(self, command: Command, *, is_held_back: bool = False) -> None:
        """A command goes to the board; ``is_held_back``: it may still wait on this side of the wire."""
        now_s, duty = command.since_s, command.duty
        is_driven = any(duty)
        if not is_driven or self._unresponsive is not unresponsive.DRIVEN:
            self._unresponsive = unresponsive.record_command(self._unresponsive, now_s, driven=is_driven)
        self._echo = echo.note_command(self._echo, now_s, duty)
        self.in_force.note_command(command, is_held_back=is_held_back)

    def note_board(self, says: BoardSays) -> None:
        """What a board with our firmware says of itself."""
        self._board_says = says

    def note_line(self, event: EncodersCounted) -> None:
        """An encoder line has come, whether or not it is believed."""
        has_clock = event.stamp_s not in (event.board_s, event.arrival_s)
        self.in_force.note_line(event.stamp_s, event.arrival_s, has_clock=has_clock)

    def note_echo(self, event: DutyEchoed) -> Fault | None:
        """Take an echo. One that may have waited on the line is not judged."""
        if event.arrival_s < self._blind_until_s:
            return None
        self._echo, fault = echo.note_echo(self._parameters.echo, self._echo, event.arrival_s, event.duty)
        if self._echo.fitting >= self._parameters.echo.min_confirmations:
            self.in_force.note_echo(event.stamp_s, event.duty)
        return fault

    def watch(self, now_s: float, seen: WheelsRead, credit: Credit) -> Iterator[Fault]:
        """A good reading. ``credit`` gives wheels that are not believed the effort of those that stand in for them.

        What the wheels did in a pause without readings is unknown; the pause counts as ``max_age_s`` at most.
        """
        envelope = self.in_force.over_reading()
        if envelope is None:  # nothing has been said to this board yet
            return
        effort = credit(seen, envelope.effort) if seen.same_side.substitutes else envelope.effort
        longest_s = self._parameters.encoders.max_age_s
        dt_s = seen.dt_s if seen.dt_s < longest_s else longest_s
        if self._board_says.dead_man:  # the motors are off, whatever was written
            effort = (0.0,) * len(effort)
        if self._board_says.dead_man or self._lost_s:
            yield from self._watch_line(now_s, dt_s)
        self._wheels, fault = wheels.watch(
            self._parameters.wheels,
            self._names,
            self._wheels,
            effort,
            seen.reading.travel_rad,
            dt_s,
            self._play_rad,
            envelope.may_turn_round,
        )
        if fault is not None:
            yield self._blame_line(now_s, fault)
        yield from self._watch_motion(now_s, envelope.asked_m_s, seen)
        if not envelope.is_steady or self._board_says.dead_man:
            self._steady = SteadyWheels()
        elif envelope.asked_m_s != self._steady.asked_m_s:
            position_rad = seen.reading.position_rad
            self._steady = SteadyWheels(envelope.asked_m_s, self.in_force.taken_s, position_rad)
        elif self._steady.readings < SETTLING_READINGS:
            readings, position_rad = self._steady.readings + 1, seen.reading.position_rad
            self._steady = SteadyWheels(envelope.asked_m_s, self.in_force.taken_s, position_rad, readings)
        elif self.in_force.taken_s - self._steady.since_s >= OFF_TARGET_PERIOD_S:
            self._watch_pace(effort, seen)

    def _watch_line(self, now_s: float, dt_s: float) -> Iterator[Fault]:
        """Whether commands reach a board that says when its dead-man stops."""
        if now_s < self._blind_until_s:
            return
        driven = any(self.in_force.commands[0].duty)
        self._lost_s, fault = commands_lost.watch(self._lost_s, self._board_says, dt_s, driven=driven)
        if fault is not None:
            yield fault

    def _blame_line(self, now_s: float, fault: Fault) -> Fault:
        """A wheel's fault, or the line's where the wheel stands as the board says that it is told to."""
        if fault.kind is not FaultKind.WHEEL_STALLED or self._board_says.dead_man:
            return fault
        sent = self.in_force.commands[0].duty
        is_fresh = now_s - self._echo.shown_s <= ECHO_AGE_S
        if any(sent) and is_fresh and echo.says_no_motor(self._echo):
            return commands_lost.explain_unheard(fault, self._echo.shown, sent)
        if not self._echo.shown:
            return Fault(fault.kind, fault.reason + NO_ECHO)
        return fault

    def _watch_pace(self, effort: tuple[float, ...], seen: WheelsRead) -> None:
        """Whether wheels that are asked for a steady speed have it; wheels that drag each other are not judged."""
        steady, position_rad = self._steady, seen.reading.position_rad
        turned_rad = tuple(
            [now - before for now, before in zip(position_rad, steady.position_rad, strict=True)]
        )
        self._steady = SteadyWheels(steady.asked_m_s, self.in_force.taken_s, position_rad, SETTLING_READINGS)
        if self._dragged and max(steady.asked_m_s) - min(steady.asked_m_s) > LEVEL_M_S:
            return
        parameters, dt_s = self._parameters.off_target, self.in_force.taken_s - steady.since_s
        travel_m = self.kinematics.rims_at_m_s(turned_rad)
        self._pace = off_target.watch(
            parameters, self._pace, steady.asked_m_s, effort, travel_m, dt_s, self._free_m_s
        )
        sentence = off_target.sentence(
            parameters, self._names, self._pace, self._free_m_s, self._counts_per_turn
        )
        if bool(sentence) is not bool(self.warning):
            self.warning = sentence

    def _watch_motion(self, now_s: float, asked_m_s: tuple[float, ...], seen: WheelsRead) -> Iterator[Fault]:
        """Whether the robot is too fast, or moves although it must stand; None if neither can be decided."""
        if now_s < self._blind_until_s:
            self._overspeed = overspeed.at_rest(len(self._names))
            self._unresponsive = unresponsive.record_command(
                unresponsive.DRIVEN, now_s, driven=self._unresponsive.told_s is None
            )
            return
        travel_m = self.kinematics.rims_at_m_s(seen.reading.travel_rad)
        if self._dragged:  # the others may drag a wheel along at their speed
            asked_m_s = (max(map(abs, asked_m_s)),) * len(asked_m_s)
        self._overspeed, fault = overspeed.watch(
            self._parameters.overspeed,
            self._names,
            self._overspeed,
            asked_m_s,
            travel_m,
            seen.dt_s,
            seen.same_side.excluded,
        )
        if fault is not None:
            yield fault
        if self._unresponsive.told_s is None:  # it is driven
            return
        self._unresponsive, fault = unresponsive.watch(
            self._parameters.unresponsive,
            self._unresponsive,
            self.in_force.taken_s,
            travel_m,
            self.kinematics.rims_at_m_s(seen.reading.velocity_rad_s),
            seen.dt_s,
            echoes_motion=self._echoes_motion(now_s),
        )
        if fault is not None:
            yield fault

    def _echoes_motion(self, now_s: float) -> bool:
        state = self._echo
        is_fresh = now_s - state.shown_s <= ECHO_AGE_S
        return is_fresh and any(state.shown) and echo.is_believed(self._parameters.echo, state)
