"""Holds the gate and the fault detectors, and decides what may be driven.

It moves nothing itself: ``DriveService`` asks it before every duty and carries out the answer.
"""

from collections.abc import Callable, Mapping

import structlog
from msgspec import field

from chefbotd.bus import Bus, OnError
from chefbotd.clock import Clock
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import (
    BatteryMeasured,
    BoardRestarted,
    DriveWarned,
    DutyEchoed,
    FirmwareReported,
    LinkClosed,
    LinkOpened,
    RangeMeasured,
    RangeStatus,
    SafetyChanged,
)
from chefbotd.core.events.inputs import FaultTaken
from chefbotd.core.geometry import STANDING, Pose2D
from chefbotd.core.record import MutableState, StatefulPart, replace
from chefbotd.core.sentence import Sentence, join_words
from chefbotd.driving.gate_announcer import AnnouncerState, GateAnnouncer
from chefbotd.driving.motor_watch import Credit, MotorWatch, MotorWatchState
from chefbotd.driving.obstacle_guard import ObstacleGuard, Scans, WheelsAtReading
from chefbotd.driving.stop_hold import EMERGENCY_STOP, FAULT, StopHold
from chefbotd.driving.wheel_reader import WheelsRead
from chefbotd.inputs import inputs_of
from chefbotd.safety import battery_monitor, encoder_timeout, gate, hold
from chefbotd.safety import latch as latch_file
from chefbotd.safety.commands_lost import BoardSays
from chefbotd.safety.encoder_timeout import EncoderTimeoutState
from chefbotd.safety.faults import RECOVERABLE, Fault, FaultKind
from chefbotd.safety.gate import (
    CALIBRATION,
    HALT,
    Command,
    Decision,
    GateState,
    Mode,
    Rearm,
    SafetyParameters,
    Trigger,
)
from chefbotd.safety.guard import Beams
from chefbotd.safety.latch import GateStore

log = structlog.get_logger(component="safety")

OWN = 0
"""The number of a driver inside the daemon: that of no connection."""

ENCODERS_STALE = "encoders_stale"
NO_ECHO = "no_echo"
NO_BOARD = "no_board"
"""The published mode while the gate is armed and no board was connected yet, so that nothing can move."""

JUST_S = 0.001
"""The margin by which a reading that is just too old exceeds its limit."""

WAITING = Sentence("driving.waiting_for_board", "waiting for the board")

LATCHES_PER_SESSION = 2**20
"""A latch's or a stop's number is the session times this, plus a count. With 32 bits of session a float holds it."""


class SupervisorMemory(MutableState):
    """The gate's state, what was decided and announced last, and what lies between the parts.

    ``without_echo`` is the sensor that waits for echoes that do not come. ``reported`` is a fault that a thread has
    reported and that has not latched yet.
    """

    gate: GateState
    latched: int
    stop_number: int
    decision: Decision = HALT
    silence: EncoderTimeoutState = EncoderTimeoutState()
    without_echo: str = ""
    link_open: bool = False
    reported: Fault | None = None
    announced: tuple[str | int | None, ...] = ()
    battery: battery_monitor.BatteryWatch = battery_monitor.CHARGED


class SupervisorState(MutableState):
    """What the supervisor itself remembers, and its parts."""

    memory: SupervisorMemory
    held: hold.State
    motors: MotorWatchState
    beams: Beams
    announcer: AnnouncerState
    wheels: WheelsAtReading = field(default_factory=WheelsAtReading)


BOARD_STOP_ADVICE = {
    "stall": Sentence("driving.stop_advice_stall", "what moves heavily"),
    "estop": Sentence("driving.stop_advice_estop", "who else has its port open"),
    "dead-man": Sentence("driving.stop_advice_dead_man", "what else the processor does"),
    "lost": Sentence(
        "driving.stop_advice_lost", "the wheel's encoder, its wires and its sign, and what holds the wheel"
    ),
    "storm": Sentence(
        "driving.stop_advice_storm", "the encoder's wires: it sends more edges than a wheel can make"
    ),
}
"""Where to look first, by a word of the stop's name."""


class SafetySupervisor(StatefulPart[SupervisorState]):
    """``mounts`` are the range sensors that guard: ``base_from_sensor`` by name.

    ``scans`` makes the guard by lidars. ``latch`` keeps the mode beyond the end of the process; latches are numbered
    within the ``session``. ``motors`` judges whether board and wheels follow commands. ``guard_warning`` is announced:
    that sensors see obstacles while the guard is off. ``own_state`` is what it remembers beside its parts; the
    ``stop_number`` in it is that of the last stop, e-stop or fault: what waits compares it, and begins nothing where
    it has changed.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        parameters: SafetyParameters,
        *,
        mounts: Mapping[str, Pose2D],
        latch: GateStore,
        session: int = 0,
        motors: MotorWatch,
        scans: Callable[[OnError], Scans] | None = None,
        guard_warning: str = "",
    ) -> None:
        self._bus, self._clock, self._parameters = bus, inputs_of(clock), parameters
        self.motors, self._guard_warning = motors, guard_warning
        first = session * LATCHES_PER_SESSION
        self.own_state = SupervisorMemory(latch.recall(), latched=first, stop_number=first)
        self._held, self._warned = StopHold(parameters.held_until_silent_s), ""
        self.obstacles = ObstacleGuard(
            bus, parameters.guard, mounts, scans, self._keep_error, motors.kinematics
        )
        self.announcer = GateAnnouncer(bus, latch)
        self.parts = {
            "memory": self.own_state,
            "held": self._held,
            "motors": self.motors,
            "beams": self.obstacles,
            "announcer": self.announcer,
            "wheels": self.obstacles.wheels,
        }
        self.memory = SupervisorState(
            self.own_state, self._held.memory, motors.memory, self.obstacles.memory, self.announcer.memory
        )
        self._reading_error: Exception | None = None
        self._on_fault: Callable[[], None] = lambda: None
        self._on_latched: Callable[[], None] = lambda: None
        bus.add_handler(self._on_range, RangeMeasured, on_error=self._keep_error)
        bus.add_handler(self._on_battery, BatteryMeasured, on_error=self._keep_error)
        bus.add_handler(self._on_echo, DutyEchoed, on_error=self._keep_error)
        bus.add_handler(self._on_firmware, FirmwareReported, on_error=self._keep_error)

    def restore(self, state: SupervisorState) -> None:
        """Restore this state; what was warned of then is not said again."""
        super().restore(state)
        self._warned = self.motors.warning

    @property
    def gate(self) -> GateState:
        """The gate's state."""
        return self.own_state.gate

    @property
    def armed(self) -> bool:
        """Whether the robot may move at all."""
        return self.own_state.gate.mode is Mode.ARMED

    @property
    def is_commanded(self) -> bool:
        """Whether the last decision was made for a source's command."""
        return self.own_state.decision.source is not None

    def call_on_fault(self, callback: Callable[[], None]) -> None:
        """Have ``callback`` called when a reading other than the encoders' has led to a fault or an error."""
        self._on_fault = callback

    def call_on_latched(self, callback: Callable[[], None]) -> None:
        """Have ``callback`` called when a fault has latched: what was sent before it counts for nothing."""
        self._on_latched = callback

    # What is asked of the robot

    def accept(self, command: Command, client: int) -> None:
        """Take a client's command into account.

        Raises:
            Refused: the link is down, the robot is not armed, a stop holds the client, or there is no such source.
        """
        self._take_report()
        self.record_attempt(command.source, client, command.stamp_s)
        if command.source == CALIBRATION and client != OWN:
            raise Refused(
                RefusalKind.UNKNOWN_SOURCE,
                Sentence(
                    "driving.calibration_only",
                    "only the robot's own calibration drives as {source!r}",
                    source=CALIBRATION,
                ),
            )
        accepted = gate.accept(self._parameters, self.own_state.gate, command)
        self._held.require_free(command.source, client)
        if not self.own_state.link_open:
            raise Refused(RefusalKind.LINK_DOWN, Sentence("driving.no_board", "the board is not connected"))
        self.own_state.gate = accepted

    def renew_command(self, command: Command, client: int) -> bool:
        """Let a command that is followed as it is hold for longer. False: it may be another, and nothing has changed."""
        memory = self.own_state
        decision = memory.decision
        if decision.halted or decision.limited_by is not None or decision.source != command.source:
            return False
        if decision.motion != command.motion or command.source == CALIBRATION:
            return False
        if memory.reported is not None or self._reading_error is not None or not memory.link_open:
            return False
        renewed = gate.renew(self._parameters, memory.gate, command)
        if renewed is None or not self._held.renew_attempt(command.source, client, command.stamp_s):
            return False
        memory.gate = renewed
        return True

    def record_attempt(self, source: str, client: int, now_s: float) -> None:
        """A client tries to drive, whether or not its command is taken into account."""
        if source in self._parameters.sources and (source != CALIBRATION or client == OWN):
            self._held.record_attempt(source, client, now_s, self._latched_by())

    def forget_commands(self) -> None:
        """Forget every command; this is no stop."""
        self.own_state.gate = gate.stop(self.own_state.gate)

    def stop(self, by: str = "", client: int = 0) -> None:
        """Forget every command. With a name ``by``, also hold the sources that other clients drive."""
        self.forget_commands()
        self.own_state.stop_number += 1
        if by:
            self._held.stop(client, by, self._clock.now_s())

    def acknowledge_stops(self, client: int, source: str | None = None) -> None:
        """A client knows of the stops so far and asks to drive this source (None: any): they hold it no longer."""
        self._held.acknowledge(client, source)

    def take_over(self, client: int, source: str, *, from_another: bool) -> None:
        """A client takes control of a source, which counts as a try to drive it."""
        if source in self._parameters.sources:
            now_s = self._clock.now_s()
            self._held.take_over(client, source, now_s, self._latched_by(), from_another=from_another)

    def release(self, source: str) -> None:
        """Forget a source's command."""
        self.own_state.gate = gate.release(self.own_state.gate, source)

    def estop(self, reason: str) -> None:
        """Latch an emergency stop until ``arm``. Sources that are driven now are held longer."""
        self._held.latch(EMERGENCY_STOP, self._clock.now_s())
        self.own_state.gate = gate.change_mode(self.own_state.gate, Trigger.ESTOP, reason)
        self.own_state.latched, self.own_state.stop_number = (
            self.own_state.latched + 1,
            self.own_state.stop_number + 1,
        )

    def arm(self, latch: int | None = None) -> None:
        """Allow motion again, and reset every detector. If the gate is armed already, nothing changes.

        ``latch`` is the number of the e-stop or fault that is to be cleared; None: whatever has latched.

        Raises:
            Refused: the link is down, another e-stop or fault has latched after that one, or the next one could not be
                stored.
        """
        if latch is not None:
            self._take_report()
        if latch not in (None, self.own_state.latched):
            is_foreign = latch // LATCHES_PER_SESSION != self.own_state.latched // LATCHES_PER_SESSION
            why = gate.why_not_armed(self.own_state.gate.mode, self.own_state.gate.reason)
            if is_foreign:
                since = Sentence(
                    "driving.restarted_since",
                    "the daemon was restarted meanwhile: {why}; look at it, then arm the robot again",
                    why=why,
                )
            else:
                since = Sentence(
                    "driving.stopped_again",
                    "the robot was stopped again meanwhile: {why}; look at it, then arm the robot again",
                    why=why,
                )
            raise Refused(RefusalKind.LATCHED_AGAIN, since)
        if not self.own_state.link_open:
            raise Refused(
                RefusalKind.LINK_DOWN,
                Sentence(
                    "driving.no_board_to_arm", "the board is not connected, so the robot cannot be armed"
                ),
            )
        if self.armed:
            return
        armed = gate.change_mode(self.own_state.gate, Trigger.ARM, Sentence("driving.armed", "armed"))
        if problem := self.announcer.store(armed):
            raise Refused(RefusalKind.STORAGE_FAILED, latch_file.why_unwritable(problem))
        self.own_state.gate = armed
        self.motors.start_anew()
        self.own_state.silence = replace(self.own_state.silence, interrupted=False)

    # What happens to the robot

    def fail(self, fault: Fault) -> None:
        """A fault has happened: it latches. Sources that are driven now are held longer."""
        before = self.own_state.gate
        self.own_state.gate = gate.change_mode(before, Trigger.FAULT, fault.reason, fault.kind)
        if self.own_state.gate is not before:
            self.own_state.latched, self.own_state.stop_number = (
                self.own_state.latched + 1,
                self.own_state.stop_number + 1,
            )
            if latched_by := self._latched_by():
                self._held.latch(latched_by, self._clock.now_s())
            self._on_latched()

    def _latched_by(self) -> str:
        """What holds whoever drives until ``arm`` and beyond; nothing does where a fault is over by itself."""
        if self.own_state.gate.mode is Mode.ESTOPPED:
            return EMERGENCY_STOP
        recovers = self._parameters.rearm is Rearm.AUTO and self.own_state.gate.fault in RECOVERABLE
        return "" if self.armed or recovers else FAULT

    def report_from_thread(self, fault: Fault) -> None:
        """Let a fault latch before the next decision or command; may be called from any thread."""
        self.own_state.reported = fault

    def on_link(self, event: LinkOpened | LinkClosed | BoardRestarted) -> None:
        """The board is back, gone, or another one: a fault that ends with ``arm`` or, if configured, by itself."""
        if isinstance(event, LinkOpened):
            self.own_state.link_open = True
            self.own_state.silence = EncoderTimeoutState()
            self.motors.connected()
            self._recover(Sentence("driving.link_back", "the link is back"))
        elif isinstance(event, LinkClosed):
            self.own_state.link_open = False
            closed = Sentence("driving.port_closed", "closed")
            why = closed if event.reason == closed else event.reason
            lost = Sentence("driving.link_lost", "the link was lost: {why}", why=why)
            self.fail(Fault(FaultKind.LINK_LOST, lost))
        else:
            self.own_state.silence = (
                EncoderTimeoutState()
            )  # the restart explains it, no wait for an echo does
            restarted = Sentence("driving.board_restarted", "the board restarted: {why}", why=event.cause)
            self.fail(Fault(FaultKind.BOARD_RESTARTED, restarted))
            self._recover(Sentence("driving.board_back", "the board is back"))

    def note_reading(self, now_s: float, seen: WheelsRead) -> None:
        """A good encoder reading: the encoders are heard, and the wheels are there. Call it before ``decide``."""
        self.own_state.silence = encoder_timeout.note_reading(self.own_state.silence, now_s)
        wheels = self.obstacles.wheels
        wheels.wheels_rad, wheels.read_s = seen.reading.position_rad, now_s
        wheels.excluded = seen.same_side.excluded

    def watch_wheels(self, now_s: float, seen: WheelsRead, credit: Credit) -> bool:
        """Judge the wheels by a good reading (see ``MotorWatch.watch``); returns whether there is a fault."""
        has_failed, motors = False, self.motors
        for fault in motors.watch(now_s, seen, credit):
            self.fail(fault)
            has_failed = True
        warning = motors.memory.warning
        if warning != self._warned:
            self._warned = warning
            self._bus.publish(DriveWarned(now_s, self._warned))
            if self._warned:
                log.warning("the wheels are off their target", reason=self._warned)
        return has_failed

    def loop_runs(self, now_s: float) -> None:
        """Note that the control loop runs. Call it at every run, before a reading is judged.

        A pause of the loop is no silence of the encoders: the robot brakes until they are heard again.
        """
        if self.motors.loop_runs(now_s):
            stale_s = now_s - self._parameters.encoders.max_age_s - JUST_S
            self.own_state.silence = replace(
                self.own_state.silence, heard_s=max(self.own_state.silence.heard_s, stale_s)
            )

    def note_jump(self, jumped: tuple[int, ...]) -> None:
        """An encoder reading was refused because of these wheels."""
        fault = self.motors.note_jump(jumped)
        if fault is not None:
            self.fail(fault)

    # What it comes to

    def decide(self, now_s: float, *, driven: bool) -> Decision:
        """Decide what to do now; ``driven``: a duty is in force. Raises the error of a reading's handler."""
        if self.own_state.reported is not None:
            self._take_report()
        if self._reading_error is not None:
            error, self._reading_error = self._reading_error, None
            raise error
        decision = gate.decide(self._parameters, self.own_state.gate, now_s)
        if not decision.halted:
            decision = self._within_sight(decision, now_s, driven)
        self.own_state.decision = decision
        return decision

    def publish_gate_state(self, now_s: float) -> None:
        """Publish the gate's state if it has changed."""
        memory = self.own_state
        state, decision = memory.gate, memory.decision
        is_settled = (
            memory.link_open or state.mode is not Mode.ARMED
        )  # before, it is armed and there is nothing to move
        mode, reason = (state.mode, state.reason) if is_settled else (NO_BOARD, WAITING)
        said = (
            mode,
            reason,
            decision.source,
            state.fault,
            decision.limited_by,
            memory.latched,
            memory.stop_number,
            self._guard_warning,
        )
        if said != memory.announced:
            memory.announced = said
            self.announcer.announce(SafetyChanged(now_s, *said), state)

    def _within_sight(self, decision: Decision, now_s: float, driven: bool) -> Decision:
        """No motion without encoders, and none that an obstacle forbids."""
        if encoder_timeout.awaits_echo(self._parameters.encoders, self.own_state.silence, now_s):
            return self._crawling(decision, now_s)
        if encoder_timeout.is_stale(self._parameters.encoders, self.own_state.silence, now_s):
            if encoder_timeout.may_await_echo(self._parameters.encoders, self.own_state.silence, now_s):
                return self._crawling(decision, now_s)
            self.own_state.silence, fault = encoder_timeout.update(
                self._parameters.encoders, self.own_state.silence, now_s, driven=driven
            )
            if fault is not None:
                self.fail(fault)
                return HALT
            limited_by = None if decision.source is None else ENCODERS_STALE
            return Decision(STANDING, decision.source, halted=True, limited_by=limited_by)
        if not self._parameters.guard.enabled or decision.motion == STANDING:
            return decision
        motion, limited_by = self.obstacles.limit(decision.motion, now_s)
        if limited_by is None:
            return decision
        return Decision(motion, decision.source, halted=False, limited_by=limited_by)

    def _crawling(self, decision: Decision, now_s: float) -> Decision:
        """Limit the motion for a board that waits for echoes: slow, with room for its late obedience."""
        crawl_m_s = self._parameters.encoders.silent_speed_m_s
        motion = self.motors.slowed(decision.motion, crawl_m_s)
        limited_by = None if motion == decision.motion else NO_ECHO
        if self._parameters.guard.enabled and motion != STANDING:
            late_s = encoder_timeout.OVERSHOOT * encoder_timeout.OBEYS_AFTER_S
            motion, seen = self.obstacles.limit(motion, now_s, late_s)
            limited_by = seen or limited_by
        return Decision(motion, decision.source, halted=False, limited_by=limited_by)

    def _on_range(self, event: RangeMeasured) -> None:
        """Note a range reading: after "no echo" from the ultrasonic sensor the board waits in each cycle."""
        is_missing = event.status is RangeStatus.NO_ECHO
        if is_missing or event.sensor == self.own_state.without_echo:
            self.own_state.without_echo = event.sensor if is_missing else ""
            self.own_state.silence = encoder_timeout.note_echo(
                self._parameters.encoders, self.own_state.silence, self._clock.now_s(), is_missing=is_missing
            )

    def _take_report(self) -> None:
        if self.own_state.reported is not None:
            fault, self.own_state.reported = self.own_state.reported, None
            if self._clock.recording:
                self._clock.publish(FaultTaken(self._clock.now_s(), str(fault.kind), fault.reason))
            self.fail(fault)

    def _on_battery(self, event: BatteryMeasured) -> None:
        self.own_state.battery, fault = battery_monitor.judge(
            self._parameters.battery, self.own_state.battery, event
        )
        if fault is not None:
            self.fail(fault)
            self._on_fault()

    def _on_echo(self, event: DutyEchoed) -> None:
        fault = self.motors.note_echo(event)
        if fault is not None:
            self.fail(fault)
            self._on_fault()

    def _on_firmware(self, event: FirmwareReported) -> None:
        self.motors.note_board(BoardSays("dead_man" in event.stops, event.crc_errors, event.refused))
        if event.stopped_itself and self.armed:
            stops = " and ".join(event.stops).replace("_", "-")
            advice = {text: None for word, text in BOARD_STOP_ADVICE.items() if word in stops}
            reason = Sentence(
                "driving.board_stopped",
                "the board has stopped its motors ({stops}), and nobody here asked for it; see {advice}",
                stops=stops,
                advice=join_words(list(advice)),
            )
            self.fail(Fault(FaultKind.BOARD_STOPPED, reason))
            self._on_fault()

    def _keep_error(self, error: Exception) -> None:
        """Keep an error for the next decision, which raises it; the control loop then brakes and disarms."""
        self._reading_error = error
        self._on_fault()

    def _recover(self, reason: str) -> None:
        if self._parameters.rearm is Rearm.AUTO:
            recovered = gate.change_mode(self.own_state.gate, Trigger.RECOVERY, reason)
            if recovered is not self.own_state.gate and not self.announcer.store(recovered):
                self.own_state.gate = recovered
