"""The control loop: encoder counts in, motor duties out, with the gate between every command and the wire.

Commands come in by direct call, so that a stop goes from the socket to the wire in one call stack. The motion of the
wheels is published as events.
"""

import math
from collections.abc import Callable
from time import perf_counter

import structlog

from chefbotd.bus import Bus, HandlerFailure
from chefbotd.clock import Clock
from chefbotd.core.events import (
    BatteryMeasured,
    BoardRestarted,
    DutyEchoed,
    EncodersCounted,
    LinkClosed,
    LinkOpened,
    WheelsDriven,
    WheelsMeasured,
)
from chefbotd.core.geometry import Motion, WheelDuties
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.core.sentence import Sentence
from chefbotd.driving.motor_watch import PAUSE_S
from chefbotd.driving.safety_supervisor import SafetySupervisor, SupervisorState
from chefbotd.driving.watch_timer import WatchTimer, WatchTimerState
from chefbotd.driving.wheel_controller import WheelController
from chefbotd.driving.wheel_reader import WheelReader, WheelReaderState, WheelsRead
from chefbotd.inputs import inputs_of
from chefbotd.metrics import Histogram
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import DriveState
from chefbotd.motion.encoder import LOST_LINES_S
from chefbotd.safety import gate
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.gate import Decision
from chefbotd.safety.in_force import WrittenCommand
from chefbotd.safety.watchdog import ControlParameters, WatchdogParameters, judge_pause

STEP_BOUNDS_S = (0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1)
"""The histogram's bounds, from a fast computer's step to more than the fastest board's cycle (10 ms)."""

log = structlog.get_logger(component="drive")


class DriveServiceState(MutableState):
    """The state of the control loop; gains and limits are parts of their own."""

    wheels: DriveState
    keeper: SupervisorState
    reader: WheelReaderState
    watch_timer: WatchTimerState
    stops: int = 0
    stopped_by: str = ""
    steps: int = 0
    internal_errors: int = 0
    acted_s: float = -math.inf
    pauses: int = 0
    pauses_s: tuple[float, ...] = ()
    resumed_s: float = 0.0


class DriveService(StatefulPart[DriveServiceState]):
    """Asks ``wheels`` what to do; ``keeper`` has the last word, ``send_duty`` puts a duty on the wire at once.

    ``repeat_duty`` is told the duty in force that is not sent again: by it a board knows that this loop lives.
    ``reader`` measures the wheels; ``wheel_names`` and ``duty_ceiling`` are for the ``WheelController``. After a pause
    of ``watchdog.timeout_s`` the loop forgets earlier commands, whether or not a watchdog has looked. If the robot
    drove, it brakes until the next command; after a long pause, or too many pauses, until it is armed.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        send_duty: Callable[[tuple[int, ...]], None],
        drive: Drive,
        keeper: SafetySupervisor,
        *,
        reader: WheelReader,
        wheel_names: tuple[str, ...],
        control: ControlParameters,
        duty_ceiling: Callable[[float], tuple[int, ...] | None] = lambda now_s: None,
        repeat_duty: Callable[[tuple[int, ...]], None] = lambda duty: None,
        watchdog: WatchdogParameters,
    ) -> None:
        self._bus, self._clock, self._write_duty = bus, inputs_of(clock), send_duty
        self._repeat_duty = repeat_duty
        self.wheels = WheelController(drive, wheel_names, duty_ceiling)
        self.keeper, self.reader = keeper, reader
        self._watchdog = watchdog
        self._watch_timer = WatchTimer(
            self._clock, control.watch_period_s, min(watchdog.timeout_s, PAUSE_S), self._watch
        )
        keeper.call_on_fault(self._watch_timer.look_soon)
        self._failure = HandlerFailure()
        self._still = (0,) * len(wheel_names)
        on_error = self._on_handler_error
        self._remove_handlers: tuple[Callable[[], None], ...] = (
            bus.add_handler(self._on_encoders, EncodersCounted, on_error=on_error),
            bus.add_handler(self._on_link, LinkOpened, on_error=on_error),
            bus.add_handler(self._on_link, LinkClosed, on_error=on_error),
            bus.add_handler(self._on_link, BoardRestarted, on_error=on_error),
        )
        if drive.knows_its_motors:
            self._remove_handlers += (bus.add_handler(self._on_echo, DutyEchoed, on_error=on_error),)
        if drive.makes_up_for_voltage:
            self._remove_handlers += (bus.add_handler(self._on_battery, BatteryMeasured, on_error=on_error),)
        self.step_times = Histogram(STEP_BOUNDS_S)
        self.memory = DriveServiceState(
            self.wheels.drive_state, keeper.memory, reader.memory, self._watch_timer.memory
        )
        self.parts = {"keeper": keeper, "reader": reader, "watch_timer": self._watch_timer}

    def state(self) -> DriveServiceState:
        """Return the state of this part."""
        self.memory.wheels = self.wheels.drive_state
        return super().state()

    def restore(self, state: DriveServiceState) -> None:
        """Restore this state."""
        super().restore(state)
        self.wheels.drive_state = state.wheels

    @property
    def stops(self) -> int:
        """How many stops and emergency stops there have been."""
        return self.memory.stops

    @property
    def stopped_by(self) -> str:
        """Whose was the last of them."""
        return self.memory.stopped_by

    # Commands

    def command(self, source: str, motion: Motion | WheelDuties, client: int = 0) -> None:
        """Move like this until the command is too old, a higher source drives, or a stop comes.

        ``client`` is the number of the connection that asks for it; 0: a driver inside the daemon. Only the source
        ``calibration`` may drive by duties.

        Raises:
            Refused: the link is down, the robot is not armed, a stop holds the client, or there is no such source.
        """
        now_s = self._clock.now_s()
        self._note_run(now_s)
        if isinstance(motion, WheelDuties):
            motion = self.wheels.wheel_duties(motion)
        self.keeper.accept(gate.Command(source, motion, now_s), client)
        self._obey(now_s)

    def renew_command(self, source: str, motion: Motion, client: int) -> bool:
        """The motion that this source drives already, again: it holds for longer, and the next reading drives it on.

        False: more may follow from it. Nothing has changed then, and ``command`` is to be called.
        """
        now_s = self._clock.now_s()
        if now_s - self.memory.acted_s > self._watchdog.timeout_s or not self.is_driving:
            return False
        return self.keeper.renew_command(gate.Command(source, motion, now_s), client)

    def record_attempt(self, source: str, client: int) -> None:
        """A client tries to drive a source that another one controls; a stop holds it, too."""
        self.keeper.record_attempt(source, client, self._clock.now_s())

    def release(self, source: str) -> None:
        """Forget one source's command: a lower source drives at once, or the robot comes to rest."""
        self.keeper.release(source)
        self._obey(self._clock.now_s())

    def brake(self) -> None:
        """Zero on the wire now, every source's command forgotten, and no motion before the next one."""
        self.keeper.forget_commands()
        self._halt()

    def stop(self, by: str = "", client: int = 0) -> None:
        """Come to rest within the deceleration limit; every source's command is forgotten.

        What other clients drive is held in the name of ``by``; without a name, nothing is.
        """
        self.memory.stops, self.memory.stopped_by = self.memory.stops + 1, by
        self.keeper.stop(by, client)
        self._obey(self._clock.now_s())

    @property
    def acted_s(self) -> float:
        """When the loop last ran; may be read from any thread."""
        return self.memory.acted_s

    @property
    def stop_number(self) -> int:
        """That of the last stop, e-stop or fault; another one than before means that there was any."""
        return self.keeper.own_state.stop_number

    def take_over(self, client: int, source: str, *, from_another: bool) -> None:
        """A client takes control of a source: it knows of the stops so far where it did not try to drive lately."""
        self.keeper.take_over(client, source, from_another=from_another)

    def acknowledge_stops(self, client: int, source: str | None = None) -> None:
        """A client knows of the stops so far, and asks to drive this source (None: any)."""
        self.keeper.acknowledge_stops(client, source)

    def estop(self, reason: str) -> None:
        """Zero on the wire now, and until ``arm``."""
        self.memory.stops, self.memory.stopped_by = self.memory.stops + 1, "an emergency stop"
        self.keeper.estop(reason)
        self._obey(self._clock.now_s())

    def arm(self, latch: int | None = None) -> None:
        """Allow motion again; nothing moves before the next command. ``latch``: what is to be cleared, and none else.

        Raises:
            Refused: the link is down, or another e-stop or fault has latched after that one.
        """
        was_armed = self.keeper.armed
        self.keeper.arm(latch)
        if not was_armed:
            self.memory.pauses_s = ()
        self._obey(self._clock.now_s())

    def fail(self, fault: Fault) -> None:
        """Stop because another part has failed: zero on the wire now, and until ``arm``."""
        self.keeper.fail(fault)
        self._obey(self._clock.now_s())

    @property
    def is_driving(self) -> bool:
        """Whether the last duty was not zero; may be read from any thread."""
        return any(self.wheels.drive_state.duty)

    @property
    def resumed_s(self) -> float:
        """When the loop last ran again after it had stood still while it drove, be it that it has not noticed yet."""
        now_s = self._clock.now_s()
        stands = self.is_driving and now_s - self.memory.acted_s > self._watchdog.timeout_s
        return now_s if stands else self.memory.resumed_s

    # The loop

    async def run(self) -> None:
        """Watch for silent encoders until cancelled. However it ends, the last message sent is a stop.

        Encoder frames and changes of the link are handled in the call that publishes them.
        """
        self.keeper.publish_gate_state(self._clock.now_s())
        self._watch_timer.start(self._clock.now_s())
        try:
            await self._clock.at_rest(self._failure.wait())
        finally:
            self._watch_timer.stop()
            self.detach()
            self._halt()

    def detach(self) -> None:
        """Stop handling events of the board and its link. A link that the daemon closes itself is no fault."""
        for remove in self._remove_handlers:
            remove()

    def _watch(self) -> None:
        """Act without a measurement: nothing was received for the period."""
        now_s = self._clock.now_s()
        self._watch_timer.restart(now_s)
        try:
            self._act(now_s, repeat=False)
        except Exception as error:  # noqa: BLE001 (brakes, and is logged)
            self._on_handler_error(error)

    def _on_encoders(self, event: EncodersCounted) -> None:
        """One control step: decode, ask the keeper, regulate, write the duty, judge the wheels, publish."""
        began_s, now_s = perf_counter(), self._clock.now_s()
        keeper, wheels, watch_timer = self.keeper, self.wheels, self._watch_timer
        self._note_run(now_s)
        keeper.motors.note_line(event)
        in_force, obeyed_m_s = keeper.motors.memory.in_force, None
        if in_force.taken_s - in_force.before_s > LOST_LINES_S:
            obeyed_m_s = in_force.likely_m_s()  # the board waited for an echo, and obeyed an older command
        seen = self.reader.read(event, obeyed_m_s or wheels.drive_state.setpoint_m_s)
        reading = seen.reading
        keeper.loop_runs(now_s)
        if reading.refused:
            watch_timer.restart(now_s)
            if reading.jumped:
                keeper.note_jump(reading.jumped)
            watch_timer.note_activity(now_s)
            self._act(now_s)
            return
        keeper.note_reading(now_s, seen)
        obeyed_m_s = in_force.likely_m_s() if seen.dt_s > LOST_LINES_S else None
        wheels.regulate(keeper.decide(now_s, driven=self.is_driving), now_s, seen, obeyed_m_s)
        duty = wheels.drive_state.duty
        self._write_duty(duty)  # before the watches judge: a fault halts by the next write, in the same call
        has_failed = keeper.watch_wheels(now_s, seen, self.reader.effort)
        self._note_command(now_s, duty)
        if has_failed:
            self._act(now_s)
        watch_timer.restart(now_s)
        if wheels.change_waits:
            wheels.make_change()
        if wheels.drive_state.duty != self._still or any(reading.travel_rad) or self._is_asked():
            if watch_timer.memory.still_since_s is not None:
                watch_timer.note_activity(now_s)
        else:
            watch_timer.note_stillness(now_s)
        self.memory.steps += 1
        keeper.publish_gate_state(now_s)
        self._publish_wheels(event, seen)
        self.step_times.observe(perf_counter() - began_s)

    def _on_echo(self, event: DutyEchoed) -> None:
        """The board may have read another duty than was thought: make up for it before its next cycle."""
        if self.wheels.note_echo(event.duty):
            self._act(self._clock.now_s())

    def _on_battery(self, event: BatteryMeasured) -> None:
        self.wheels.note_voltage(event.voltage_v)

    def _publish_wheels(self, event: EncodersCounted, seen: WheelsRead) -> None:
        stamp_s, reading, excluded = event.stamp_s, seen.reading, seen.same_side.excluded
        position_rad, velocity_rad_s = reading.position_rad, reading.velocity_rad_s
        publish, wheels = self._bus.publish, self.wheels
        publish(
            WheelsMeasured(
                stamp_s,
                event.arrival_s,
                event.board_s,
                position_rad,
                reading.travel_rad,
                velocity_rad_s,
                excluded,
            )
        )
        targets, duty = wheels.targets_rad_s, wheels.drive_state.duty
        publish(WheelsDriven(stamp_s, position_rad, velocity_rad_s, targets, duty, excluded))

    def _act(self, now_s: float, *, repeat: bool = True) -> None:
        """Step without a measurement; ``repeat`` writes the duty even when it has not changed. A stop always is.

        One that was lost on the wire must not leave the motors on for want of encoder frames to answer.
        """
        before = self.wheels.drive_state.duty
        self.wheels.retarget(self._decide(now_s), now_s)
        duty = self.wheels.drive_state.duty
        if repeat or duty != before or not any(duty):
            self._send_duty(now_s, duty)
        else:
            self._repeat_duty(duty)
        if self.wheels.change_waits:
            self.wheels.make_change()
        if self._watch_timer.memory.resting and self._is_asked():
            self._watch_timer.note_activity(now_s)
        self.keeper.publish_gate_state(now_s)

    def _is_asked(self) -> bool:
        """Whether a duty is in force, a setpoint is not zero, or any source has a command, even zero."""
        return self.keeper.is_commanded or not self.wheels.rests

    def _decide(self, now_s: float) -> Decision:
        self._note_run(now_s)
        self.keeper.loop_runs(now_s)
        return self.keeper.decide(now_s, driven=self.is_driving)

    def _note_run(self, now_s: float) -> None:
        """Note that the loop runs. If it had stood still, earlier commands are void, whatever runs first after it.

        A duty that was in force meanwhile is set to zero, because it was not monitored.
        """
        stood_s, self.memory.acted_s = now_s - self.memory.acted_s, now_s
        if stood_s <= self._watchdog.timeout_s:
            return
        self.keeper.forget_commands()
        if not self.is_driving:
            return
        self.memory.pauses, self.memory.resumed_s = self.memory.pauses + 1, now_s
        self.memory.pauses_s, fault = judge_pause(self._watchdog, self.memory.pauses_s, now_s, stood_s)
        log.warning(
            "the control loop stood still while it drove",
            stood_s=round(stood_s, 3),
            pauses_in_a_minute=len(self.memory.pauses_s),
        )
        if fault is not None:
            self.keeper.fail(fault)
        self._halt()

    # Faults

    def _obey(self, now_s: float) -> None:
        """Act on a call from outside, and pass an error to the caller."""
        try:
            self._act(now_s)
        except Exception as error:
            self._on_internal_error(error)
            raise

    def _on_link(self, event: LinkOpened | LinkClosed | BoardRestarted) -> None:
        now_s = self._clock.now_s()
        self._note_run(now_s)
        self._watch_timer.note_activity(now_s)
        self._watch_timer.restart(now_s)
        if isinstance(event, BoardRestarted):
            self.reader.rebase()
        if not isinstance(event, LinkOpened):
            self._halt()
        self.keeper.on_link(event)
        self._act(now_s)

    def _on_handler_error(self, error: Exception) -> None:
        """Brake and disarm; an error in that ends the service, and the daemon with it."""
        try:
            if self.keeper.armed:
                log.error("a control step failed", exc_info=error)
            self._on_internal_error(error)
        except Exception as another:  # noqa: BLE001 (ends the service)
            self._failure.report(another)

    def _on_internal_error(self, error: Exception) -> None:
        self.memory.internal_errors += 1
        reason = Sentence(
            "driving.loop_failed",
            "the control loop failed and stopped: {error}; see the log",
            error=repr(error),
        )
        self.keeper.fail(Fault(FaultKind.INTERNAL_ERROR, reason))
        self._halt()
        self.keeper.publish_gate_state(self._clock.now_s())

    def _send_duty(self, now_s: float, duty: tuple[int, ...]) -> None:
        self._note_command(now_s, duty)
        self._write_duty(duty)

    def _note_command(self, now_s: float, duty: tuple[int, ...]) -> None:
        motors, setpoint_m_s = self.keeper.motors, self.wheels.drive_state.setpoint_m_s
        commands = motors.memory.in_force.commands
        if commands and commands[0].duty == duty and commands[0].setpoint_m_s == setpoint_m_s:
            motors.note_repeated(now_s, duty, is_held_back=self.wheels.is_held_back)
            return
        command = WrittenCommand(now_s, duty, self.wheels.effort, setpoint_m_s)
        motors.note_command(command, is_held_back=self.wheels.is_held_back)

    def _halt(self) -> None:
        self.wheels.halt()
        self._send_duty(self._clock.now_s(), self._still)
