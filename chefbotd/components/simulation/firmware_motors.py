"""What our own firmware puts on the motors, and what stops them: a model of ``firmware/core/motors.c``."""

from collections.abc import Callable
from enum import Enum, IntFlag

from msgspec import Struct

from chefbotd.components.simulation.firmware_loop import FirmwareWheelLoop
from chefbotd.core.record import Record

FULL_DUTY = 255
NO_SEQUENCE = 255
UINT16_SPAN, UINT32_SPAN = 1 << 16, 1 << 32
TICK_US = 1000


class Stops(IntFlag):
    """The stops in force."""

    NONE = 0
    DEAD_MAN = 1
    ESTOP = 2
    STALL = 4
    LEFT_LOST = 8
    RIGHT_LOST = 16
    LEFT_STORM = 32
    RIGHT_STORM = 64


OF_WHEELS = Stops.LEFT_LOST | Stops.RIGHT_LOST | Stops.LEFT_STORM | Stops.RIGHT_STORM
LATCHED = Stops.ESTOP | Stops.STALL | OF_WHEELS
DUTY_MODE, LOOP_MODE = 1, 2


def next_tick_us(at_us: int) -> int:
    """The first whole millisecond of the board's clock that is not before this time."""
    since_wrap_us = at_us % UINT32_SPAN
    return at_us - since_wrap_us + -(-since_wrap_us // TICK_US) * TICK_US


class CommandOutcome(Enum):
    """What became of a command."""

    OBEYED = 0
    STOPPED = 1
    STALE = 2


class CommandReceipt(Record, frozen=True):
    """When a command came in, and its sequence number (None: it has none)."""

    at_us: int
    sequence: int | None = None


class Kept(Struct):
    """What a restart that is not a power-on leaves as it is."""

    estop: int = 0
    is_stopped: bool = False


class MotorsState(Record, frozen=True):
    """The duty in force, the mode, the stops, and the newest e-stop; ``of`` is the last command that was obeyed."""

    duty: tuple[int, ...] = (0, 0)
    mode: int = DUTY_MODE
    stops: Stops = Stops.NONE
    of: int = NO_SEQUENCE
    estop: int = 0


class FirmwareMotors:
    """``write`` puts a duty on the motors, ``kept`` has the e-stop over restarts."""

    def __init__(
        self, write: Callable[[tuple[int, ...]], None], kept: Kept, loop: FirmwareWheelLoop, wheels: int
    ) -> None:
        self._write, self._kept, self.loop = write, kept, loop
        self._still = (0,) * wheels
        self.duty, self.mode, self.of = self._still, DUTY_MODE, NO_SEQUENCE
        self.stops = Stops.ESTOP if kept.is_stopped else Stops.NONE
        self.deadman_us, self.fed_us = 0, 0
        self.deadman_stops = self._heard = 0
        self._set_duty(self._still)

    @property
    def state(self) -> MotorsState:
        """The state now."""
        return MotorsState(self.duty, self.mode, self.stops, self.of, self._kept.estop)

    def set_duty(self, duty: tuple[int, ...], received: CommandReceipt, now_us: int) -> CommandOutcome:
        """Duty for each wheel, limited. 0 for all is always obeyed, and ends a stall and what a wheel has stopped."""
        motion = self._accept_motion(not any(duty), received, now_us)
        if motion is CommandOutcome.OBEYED:
            self.mode = DUTY_MODE
            self._set_duty(tuple([max(-FULL_DUTY, min(FULL_DUTY, value)) for value in duty]))
        return motion

    def set_speeds(self, mrad_s: tuple[int, ...], received: CommandReceipt, now_us: int) -> CommandOutcome:
        """Speeds for the wheel loop."""
        motion = self._accept_motion(False, received, now_us)
        if motion is CommandOutcome.OBEYED:
            if self.mode != LOOP_MODE:
                self.loop.begin()
            self.mode = LOOP_MODE
            self.loop.aim(mrad_s)
        return motion

    def _accept_motion(self, is_stop: bool, received: CommandReceipt, now_us: int) -> CommandOutcome:
        is_stale = bool(self.deadman_us) and now_us - received.at_us >= self.deadman_us
        if is_stale and not is_stop:
            return CommandOutcome.STALE
        if is_stop:
            self.stops &= ~(Stops.STALL | OF_WHEELS)
        elif self.stops & LATCHED:
            return CommandOutcome.STOPPED
        if (received.sequence is not None and not is_stale) or not self.deadman_us:
            self.fed_us = received.at_us
            self.stops &= ~Stops.DEAD_MAN
        if received.sequence is not None:
            self.of = received.sequence
        return CommandOutcome.OBEYED

    def estop(self) -> None:
        """Latch, with the next number."""
        self._stop(Stops.ESTOP)
        self._kept.estop = (self._kept.estop + 1) % UINT16_SPAN or 1
        self._kept.is_stopped = True

    def hear(self, heard: int) -> None:
        """Latch for each e-stop that was heard since the last call, of so many since the start."""
        while self._heard < heard:
            self._heard += 1
            self.estop()

    def arm(self, number: int) -> bool:
        """End e-stop, stall and what a wheel has stopped; False if it is not the newest e-stop's number."""
        if number != self._kept.estop:
            return False
        self.stops &= Stops.DEAD_MAN
        self._kept.is_stopped = False
        return True

    def stall(self) -> None:
        """A motor has drawn too much current for too long."""
        self._stop(Stops.STALL)

    def begin_deadman(self, deadman_us: int, now_us: int) -> None:
        """Set the dead-man; where there was none, it counts from now."""
        if not self.deadman_us:
            self.fed_us, self.of = now_us, NO_SEQUENCE
        self.deadman_us = deadman_us

    def end_deadman(self) -> None:
        """No dead-man any more: stop as if it had come."""
        self.deadman_us = 0
        self._stop(Stops.DEAD_MAN)

    @property
    def deadman_due_us(self) -> int | None:
        """When the dead-man stops the motors; None: it does not, or has already."""
        has_come = not self.deadman_us or bool(self.stops & Stops.DEAD_MAN)
        return None if has_come else next_tick_us(self.fed_us + self.deadman_us)

    def tick(self, now_us: int) -> None:
        """A millisecond has passed."""
        self.loop.measure(now_us)
        due_us = self.deadman_due_us
        if due_us is not None and now_us >= due_us:
            self._stop(Stops.DEAD_MAN)
            self.deadman_stops += 1
        if self.mode == LOOP_MODE:
            duty = self.loop.run()
            if self.loop.lost:
                self._stop(Stops(self.loop.lost * Stops.LEFT_LOST))
            else:
                self._set_duty(duty)

    def _stop(self, stops: Stops) -> None:
        self.stops |= stops
        self.mode = DUTY_MODE
        self._set_duty(self._still)

    def _set_duty(self, duty: tuple[int, ...]) -> None:
        self.duty = duty
        self._write(duty)
