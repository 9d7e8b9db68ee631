"""The program of our own firmware: a model of ``firmware/core`` in both its modes (docs/firmware_wire.md).

It holds no clock and knows no robot: ``BoardHardware`` is what a board provides. It is held to the golden
conversations of the real one (``tests/vectors/firmware``).
"""

from typing import Protocol

from chefbotd.components.simulation.firmware_lines import (
    ESTOP,
    SEAL_CHARACTERS,
    FirmwarePrinter,
    FirmwareReceiver,
    FirmwareRequest,
    Line,
    Seal,
    parse,
    seal_of,
)
from chefbotd.components.simulation.firmware_loop import (
    MOST_EDGES_S,
    MOST_SPEED_MRAD_S,
    RANGES,
    Edges,
    FirmwareWheelLoop,
    Parameter,
)
from chefbotd.components.simulation.firmware_motors import (
    LATCHED,
    TICK_US,
    UINT32_SPAN,
    CommandOutcome,
    CommandReceipt,
    FirmwareMotors,
    Kept,
    next_tick_us,
)
from chefbotd.components.simulation.firmware_report import Report
from firmware_protocol.checked import PROTO, SEQUENCE_SPAN

VERSION = 0, 1
EDGES_A_PERIOD, BUILD = 4, 0
HOST_BOARD = 4
WHEEL_LOOP, ULTRASONIC, IMU, BATTERY, MOTOR_CURRENT = 1, 2, 4, 8, 16
POWER_ON, RESET_PIN, COMMAND = 1, 2, 5

SILENCE_US = 2_000_000
RESET_DELAY_US = 50_000
DEADMAN_MS = 50, 2000
PING_US = 50_000
ECHO_US_PER_CM = 58
NO_SEQUENCE = 255
INT16 = -(1 << 15), (1 << 15) - 1

WORD, COUNT, RANGE, STOPPED, NOT_SET_UP, ESTOP_NUMBER, UNKNOWN_PROTO = range(1, 8)
"""Why a line is refused."""

STALE = 0
"""A line that came too late is not answered."""

REFUSED_MOTIONS = {CommandOutcome.OBEYED: None, CommandOutcome.STOPPED: STOPPED, CommandOutcome.STALE: STALE}


class BoardHardware(Protocol):
    """What a board provides."""

    def write_motors(self, duty: tuple[int, ...]) -> None:
        """Put a duty on the motors."""

    def edges(self) -> Edges:
        """Each wheel's count, and the time of its newest edge."""
        ...

    def trigger_ultrasonic(self, now_us: int) -> None:
        """Ask the ultrasonic sensor; its answer comes by ``FirmwareProgram.echo``."""

    def send(self, data: bytes) -> None:
        """Put bytes on the wire."""

    def room_bytes(self) -> int:
        """How many more bytes may be sent now."""
        ...

    def restart(self) -> None:
        """Start the program anew: this one is over."""


class FirmwareProgram:
    """From a start at ``now_us`` for ``cause``; call ``run`` at ``next_us`` at the latest, and ``receive`` with bytes.

    ``readings`` are those of the sensors, which the board keeps up to date; ``kept`` outlives a restart.
    """

    def __init__(
        self,
        hardware: BoardHardware,
        kept: Kept,
        now_us: int,
        cause: int,
        *,
        wheels: int = 2,
        board: int = HOST_BOARD,
        capabilities: int = 0,
        has_imu: bool = True,
    ) -> None:
        self._hardware, self._wheels = hardware, wheels
        self._has_loop = bool(capabilities & WHEEL_LOOP)
        self._has_ultrasonic = bool(capabilities & ULTRASONIC)
        self.motors = FirmwareMotors(
            hardware.write_motors, kept, FirmwareWheelLoop(hardware.edges, wheels), wheels
        )
        self._printer, self.receiver = FirmwarePrinter(hardware.send, hardware.room_bytes), FirmwareReceiver()
        self._at_start = tuple([count for count, _ in hardware.edges()])
        named = PROTO, *VERSION, board, capabilities, cause
        self._report = Report(
            self._printer, self.receiver, self.motors, self._counts, named, now_us, has_imu=has_imu
        )
        self.readings, self.counters = self._report.readings, self._report.counters
        self._expected, self._valid_us = 0, 0
        self._reset_us: int | None = None
        self._ticked_us = self._passed_us = now_us
        self._rose_us: int | None = None
        self._pinged_us, self._awaits_echo = now_us, False

    @property
    def is_checked(self) -> bool:
        """Whether the checked mode is in force."""
        return self._report.is_checked

    def _counts(self) -> list[int]:
        """Encoder counts since the start, as int32."""
        counts = zip(self._hardware.edges(), self._at_start, strict=True)
        half = UINT32_SPAN // 2
        return [(count - start + half) % UINT32_SPAN - half for (count, _), start in counts]

    # Time

    def next_us(self) -> int:
        """When something is due next."""
        if self._reset_us is not None:
            return self._reset_us
        due_us = [self._report.due_us]
        if self.motors.deadman_due_us is not None:
            due_us.append(max(self.motors.deadman_due_us, next_tick_us(self._passed_us + 1)))
        if self.is_checked:
            due_us.append(self._valid_us + SILENCE_US)
        if self._has_ultrasonic:
            due_us.append(self._pinged_us + PING_US)
        if self.motors.loop.is_set_up:
            due_us.append(next_tick_us(self._passed_us + 1))
        return min(due_us)

    def run(self, now_us: int) -> None:
        """Do what is due by now: the tick, and a pass of the main loop."""
        if now_us > self._ticked_us and not now_us % UINT32_SPAN % TICK_US:
            self._ticked_us = now_us
            self.motors.tick(now_us)
        self._passed_us = now_us
        self.motors.hear(self.receiver.estops)
        if self._reset_us is not None:
            if now_us >= self._reset_us:
                self._hardware.restart()
            return
        self._take_lines(now_us)
        if self.is_checked and now_us - self._valid_us >= SILENCE_US:
            self.motors.end_deadman()
            self._report.begin(False, self._valid_us + SILENCE_US)
        if self._has_ultrasonic and now_us - self._pinged_us >= PING_US:
            self._ping(now_us)
        if now_us >= self._report.due_us:
            self._report.run(now_us)

    # Sensors

    def echo(self, rising: bool, now_us: int) -> None:
        """The ultrasonic sensor's line rises or falls."""
        if rising:
            self._rose_us = now_us
        elif self._rose_us is not None:
            if self._awaits_echo:
                self._note_distance((now_us - self._rose_us) // ECHO_US_PER_CM, now_us)
            self._rose_us = None

    def _ping(self, now_us: int) -> None:
        self._pinged_us = now_us
        if self._awaits_echo:
            self._note_distance(0, now_us)
        if self._rose_us is None:
            self._awaits_echo = True
            self._hardware.trigger_ultrasonic(now_us)

    def _note_distance(self, distance_cm: int, at_us: int) -> None:
        readings = self.readings
        readings.distance_cm, readings.distance_us, readings.is_new_distance = distance_cm, at_us, True
        self._awaits_echo = False

    # What comes in

    def receive(self, data: bytes, now_us: int) -> None:
        """Bytes that came in now; ``run`` is to follow, which reads the lines."""
        self.receiver.receive(data, now_us)

    def _take_lines(self, now_us: int) -> None:
        while self._reset_us is None and (line := self.receiver.next_line(now_us)) is not None:
            self._take_line(line, now_us)
        self.counters.refused += self.receiver.cut_lines
        self.receiver.cut_lines = 0

    def _take_line(self, line: Line, now_us: int) -> None:
        seal = seal_of(line.text)
        if line.text.endswith(ESTOP):
            return  # the receive interrupt has heard it
        if line.is_damaged:
            self.counters.refused += 1
        elif seal is Seal.NONE:
            self._take_plain(line, now_us)
        elif seal is Seal.GOOD and not line.has_line_feed:
            self._take_sealed(parse(line.text[:-SEAL_CHARACTERS]), line.at_us, now_us)
        else:
            self.counters.crc += 1

    def _take_plain(self, line: Line, now_us: int) -> None:
        request = parse(line.text)
        is_allowed = line.text == self._stop_line if self.is_checked else request.word in ("s", "r")
        is_complete = len(request.numbers) == self._count_of(request.word)
        if (
            not is_allowed
            or not is_complete
            or self._obey_request(request, CommandReceipt(line.at_us), now_us) is not None
        ):
            self.counters.refused += 1

    @property
    def _stop_line(self) -> bytes:
        return b" ".join([b"s", *[b"0"] * self._wheels])

    def _count_of(self, word: str) -> int:
        return self._wheels if word in ("s", "w") else {"g": 2, "hello": 2, "arm": 1}.get(word, 0)

    def _take_sealed(self, request: FirmwareRequest, at_us: int, now_us: int) -> None:
        sequence, self._valid_us = request.sequence, at_us
        if self.is_checked and sequence is not None and request.word != "hello":
            self.counters.gaps += (sequence - self._expected) % SEQUENCE_SPAN
            self._expected = (sequence + 1) % SEQUENCE_SPAN
        refusal: int | None
        if not self._is_known(request.word):
            refusal = WORD
        elif len(request.numbers) != self._count_of(request.word) + 1:
            refusal = COUNT
        elif sequence is None:
            refusal = RANGE
        else:
            refusal = self._obey_request(request, CommandReceipt(at_us, sequence), now_us)
        if refusal is not None:
            self.counters.refused += 1
        if refusal:
            self._printer.sealed("refused", refusal, NO_SEQUENCE if sequence is None else sequence)

    def _is_known(self, word: str) -> bool:
        if word == "w" and not self._has_loop:
            return False
        return word != "" and (self.is_checked or word not in ("s", "w", "g"))

    def _obey_request(self, request: FirmwareRequest, received: CommandReceipt, now_us: int) -> int | None:
        """Obey a request with the right number of numbers; why not, or None."""
        numbers = request.numbers
        match request.word:
            case "s":
                return self._take_duty(numbers[: self._wheels], received, now_us)
            case "w":
                return self._take_speeds(numbers[: self._wheels], received, now_us)
            case "g":
                return self._take_parameter(numbers[0], numbers[1])
            case "arm":
                return None if self.motors.arm(numbers[0]) else ESTOP_NUMBER
            case "r":
                self.motors.set_duty((0,) * self._wheels, CommandReceipt(received.at_us), now_us)
                self._reset_us = received.at_us + RESET_DELAY_US
                self._printer.plain("Reset Done\r\n")
            case "hello":
                return self._take_hello(numbers[0], numbers[1], received)
            case "about":
                self._printer.sealed(
                    "about", EDGES_A_PERIOD, MOST_EDGES_S, BUILD, self.motors.loop.counts_per_turn
                )
            case "estop":
                self.motors.estop()
            case _:
                return WORD
        return None

    def _take_duty(self, duty: tuple[int, ...], received: CommandReceipt, now_us: int) -> int | None:
        if not all(INT16[0] <= value <= INT16[1] for value in duty):
            return RANGE
        return REFUSED_MOTIONS[self.motors.set_duty(duty, received, now_us)]

    def _take_speeds(self, mrad_s: tuple[int, ...], received: CommandReceipt, now_us: int) -> int | None:
        if not all(abs(speed) <= MOST_SPEED_MRAD_S for speed in mrad_s):
            return RANGE
        if not self.motors.loop.is_set_up:
            return STOPPED if self.motors.stops & LATCHED else NOT_SET_UP
        if not all(abs(speed) <= self.motors.loop.most_mrad_s for speed in mrad_s):
            return RANGE
        return REFUSED_MOTIONS[self.motors.set_speeds(mrad_s, received, now_us)]

    def _take_parameter(self, parameter: int, value: int) -> int | None:
        if parameter not in list(Parameter):
            return RANGE
        least, most = RANGES[Parameter(parameter)]
        if not least <= value <= most:
            return RANGE
        if parameter == Parameter.CURRENT:
            self.readings.current_limit = value
        else:
            self.motors.loop.set(Parameter(parameter), value)
        self._printer.sealed("g", parameter, value)
        return None

    def _take_hello(self, proto: int, deadman_ms: int, received: CommandReceipt) -> int | None:
        if proto != PROTO:
            return UNKNOWN_PROTO
        if not DEADMAN_MS[0] <= deadman_ms <= DEADMAN_MS[1]:
            return RANGE
        self.motors.begin_deadman(deadman_ms * 1000, received.at_us)
        if not self.is_checked:
            self._report.begin(True, received.at_us)
        sequence = received.sequence or 0
        self._expected = (sequence + 1) % SEQUENCE_SPAN
        self._printer.sealed("hello", PROTO, deadman_ms, received.at_us % UINT32_SPAN, sequence)
        return None
