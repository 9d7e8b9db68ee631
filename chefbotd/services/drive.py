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
    WheelsDriven,
    WheelsMeasured,
)
from chefbotd.core.geometry import Twist2D
from chefbotd.core.parameters import Parameters
from chefbotd.logs import RateLimitedLog
from chefbotd.motion import encoder
from chefbotd.motion.drive import Drive
from chefbotd.motion.encoder import EncoderParameters
from chefbotd.motion.kinematics import WheelParameters
from chefbotd.motion.pid import PidParameters
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.gate import Command, Decision
from chefbotd.services.safety import SafetyKeeper

log = structlog.get_logger(component="drive")

Heard = EncodersCounted | LinkOpened | LinkClosed | BoardRestarted

ALL_WHEELS = "all"


class ControlParameters(Parameters):
    """``watch_period_s``: how long encoders may be silent before the gate is looked at without them."""

    watch_period_s: float = Field(default=0.02, gt=0, le=0.1)


class DriveService:
    """Owns the wheels' controller; ``keeper`` has the last word, ``send_duty`` puts a duty on the wire at once."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        send_duty: Callable[[tuple[int, ...]], None],
        drive: Drive,
        keeper: SafetyKeeper,
        *,
        wheels: tuple[WheelParameters, ...],
        encoders: EncoderParameters,
        control: ControlParameters,
    ) -> None:
        self._bus, self._clock, self._send_duty = bus, clock, send_duty
        self._drive, self._state, self._keeper = drive, drive.at_rest, keeper
        self._wheels, self._signs = wheels, tuple(wheel.encoder_sign for wheel in wheels)
        self._encoder_parameters, self._encoders = encoders, encoder.START
        self._watch_period_s = control.watch_period_s
        self._board_s: float | None = None
        self._inbox: Inbox[Heard] = bus.subscribe(EncodersCounted, LinkOpened, LinkClosed, BoardRestarted)
        self._jump_log = RateLimitedLog(log)
        self.steps = 0
        self.readings_refused = 0
        self.internal_errors = 0
        self.acted_s = float("-inf")

    # Commands

    def command(self, source: str, twist: Twist2D) -> None:
        """Follow ``twist`` from now until the command is too old, a higher source speaks, or a stop.

        Raises:
            Refused: the link is down, the robot is not armed, or there is no such source.
        """
        now_s = self._clock.now_s()
        self._keeper.accept(Command(source, twist, now_s))
        self._obey(now_s)

    def stop(self) -> None:
        """Come to rest within the deceleration limit; every source's command is forgotten."""
        self._keeper.stop()
        self._obey(self._clock.now_s())

    def estop(self, reason: str) -> None:
        """Zero on the wire now, and until ``arm``."""
        self._keeper.estop(reason)
        self._obey(self._clock.now_s())

    def arm(self) -> None:
        """Allow motion again; nothing moves before the next command.

        Raises:
            Refused: the link is down.
        """
        self._keeper.arm()
        self._obey(self._clock.now_s())

    def fail(self, fault: Fault) -> None:
        """Another part has failed: zero on the wire now, and until ``arm``."""
        self._keeper.fail(fault)
        self._obey(self._clock.now_s())

    def report_from_thread(self, fault: Fault) -> None:
        """The same, as soon as the loop goes on; may be called from any thread."""
        self._keeper.report_from_thread(fault)

    @property
    def is_driving(self) -> bool:
        """Whether the last duty was not zero; may be read from any thread."""
        return any(self._state.duty)

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
        self._keeper.announce(self._clock.now_s())
        try:
            while True:
                event = await self._inbox.get_within(self._watch_period_s)
                try:
                    self._on(event)
                except Exception as error:
                    if self._keeper.armed:
                        log.exception("a control step failed")
                    self._on_internal_error(error)
        finally:
            self._inbox.close()
            self._halt()

    def _on(self, event: Heard | None) -> None:
        if isinstance(event, EncodersCounted):
            self._on_encoders(event)
        elif event is None:
            self._act(self._clock.now_s(), repeat=False)
        else:
            self._on_link(event)

    def _on_encoders(self, event: EncodersCounted) -> None:
        """The story of one tick: decode, ask the keeper, regulate, put it on the wire, tell the others."""
        self._encoders, reading = encoder.decode(
            self._encoder_parameters,
            self._signs,
            self._encoders,
            event.counts,
            event.board_s,
            event.rate_counts_s,
        )
        now_s = self._clock.now_s()
        if reading.refused:
            self._refuse_reading(event, reading)
            self._act(now_s)
            return
        dt_s = 0.0 if self._board_s is None else event.board_s - self._board_s
        self._board_s = event.board_s
        self._keeper.watch_wheels(now_s, self._drive.effort(self._state), reading.travel_rad, dt_s)
        self._regulate(now_s, reading, dt_s)
        self._send_duty(self._state.duty)
        self.steps += 1
        self._keeper.announce(now_s)
        self._publish(event, reading)

    def _regulate(self, now_s: float, reading: encoder.Reading, dt_s: float) -> None:
        decision = self._decide(now_s)
        if decision.halted:
            self._state = self._drive.halt(self._state)
            return
        apart = decision.limited_by is not None
        self._state = self._drive.regulate(
            self._state, decision.twist, now_s, reading.velocity_rad_s, dt_s, apart=apart
        )

    def _refuse_reading(self, event: EncodersCounted, reading: encoder.Reading) -> None:
        self.readings_refused += 1
        if reading.unconfirmed:  # no fault of anyone's until the next reading has spoken
            return
        self._keeper.note_jump(reading.jumped)
        names = [self._wheels[index].name for index in reading.jumped]
        self._jump_log.warning(
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
            apart = decision.limited_by is not None
            self._state = self._drive.retarget(self._state, decision.twist, now_s, apart=apart)
        if repeat or self._state.duty != before:
            self._send_duty(self._state.duty)
        self._keeper.announce(now_s)

    def _decide(self, now_s: float) -> Decision:
        self.acted_s = now_s
        return self._keeper.decide(now_s, driven=self.is_driving)

    # Faults

    def _obey(self, now_s: float) -> None:
        """Act on a call from outside, which hears of an error as well."""
        try:
            self._act(now_s)
        except Exception as error:
            self._on_internal_error(error)
            raise

    def _on_link(self, event: LinkOpened | LinkClosed | BoardRestarted) -> None:
        if isinstance(event, BoardRestarted):
            self._encoders = encoder.rebase(self._encoders)
            self._board_s = None
        if not isinstance(event, LinkOpened):
            self._halt()
        self._keeper.on_link(event)
        self._act(self._clock.now_s())

    def _on_internal_error(self, error: Exception) -> None:
        self.internal_errors += 1
        reason = f"the control loop failed and is stopped: {error!r}; its log says where"
        self._keeper.fail(Fault(FaultKind.INTERNAL_ERROR, reason))
        self._halt()
        self._keeper.announce(self._clock.now_s())

    def _halt(self) -> None:
        self._state = self._drive.halt(self._state)
        self._send_duty(self._state.duty)


def _changed(old: PidParameters, changes: Mapping[str, object]) -> PidParameters:
    try:
        return PidParameters.model_validate(old.model_dump() | dict(changes))
    except ValidationError as error:
        told = "; ".join(f"{'.'.join(map(str, e['loc']))}={e['input']!r}: {e['msg']}" for e in error.errors())
        raise Refused(RefusalKind.OUT_OF_RANGE, told) from error
