"""Holds the gate and the fault detectors, and decides what may be driven.

It moves nothing itself: ``DriveService`` asks it before every duty and carries out the answer.
"""

from collections.abc import Callable, Collection, Mapping

import structlog

from chefbotd.bus import Bus, OnError
from chefbotd.clock import Clock
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import (
    BatteryMeasured,
    BoardRestarted,
    DutyEchoed,
    LinkClosed,
    LinkOpened,
    SafetyChanged,
)
from chefbotd.core.events.inputs import FaultTaken
from chefbotd.core.geometry import STANDING, Pose2D
from chefbotd.core.record import replace
from chefbotd.entries import entries_of
from chefbotd.features.driving.gate_announcer import GateAnnouncer
from chefbotd.features.driving.motor_watch import MotorWatch
from chefbotd.features.driving.obstacle_guard import ObstacleGuard, Scans
from chefbotd.features.driving.stop_hold import EMERGENCY_STOP, StopHold
from chefbotd.features.driving.wheel_reader import WheelsRead
from chefbotd.safety import battery_monitor, encoder_timeout, gate
from chefbotd.safety.encoder_timeout import EncoderTimeoutState
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.gate import HALT, Command, Decision, GateState, Mode, Rearm, SafetyParameters, Trigger
from chefbotd.safety.latch import GateStore

log = structlog.get_logger(component="safety")

ENCODERS_STALE = "encoders_stale"
NO_BOARD = "no_board"
"""The mode that is told while the gate is armed and no board has been connected yet: nothing can move."""

JUST_S = 0.001
"""So much older than it may be is a reading that is just too old."""

WAITING = "waiting for the board"

LATCHES_PER_SESSION = 2**20
"""The number of a latch is the session's times this, and a count: with 32 bits of session exact in a float, too."""


class SafetyKeeper:
    """``mounts`` are the range sensors that guard: ``base_from_sensor`` by name.

    ``scans`` makes what guards by lidars. ``latch`` remembers the mode beyond the end of the process; what latches is
    numbered within the ``session``. ``motors`` says whether board and wheels do as they are told.
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
    ) -> None:
        self._bus, self._clock, self._parameters = bus, entries_of(clock), parameters
        self.motors = motors
        self._gate, self._decision = latch.recall(), HALT
        self._latched = session * LATCHES_PER_SESSION
        self._held = StopHold(parameters.held_until_silent_s)
        self._silence = EncoderTimeoutState()
        self._critical_since_s: float | None = None
        self._obstacles = ObstacleGuard(bus, parameters.guard, mounts, scans, self._keep_error)
        self._link_open = False
        self._reported: Fault | None = None
        self.announcer = GateAnnouncer(bus, latch)
        self._announced: tuple[str | int | None, ...] = ()
        self._reading_error: Exception | None = None
        self._on_fault: Callable[[], None] = lambda: None
        bus.add_handler(self._on_battery, BatteryMeasured, on_error=self._keep_error)
        bus.add_handler(self._on_echo, DutyEchoed, on_error=self._keep_error)

    @property
    def gate(self) -> GateState:
        """The gate's state."""
        return self._gate

    @property
    def armed(self) -> bool:
        """Whether the robot may move at all."""
        return self._gate.mode is Mode.ARMED

    @property
    def is_commanded(self) -> bool:
        """Whether the last decision was made for a source's command."""
        return self._decision.source is not None

    def call_on_fault(self, callback: Callable[[], None]) -> None:
        """Have ``callback`` called when a reading other than the encoders' has led to a fault or an error."""
        self._on_fault = callback

    # What is asked of the robot

    def accept(self, command: Command) -> None:
        """Take a command into account.

        Raises:
            Refused: the link is down, the robot is not armed, or there is no such source.
        """
        self._take_report()
        if command.source in self._parameters.sources:
            estopped = self._gate.mode is Mode.ESTOPPED
            self._held.note_attempt(command.source, command.stamp_s, estopped=estopped)
        accepted = gate.accept(self._parameters, self._gate, command)
        self._held.require_free(command.source)
        if not self._link_open:
            raise Refused(RefusalKind.LINK_DOWN, "the board is not connected")
        self._gate = accepted

    def stop(self, by: str = "", excluded: Collection[str] = ()) -> None:
        """Forget every command; hold the sources that are driven, but for the ``excluded`` ones, if told by whom."""
        self._gate = gate.stop(self._gate)
        if by:
            self._held.hold(self._clock.now_s(), by, excluded)

    def resume(self, sources: Collection[str]) -> None:
        """The drivers of these sources ask anew: no stop holds them any longer."""
        self._held.free(sources)

    def release(self, source: str) -> None:
        """Forget a source's command."""
        self._gate = gate.release(self._gate, source)

    def estop(self, reason: str) -> None:
        """Latch, until ``arm``; who drives is held beyond that."""
        self._held.hold(self._clock.now_s(), EMERGENCY_STOP)
        self._gate = gate.change_mode(self._gate, Trigger.ESTOP, reason)
        self._latched += 1

    def arm(self, latch: int | None = None) -> None:
        """Allow motion again; every detector starts anew. What is armed already stays as it is, its detectors too.

        ``latch`` is the number of the e-stop or fault that is to be cleared; None: whatever has latched.

        Raises:
            Refused: the link is down, or another e-stop or fault has latched after that one.
        """
        if latch is not None:
            self._take_report()
        if latch not in (None, self._latched):
            is_foreign = latch // LATCHES_PER_SESSION != self._latched // LATCHES_PER_SESSION
            since = "the daemon was restarted" if is_foreign else "the robot was stopped again"
            raise Refused(
                RefusalKind.LATCHED_AGAIN,
                f"arm was sent for latch {latch}, but {since}, and the newest is {self._latched}: "
                f"the robot is {self._gate.mode} ({self._gate.reason})",
            )
        if not self._link_open:
            raise Refused(RefusalKind.LINK_DOWN, "the board is not connected, so the robot cannot be armed")
        if self.armed:
            return
        self._gate = gate.change_mode(self._gate, Trigger.ARM, "armed")
        self.motors.start_anew()
        self._silence = replace(self._silence, interrupted=False)

    # What happens to the robot

    def fail(self, fault: Fault) -> None:
        """A fault has happened: it latches."""
        before = self._gate
        self._gate = gate.change_mode(before, Trigger.FAULT, fault.reason, fault.kind)
        if self._gate is not before:
            self._latched += 1

    def report_from_thread(self, fault: Fault) -> None:
        """Let a fault latch before the next decision or command; may be called from any thread."""
        self._reported = fault

    def on_link(self, event: LinkOpened | LinkClosed | BoardRestarted) -> None:
        """The board is back, gone, or another: a fault that is left by arming, or by itself where configured."""
        if isinstance(event, LinkOpened):
            self._link_open = True
            self._silence = EncoderTimeoutState()
            self.motors.connected()
            self._recover("the link is back")
        elif isinstance(event, LinkClosed):
            self._link_open = False
            self.fail(Fault(FaultKind.LINK_LOST, f"the link was lost: {event.reason}"))
        else:
            self.fail(Fault(FaultKind.BOARD_RESTARTED, f"the board restarted: {event.cause}"))
            self._recover("the board is back")

    def watch_wheels(
        self, now_s: float, effort: tuple[float, ...], setpoint_m_s: tuple[float, ...], seen: WheelsRead
    ) -> None:
        """A good encoder reading, and what each wheel and rim was asked for meanwhile (see ``MotorWatch.watch``)."""
        self._silence = EncoderTimeoutState(now_s)
        for fault in self.motors.watch(now_s, effort, setpoint_m_s, seen):
            self.fail(fault)

    def loop_runs(self, now_s: float) -> None:
        """The control loop runs: to be called whenever it does, before a reading is judged.

        After a pause the encoders have not been silent for its time: the robot brakes until they are heard again.
        """
        if self.motors.loop_runs(now_s):
            stale_s = now_s - self._parameters.encoders.max_age_s - JUST_S
            self._silence = replace(self._silence, heard_s=max(self._silence.heard_s, stale_s))

    def note_jump(self, jumped: tuple[int, ...]) -> None:
        """An encoder reading was refused because of these wheels."""
        fault = self.motors.note_jump(jumped)
        if fault is not None:
            self.fail(fault)

    # What it comes to

    def decide(self, now_s: float, *, driven: bool) -> Decision:
        """What to do now; ``driven`` tells whether a duty is in force. Raises what a reading's handler has raised."""
        if self._reported is not None:
            self._take_report()
        if self._reading_error is not None:
            error, self._reading_error = self._reading_error, None
            raise error
        decision = gate.decide(self._parameters, self._gate, now_s)
        if not decision.halted:
            decision = self._within_sight(decision, now_s, driven)
        self._decision = decision
        return decision

    def announce(self, now_s: float) -> None:
        """Tell the gate's state if it has changed."""
        state, decision = self._gate, self._decision
        known = (
            self._link_open or state.mode is not Mode.ARMED
        )  # before, it is armed and there is nothing to move
        mode, reason = (state.mode, state.reason) if known else (NO_BOARD, WAITING)
        said = (mode, reason, decision.source, state.fault, decision.limited_by, self._latched)
        if said != self._announced:
            self._announced = said
            self.announcer.announce(SafetyChanged(now_s, *said), state)

    def _within_sight(self, decision: Decision, now_s: float, driven: bool) -> Decision:
        """No motion without encoders, and none that an obstacle forbids."""
        if encoder_timeout.is_stale(self._parameters.encoders, self._silence, now_s):
            self._silence, fault = encoder_timeout.update(
                self._parameters.encoders, self._silence, now_s, driven=driven
            )
            if fault is not None:
                self.fail(fault)
                return HALT
            limited_by = None if decision.source is None else ENCODERS_STALE
            return Decision(STANDING, decision.source, halted=True, limited_by=limited_by)
        if not self._parameters.guard.enabled or decision.motion == STANDING:
            return decision
        motion, limited_by = self._obstacles.limit(decision.motion, now_s)
        if limited_by is None:
            return decision
        return Decision(motion, decision.source, halted=False, limited_by=limited_by)

    def _take_report(self) -> None:
        if self._reported is not None:
            fault, self._reported = self._reported, None
            if self._clock.recording:
                self._clock.publish(FaultTaken(self._clock.now_s(), str(fault.kind), fault.reason))
            self.fail(fault)

    def _on_battery(self, event: BatteryMeasured) -> None:
        self._critical_since_s, fault = battery_monitor.judge(
            self._parameters.battery, self._critical_since_s, event
        )
        if fault is not None:
            self.fail(fault)
            self._on_fault()

    def _on_echo(self, event: DutyEchoed) -> None:
        fault = self.motors.note_echo(event)
        if fault is not None:
            self.fail(fault)
            self._on_fault()

    def _keep_error(self, error: Exception) -> None:
        """Let the next decision raise it: the control loop then brakes and disarms."""
        self._reading_error = error
        self._on_fault()

    def _recover(self, reason: str) -> None:
        if self._parameters.rearm is Rearm.AUTO:
            self._gate = gate.change_mode(self._gate, Trigger.RECOVERY, reason)
