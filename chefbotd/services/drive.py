"""The control loop: encoder counts in, motor duties out, with the gate between every wish and the wire.

Commands come in by direct call, so that a stop goes from the socket to the wire in one call stack. What the wheels do
goes out as events.
"""

from collections.abc import Callable, Mapping

import structlog
from pydantic import Field, ValidationError

from chefbotd.bus import Bus, Inbox
from chefbotd.clock import Clock
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import (
    BoardRestarted,
    EncodersCounted,
    LinkClosed,
    LinkOpened,
    SafetyChanged,
    WheelsDriven,
    WheelsMeasured,
)
from chefbotd.core.geometry import Twist2D
from chefbotd.core.parameters import Parameters
from chefbotd.motion import encoder
from chefbotd.motion.drive import Drive
from chefbotd.motion.encoder import EncoderParameters
from chefbotd.motion.kinematics import WheelParameters
from chefbotd.motion.pid import PidParameters
from chefbotd.safety import gate
from chefbotd.safety.gate import Command, Decision, GateState, Mode, Rearm, SafetyParameters, Trigger

log = structlog.get_logger(component="drive")

Heard = EncodersCounted | LinkOpened | LinkClosed | BoardRestarted

ALL_WHEELS = "all"


class ControlParameters(Parameters):
    """``watch_period_s``: how long encoders may be silent before the gate is looked at without them."""

    watch_period_s: float = Field(default=0.02, gt=0, le=0.1)


class DriveService:
    """Owns the gate's state and the wheels' controller; ``send_duty`` puts a duty on the wire at once."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        send_duty: Callable[[tuple[int, ...]], None],
        drive: Drive,
        *,
        wheels: tuple[WheelParameters, ...],
        encoders: EncoderParameters,
        safety: SafetyParameters,
        control: ControlParameters,
    ) -> None:
        self._bus, self._clock, self._send_duty = bus, clock, send_duty
        self._drive, self._state = drive, drive.at_rest
        self._wheels, self._signs = wheels, tuple(wheel.encoder_sign for wheel in wheels)
        self._encoder_parameters, self._encoders = encoders, encoder.START
        self._safety, self._gate = safety, GateState()
        self._watch_period_s = control.watch_period_s
        self._board_s: float | None = None
        self._link_open = False
        self._source: str | None = None
        self._announced: SafetyChanged | None = None
        self._inbox: Inbox[Heard] = bus.subscribe(EncodersCounted, LinkOpened, LinkClosed, BoardRestarted)
        self.steps = 0
        self.readings_refused = 0

    # Commands

    def command(self, source: str, twist: Twist2D) -> None:
        """Follow ``twist`` from now until the command is too old, a higher source speaks, or a stop.

        Raises:
            Refused: the link is down, the robot is not armed, or there is no such source.
        """
        now_s = self._clock.now_s()
        accepted = gate.accept(self._safety, self._gate, Command(source, twist, now_s))
        if not self._link_open:
            raise Refused(RefusalKind.LINK_DOWN, "the board is not connected")
        self._gate = accepted
        self._act(now_s)

    def stop(self) -> None:
        """Come to rest within the deceleration limit; every source's command is forgotten."""
        self._gate = gate.stop(self._gate)
        self._act(self._clock.now_s())

    def estop(self, reason: str) -> None:
        """Zero on the wire now, and until ``arm``."""
        self._change_mode(Trigger.ESTOP, reason)

    def arm(self) -> None:
        """Allow motion again; nothing moves before the next command.

        Raises:
            Refused: the link is down.
        """
        if not self._link_open:
            raise Refused(RefusalKind.LINK_DOWN, "the board is not connected: nothing to arm")
        self._change_mode(Trigger.ARM, "armed")

    def gains(self) -> dict[str, PidParameters]:
        """The present gains by wheel name."""
        return {wheel.name: gains for wheel, gains in zip(self._wheels, self._drive.gains, strict=True)}

    def set_gains(self, wheel: str, changes: Mapping[str, object]) -> dict[str, PidParameters]:
        """Change gains of one wheel, or of ``all``, without a bump; returns the gains of every wheel.

        Raises:
            Refused: no such wheel, or a value out of range; nothing changes.
        """
        if wheel != ALL_WHEELS and wheel not in self.gains():
            known = ", ".join([ALL_WHEELS, *self.gains()])
            raise Refused(RefusalKind.UNKNOWN_WHEEL, f"no wheel named {wheel!r}; there are {known}")
        gains = tuple(
            _changed(old, changes) if wheel in (ALL_WHEELS, name) else old
            for name, old in self.gains().items()
        )
        self._state = self._drive.retune(self._state, gains)
        return self.gains()

    # The loop

    async def run(self) -> None:
        """Control until cancelled; whatever ends it, the last thing sent is a stop."""
        self._announce(self._clock.now_s())
        try:
            while True:
                event = await self._inbox.get_within(self._watch_period_s)
                if isinstance(event, EncodersCounted):
                    self._on_encoders(event)
                elif event is None:
                    self._act(self._clock.now_s(), repeat=False)
                else:
                    self._on_link(event)
        finally:
            self._inbox.close()
            self._state = self._drive.halt(self._state)
            self._send_duty(self._state.duty)

    def _on_encoders(self, event: EncodersCounted) -> None:
        """The story of one tick: decode, ask the gate, regulate, put it on the wire, tell the others."""
        self._encoders, reading = encoder.decode(
            self._encoder_parameters, self._signs, self._encoders, event.counts, event.board_s
        )
        now_s = self._clock.now_s()
        if reading.refused:
            self._refuse_reading(event, reading)
            self._act(now_s)
            return
        dt_s = 0.0 if self._board_s is None else event.board_s - self._board_s
        self._board_s = event.board_s
        decision = self._decide(now_s)
        if decision.halted:
            self._state = self._drive.halt(self._state)
        else:
            self._state = self._drive.regulate(
                self._state, decision.twist, now_s, reading.velocity_rad_s, dt_s
            )
        self._send_duty(self._state.duty)
        self.steps += 1
        self._publish(event, reading)

    def _refuse_reading(self, event: EncodersCounted, reading: encoder.Reading) -> None:
        self.readings_refused += 1
        names = [self._wheels[index].name for index in reading.jumped]
        log.warning(
            "impossible encoder jump refused", wheels=names, counts=event.counts, rebased=reading.rebased
        )

    def _publish(self, event: EncodersCounted, reading: encoder.Reading) -> None:
        self._bus.publish(
            WheelsMeasured(
                event.stamp_s,
                event.board_s,
                reading.position_rad,
                reading.travel_rad,
                reading.velocity_rad_s,
            )
        )
        targets = self._drive.targets_rad_s(self._state)
        self._bus.publish(
            WheelsDriven(
                event.stamp_s, reading.position_rad, reading.velocity_rad_s, targets, self._state.duty
            )
        )

    def _act(self, now_s: float, *, repeat: bool = True) -> None:
        """Step without a measurement; ``repeat`` writes the duty even when it has not changed."""
        decision, before = self._decide(now_s), self._state.duty
        if decision.halted:
            self._state = self._drive.halt(self._state)
        else:
            self._state = self._drive.retarget(self._state, decision.twist, now_s)
        if repeat or self._state.duty != before:
            self._send_duty(self._state.duty)

    def _decide(self, now_s: float) -> Decision:
        decision = gate.decide(self._safety, self._gate, now_s)
        if decision.source != self._source:
            self._source = decision.source
            self._announce(now_s)
        return decision

    # Faults

    def _on_link(self, event: LinkOpened | LinkClosed | BoardRestarted) -> None:
        if isinstance(event, LinkOpened):
            self._link_open = True
            if self._safety.rearm is Rearm.AUTO:
                self._change_mode(Trigger.RECOVERY, "the link is back")
        elif isinstance(event, LinkClosed):
            self._link_open = False
            self._change_mode(Trigger.FAULT, f"the link was lost: {event.reason}")
        else:
            self._encoders = encoder.rebase(self._encoders)
            self._board_s = None
            self._change_mode(Trigger.FAULT, f"the board restarted: {event.cause}")
            if self._safety.rearm is Rearm.AUTO:
                self._change_mode(Trigger.RECOVERY, "the board is back")

    def _change_mode(self, trigger: Trigger, reason: str) -> None:
        before = self._gate.mode
        self._gate = gate.change_mode(self._gate, trigger, reason)
        now_s = self._clock.now_s()
        self._act(now_s)
        self._announce(now_s)
        if self._gate.mode is not before:
            logged = log.info if self._gate.mode is Mode.ARMED else log.warning
            logged("safety mode changed", mode=str(self._gate.mode), reason=self._gate.reason)

    def _announce(self, now_s: float) -> None:
        event = SafetyChanged(now_s, str(self._gate.mode), self._gate.reason, self._source)
        told = self._announced
        if told is None or (told.mode, told.reason, told.source) != (event.mode, event.reason, event.source):
            self._announced = event
            self._bus.publish(event)


def _changed(old: PidParameters, changes: Mapping[str, object]) -> PidParameters:
    try:
        return PidParameters.model_validate(old.model_dump() | dict(changes))
    except ValidationError as error:
        told = "; ".join(f"{'.'.join(map(str, e['loc']))}={e['input']!r}: {e['msg']}" for e in error.errors())
        raise Refused(RefusalKind.OUT_OF_RANGE, told) from error
