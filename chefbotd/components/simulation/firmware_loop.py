"""The wheel loop of our own firmware: a model of ``firmware/core/wheel_loop.c``, number by number."""

from collections import deque
from collections.abc import Callable, Sequence
from enum import IntEnum

from msgspec import Struct

EDGES_KEPT = 5
PERIOD_EDGES = 4
SILENT_EDGES = 2
WINDOW_US = 10_000
STANDSTILL_US = 250_000
MOST_MEASURED = 100_000
MOST_INTEGRATED = 12_500
MOST_SPEED_MRAD_S = 50_000
MOST_DRIVE = 65_280
INTEGRAL_SCALE = 4096
HALF_TURN_NANORAD = 3_141_592_654
UINT32_MAX = (1 << 32) - 1
RAMP_SCALE = 1024
TURN_MRAD = 6283
LEAST_LOST_DUTY, LOST_DUTY_MS, LEAST_PROGRESS = 128, 63_750, 2
MOST_EDGES_S = 100_000
"""Of one wheel: what the host build counts."""

Edges = Sequence[tuple[int, int]]
"""Of each wheel: its count, and the time of its newest edge in microseconds."""


class Parameter(IntEnum):
    """What ``g`` sets."""

    COUNTS = 0
    KP = 1
    KI = 2
    FEEDFORWARD = 3
    STATIC = 4
    ACCELERATION = 5
    CURRENT = 6
    BATTERY = 7


RANGES = {
    Parameter.COUNTS: (64, 65535),
    Parameter.KP: (0, 20000),
    Parameter.KI: (0, 500000),
    Parameter.FEEDFORWARD: (0, 20000),
    Parameter.STATIC: (0, 65280),
    Parameter.ACCELERATION: (0, 1000000),
    Parameter.CURRENT: (0, 4095),
    Parameter.BATTERY: (64, 1024),
}
NEEDED = frozenset(range(Parameter.ACCELERATION))


def divide_like_c(value: int, by: int) -> int:
    """As C divides: towards zero."""
    return value // by if (value < 0) == (by < 0) else -(-value // by)


def between(value: int, most: int) -> int:
    """The value, limited in both directions."""
    return max(-most, min(most, value))


def binary(value: int) -> int:
    """From thousandths to 1/1024."""
    return (value * 128 + 62) // 125


class _Wheel(Struct):
    edges: deque[tuple[int, int]]
    aim: int = 0
    ramp: int = 0
    integral: int = 0
    lost_duty_ms: int = 0
    lost_count: int = 0


class FirmwareWheelLoop:
    """A speed control of each wheel, a step each millisecond; ``edges`` reads the encoders.

    ``lost`` are the wheels that their duty has not turned its way for a while: 1 for a left one, 2 for a right one.
    """

    def __init__(self, edges: Callable[[], Edges], wheels: int) -> None:
        self._edges = edges
        self._set: dict[Parameter, int] = {Parameter.BATTERY: 256}
        self._wheels = [_Wheel(deque(maxlen=EDGES_KEPT)) for _ in range(wheels)]
        self._now_us, self._is_beginning, self.lost = 0, False, 0
        for wheel in self._wheels:
            self._stand(wheel, 0)

    @property
    def is_set_up(self) -> bool:
        """Whether counts and gains are known."""
        return self._set.keys() >= NEEDED

    def set(self, parameter: Parameter, value: int) -> None:
        """Give a parameter its value."""
        self._set[parameter] = value

    @property
    def counts_per_turn(self) -> int:
        """The counts of a wheel's turn that were set; 0: none."""
        return self._set.get(Parameter.COUNTS, 0)

    @property
    def most_mrad_s(self) -> int:
        """The fastest that can be asked for: no wheel has more than ``MOST_EDGES_S`` then."""
        return MOST_EDGES_S * TURN_MRAD // self._set[Parameter.COUNTS]

    def begin(self) -> None:
        """From the speed that the wheels have at the next millisecond."""
        self._is_beginning = True

    def aim(self, mrad_s: Sequence[int]) -> None:
        """Set each wheel's speed."""
        for wheel, speed in zip(self._wheels, mrad_s, strict=True):
            wheel.aim = speed

    def measure(self, now_us: int) -> None:
        """Note the edges of the last millisecond."""
        self._now_us = now_us
        for wheel, (count, edge_us) in zip(self._wheels, self._edges(), strict=True):
            if count != wheel.edges[-1][1]:
                wheel.edges.append((edge_us, count))
            elif now_us - wheel.edges[-1][0] >= STANDSTILL_US:
                self._stand(wheel, count)

    def _stand(self, wheel: _Wheel, count: int) -> None:
        wheel.edges.extend([(self._now_us - STANDSTILL_US, count)] * EDGES_KEPT)

    def run(self) -> tuple[int, ...]:
        """A millisecond's duty of each wheel."""
        if self._is_beginning:
            for wheel in self._wheels:
                wheel.ramp = between(self._measured(wheel), MOST_SPEED_MRAD_S) * RAMP_SCALE
                wheel.integral = wheel.lost_duty_ms = 0
        self._is_beginning = False
        duties = tuple([self._run_wheel(wheel) for wheel in self._wheels])
        lost = [_is_lost(wheel, duty) for wheel, duty in zip(self._wheels, duties, strict=True)]
        self.lost = (1 if any(lost[::2]) else 0) + (2 if any(lost[1::2]) else 0)
        return duties

    def _run_wheel(self, wheel: _Wheel) -> int:
        step, aim = binary(self._set.get(Parameter.ACCELERATION, 0)), wheel.aim * RAMP_SCALE
        wheel.ramp = aim if not step else wheel.ramp + between(aim - wheel.ramp, step)
        target = divide_like_c(wheel.ramp, RAMP_SCALE)
        if not target:
            wheel.integral = 0
            return 0
        gain = {name: binary(self._set[name]) for name in (Parameter.KP, Parameter.FEEDFORWARD)}
        error = between(target - self._measured(wheel), MOST_MEASURED)
        friction = self._set[Parameter.STATIC] if target > 0 else -self._set[Parameter.STATIC]
        drive = divide_like_c(gain[Parameter.FEEDFORWARD] * target, RAMP_SCALE) + friction
        drive += divide_like_c(gain[Parameter.KP] * error, RAMP_SCALE) + divide_like_c(
            wheel.integral, INTEGRAL_SCALE
        )
        is_saturated = error > 0 if drive >= MOST_DRIVE else drive <= -MOST_DRIVE and error < 0
        if not is_saturated:
            gained = (self._set[Parameter.KI] * 4096 + 7812) // 15_625 * between(error, MOST_INTEGRATED)
            more = wheel.integral + divide_like_c(gained, 64)
            wheel.integral = between(more, MOST_DRIVE * INTEGRAL_SCALE)
        scaled = divide_like_c(between(drive, 4 * MOST_DRIVE) * self._set[Parameter.BATTERY], 256)
        compensated = between(scaled, MOST_DRIVE)
        return divide_like_c(compensated + (-128 if compensated < 0 else 128), 256)

    def _measured(self, wheel: _Wheel) -> int:
        """The speed by the edges of the last milliseconds that had some, in mrad/s."""
        newest_us, newest = wheel.edges[-1]
        silent_us = self._now_us - newest_us
        if silent_us >= STANDSTILL_US or Parameter.COUNTS not in self._set:
            return 0
        step, span_us = 0, 0
        for back, (at_us, count) in enumerate(reversed(list(wheel.edges)[:-1]), 1):
            if back > 1 and newest_us - at_us > WINDOW_US:
                break
            step, span_us = newest - count, newest_us - at_us
            if abs(step) >= PERIOD_EDGES:
                break
        if not step:
            return 0
        speed = min(self._speed(abs(step), span_us), self._speed(SILENT_EDGES, silent_us))
        return -speed if step < 0 else speed

    def _speed(self, counts: int, micros: int) -> int:
        """Counts over microseconds in mrad/s."""
        mrad_us = HALF_TURN_NANORAD // self._set[Parameter.COUNTS] * 2
        if not micros or counts > UINT32_MAX // mrad_us:
            return MOST_MEASURED
        return min(counts * mrad_us // micros, MOST_MEASURED)


def _is_lost(wheel: _Wheel, duty: int) -> bool:
    """Whether full duty has not turned a wheel its way for 250 ms, or half of it for 500."""
    if abs(duty) < LEAST_LOST_DUTY:
        wheel.lost_duty_ms = 0
        return False
    count = wheel.edges[-1][1]
    step = (count - wheel.lost_count) * (1 if duty > 0 else -1)
    if not wheel.lost_duty_ms or step >= LEAST_PROGRESS:
        wheel.lost_duty_ms, wheel.lost_count = 0, count
    wheel.lost_duty_ms += abs(duty)
    return wheel.lost_duty_ms > LOST_DUTY_MS
