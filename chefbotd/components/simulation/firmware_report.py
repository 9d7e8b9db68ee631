"""What our own firmware sends in each cycle: a model of ``firmware/core/report.c``."""

from collections.abc import Callable

from msgspec import Struct

from chefbotd.components.simulation.firmware_lines import FirmwarePrinter, FirmwareReceiver
from chefbotd.components.simulation.firmware_motors import FirmwareMotors, MotorsState
from firmware_protocol.codec import PUBLISHED_BANNER, PUBLISHED_FAILURES

CLASSIC_US, CHECKED_US = 20_000, 10_000
CLASSIC_CYCLES, CHECKED_CYCLES = 50, 100
MOTION_BYTES, CLASSIC_BYTES = 90, 130
LATE_US = 1000
STALL_MS = 500
UINT16_SPAN, UINT32_SPAN = 1 << 16, 1 << 32


class Readings(Struct):
    """The newest reading of each sensor; what is new was not told yet."""

    distance_cm: int = 0
    distance_us: int = 0
    is_new_distance: bool = False
    imu: tuple[int, ...] | None = None
    imu_us: int = 0
    is_new_imu: bool = False
    battery_level: int = 0
    has_battery: bool = False
    current: dict[int, int] = {}
    current_limit: int = 0
    above_ms: dict[int, int] = {}

    def find_stall(self, cycle_ms: int) -> bool:
        """Whether a motor has now been above the limit for half a second."""
        is_stalled = False
        for wheel, adc in self.current.items():
            is_above = 0 < self.current_limit < adc
            above_ms = self.above_ms.get(wheel, 0) + cycle_ms if is_above else 0
            is_stalled |= above_ms >= STALL_MS
            self.above_ms[wheel] = 0 if above_ms >= STALL_MS else above_ms
        return is_stalled


class Counters(Struct):
    """What was damaged, refused and late; who receives counts lost bytes, and the motors the dead-man's stops."""

    crc: int = 0
    refused: int = 0
    gaps: int = 0
    late: int = 0


class Report:
    """The cycles of the program; ``named`` are the fields of the line in which it names itself."""

    def __init__(
        self,
        printer: FirmwarePrinter,
        receiver: FirmwareReceiver,
        motors: FirmwareMotors,
        counts: Callable[[], list[int]],
        named: tuple[int, ...],
        now_us: int,
        *,
        has_imu: bool,
    ) -> None:
        self._printer, self._receiver, self._motors = printer, receiver, motors
        self._counts, self._named = counts, named
        self.readings, self.counters = Readings(), Counters()
        self._reported = MotorsState()
        self._previous_us = now_us
        self.is_checked = False
        self.begin(False, now_us)
        imu = PUBLISHED_BANNER[-1] if has_imu else PUBLISHED_FAILURES[0]
        printer.plain("".join(f"{text}\r\n" for text in (*PUBLISHED_BANNER[:-1], imu)))
        self._name_itself()

    def begin(self, is_checked: bool, at_us: int) -> None:
        """The first cycle of a mode comes a period later."""
        self.is_checked = is_checked
        self.due_us = at_us + (CHECKED_US if is_checked else CLASSIC_US)
        self._number, self._state_due = 0, True

    def run(self, now_us: int) -> None:
        """A cycle that is due."""
        period_us = CHECKED_US if self.is_checked else CLASSIC_US
        late_us = now_us - self.due_us
        self.counters.late += late_us >= LATE_US
        self.due_us = (now_us if late_us >= period_us else self.due_us) + period_us
        if self.readings.find_stall(period_us // 1000):
            self._motors.stall()
        if self.is_checked:
            self._send_checked(now_us)
        elif self._printer.has_room(CLASSIC_BYTES):
            self._send_classic(now_us)
        self._previous_us = now_us
        self._number = (self._number + 1) % (CHECKED_CYCLES if self.is_checked else CLASSIC_CYCLES)

    def _name_itself(self) -> None:
        self._printer.plain("\t".join(["firmware", *map(str, self._named)]) + "\n")

    def _send_classic(self, now_us: int) -> None:
        readings, plain = self.readings, self._printer.plain
        hundredths = (now_us - self._previous_us + 5000) // 10_000
        plain(f"t\t{now_us % UINT32_SPAN}\t{hundredths // 100}.{hundredths % 100:02d}\n")
        plain("\t".join(["e", *map(str, self._counts())]) + "\n")
        plain(f"u\t{readings.distance_cm}\n")
        plain("\t".join(["s", *(f"{duty}.00" for duty in self._motors.duty)]) + "\n")
        if readings.imu is not None:
            plain("\t".join(["i", *map(str, readings.imu)]) + "\r\n\n")
        plain(f"b\t{readings.battery_level}.00\n")
        if self._number == CLASSIC_CYCLES - 1:
            self._name_itself()

    def _send_checked(self, now_us: int) -> None:
        state, sealed = self._motors.state, self._printer.sealed
        if self._printer.has_room(MOTION_BYTES):
            thousandths = (now_us - self._previous_us + 500) // 1000
            sealed("t", now_us % UINT32_SPAN, f"{thousandths // 1000}.{thousandths % 1000:03d}")
            sealed("e", *self._counts())
            sealed("s", *state.duty, state.of)
        reported = self._reported
        is_changed = (state.mode, state.stops, state.estop) != (reported.mode, reported.stops, reported.estop)
        is_due = is_changed or self._state_due or self._number % 20 == 2
        if is_due and sealed("state", state.mode, int(state.stops), state.estop, self._named[-1]):
            self._reported, self._state_due = state, False
        self._send_readings(now_us)

    def _send_readings(self, now_us: int) -> None:
        readings, sealed, number = self.readings, self._printer.sealed, self._number
        if readings.is_new_distance and number % 5 == 3:
            age_us = now_us - readings.distance_us
            readings.is_new_distance = not sealed("u", readings.distance_cm, age_us)
        if readings.imu is not None and readings.is_new_imu and number % 4 == 1:
            readings.is_new_imu = not sealed("i", *readings.imu, now_us - readings.imu_us)
        if readings.has_battery and number % 20 == 4:
            sealed("b", readings.battery_level)
        for wheel, adc in readings.current.items():
            if number % 10 == 6 * wheel:
                sealed("a", wheel, adc)
        if number == 14:
            counted, deadman = self.counters, self._motors.deadman_stops
            figures = (
                counted.crc,
                counted.refused,
                self._receiver.overrun,
                counted.gaps,
                deadman,
                counted.late,
            )
            sealed("counters", *[figure % UINT16_SPAN for figure in figures])
