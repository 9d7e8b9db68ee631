"""The sketch that runs on the simulated board, written in the order of the real program.

It prints, waits and loops: a generator that yields the time at which it goes on. So everything that blocks it (the
ultrasonic sensor, the motion processor, a full UART) delays all that follows, as on the board, and waiting costs
nothing. A motor command takes effect only after all waiting bytes have been read, and after the wait for the
ultrasonic echo: ``s 0 0`` and ``r`` that come together leave the motors running for the second that ``r`` takes. There
is no watchdog.

One program serves for every sketch (``sketches.py``). A sensor that is not wired to the board is not reported. A board
that decodes no encoders sends their edges before each ``t``.
"""

import math
from collections.abc import Callable, Generator, Iterator
from itertools import pairwise

import numpy as np

from chefbotd.components.simulation.chassis import Chassis
from chefbotd.components.simulation.parameters.simulation import SimImuParameters
from chefbotd.components.simulation.parameters.sketches import UINT32_SPAN, BoardParameters
from chefbotd.components.simulation.parameters.true import TrueImu
from chefbotd.components.simulation.peripherals import (
    CommandReader,
    CycleEdges,
    Edge,
    EdgeRecorder,
    MotionProcessor,
    Uart,
    pwm_share,
)
from chefbotd.components.simulation.robot import Robot
from chefbotd.components.simulation.sensors import Divider, Imu, Infrared, Ultrasonic, adc_counts
from chefbotd.core.record import Record
from firmware_protocol.codec import MOST_EDGES_A_LINE, MOST_TIMES_A_LINE, Variant, from_board
from firmware_protocol.messages import (
    AnalogueLevel,
    Banner,
    BatteryLevel,
    BoardTime,
    EncoderCounts,
    FromBoard,
    Orientation,
    QuadratureEdges,
    QuadratureStill,
    RawImu,
    ResetDone,
    SetDuty,
    UltrasonicDistance,
)


class Wiring(Record, frozen=True):
    """What the board is connected to, and the variant of the lines that it speaks."""

    robot: Robot
    chassis: Chassis
    ultrasonic: Ultrasonic | None
    imu: SimImuParameters | None
    divider: Divider
    variant: Variant
    infrared: tuple[Infrared, ...] = ()
    true_imu: TrueImu | None = None


SOUND_M_S = 343.0
SKETCH_US_PER_CM = 29
UINT16_SPAN = 1 << 16
INT32_LIMIT = 1 << 31


class Sketch:
    """The program on the board, from power-on at time 0. While it ``loses_echoes``, the sensor has nothing in reach."""

    def __init__(self, wiring: Wiring, parameters: BoardParameters, uart: Uart, seed: int) -> None:
        self._parameters, self._wiring, self._robot = parameters, wiring, wiring.robot
        self._encoder = from_board(wiring.variant)
        self.commands = CommandReader(wiring.variant.wheels)
        self._uart, self._chance = uart, np.random.default_rng(seed)
        chassis = wiring.chassis
        self._motor_signs = [wheel.motor_sign for wheel in chassis.wheels]
        per_rad = chassis.counts_per_turn / math.tau
        self._counts_per_rad = [wheel.encoder_sign * per_rad for wheel in chassis.wheels]
        self._now_s = self._started_s = self._previous_s = 0.0
        self._micros_at_start = parameters.boot_micros
        self._counts_at_boot = self._counted()
        self._imu: Imu | None = None
        self._processor: MotionProcessor | None = None
        if parameters.waits_for_imu and wiring.imu is not None and "i" in parameters.lines:
            self._processor = MotionProcessor(wiring.robot, parameters.cycle_s)
        self._edges: EdgeRecorder | None = None
        if wiring.variant.speaks(QuadratureEdges):
            self._edges = EdgeRecorder(self._counts_per_rad, parameters.edge_buffer)
            wiring.robot.watch(self._edges.watch)
        self.loses_echoes = False
        self.duty: tuple[int, ...] = (0,) * len(self._counts_at_boot)
        self._asked = self.duty
        reporters: dict[str, Callable[[], Iterator[float]]] = {
            "t": self._report_time,
            "e": self._report_encoders,
            "u": self._report_ultrasonic,
            "s": self._drive_and_report,
            "i": self._report_imu,
            "a": self._report_infrared,
            "b": self._report_battery,
        }
        self._cycle = [reporters[kind] for kind in parameters.lines]

    next_s = math.inf
    """When it is to continue, if that is sooner than it said: bytes that come in change nothing."""

    def receive(self, at_s: float) -> None:
        """Bytes have come into the UART: they are read when the next cycle begins."""

    def run(self) -> Iterator[float]:
        """Run for ever; yields the time at which to continue."""
        while True:
            yield from self._boot()
            yield from self._loop_until_reset()
            self._micros_at_start = 0

    def _boot(self) -> Iterator[float]:
        """From the reset pin to the end of the banner: open bridges until the sketch drives them."""
        self._started_s = self._now_s
        self._robot.release()
        yield from self._wait(self._parameters.boot_s)
        self._uart.read()
        self.commands.reset()
        self._asked = (0,) * len(self.duty)
        self._drive_motors(self._asked)
        self._counts_at_boot = self._counted()
        if self._wiring.imu is not None:
            self._imu = Imu(self._wiring.imu, self._now_s, self._robot.motion, self._wiring.true_imu)
        if self._processor is not None:
            self._processor.start(self._now_s)
        if self._edges is not None:
            self._edges.boot(self._now_s)
        for text in self._wiring.variant.banner if self._parameters.has_banner else ():
            yield from self._print(Banner(text))

    def _loop_until_reset(self) -> Iterator[float]:
        self._previous_s = self._now_s
        while not (yield from self._told_to_reset()):
            began_s = self._now_s
            for report in self._cycle:
                yield from report()
            self._previous_s = began_s
            if self._processor is None:
                yield from self._wait(began_s + self._parameters.cycle_s - self._now_s)

    def _told_to_reset(self) -> Generator[float, None, bool]:
        """Read all waiting bytes; those behind a reset are lost."""
        while data := self._uart.read():
            for command in self.commands.feed(data):
                if isinstance(command, SetDuty):
                    self._asked = command.duty
                    continue
                yield from self._print(ResetDone())
                yield from self._wait(self._parameters.reset_delay_s)
                if self._parameters.resets:
                    return True
        return False

    # The lines of a cycle

    def _report_time(self) -> Iterator[float]:
        """The time at which the edges were taken, however long it takes to print them."""
        taken_s = self._now_s
        if self._edges is not None:
            yield from self._print_edges(self._edges.take_edges(taken_s))
        yield from self._print(BoardTime(self._micros(taken_s), taken_s - self._previous_s))

    def _report_encoders(self) -> Iterator[float]:
        if self._edges is None:
            yield from self._print(EncoderCounts(self._counts()))

    def _report_ultrasonic(self) -> Iterator[float]:
        """Wait for the echo, as the sketch does, until it is back or the time-out."""
        if self._wiring.ultrasonic is None:
            return
        distance_m = self._wiring.ultrasonic.distance_m(self._robot.state.world_from_base, self._chance)
        timeout_s = self._parameters.echo_timeout_s
        echo_s = math.inf if distance_m is None or self.loses_echoes else 2 * distance_m / SOUND_M_S
        if self._parameters.blocking_ultrasonic:
            yield from self._wait(min(echo_s, timeout_s))
        heard = echo_s <= timeout_s
        yield from self._print(UltrasonicDistance(int(echo_s * 1e6) // SKETCH_US_PER_CM // 2 if heard else 0))

    def _drive_and_report(self) -> Iterator[float]:
        self._drive_motors(self._asked)
        echo = "\t".join(
            ["s", *(f"{duty:.2f}" for duty in self.duty)]
        )  # also of what the wire's table has no room for
        yield from self._send(echo.encode() + b"\n")

    def _report_imu(self) -> Iterator[float]:
        if self._imu is None:
            return
        felt_s, motion = self._now_s, self._robot.motion
        if self._processor is not None:
            yield from self._wait(self._processor.ready_s - self._now_s)
            sample = self._processor.read(self._now_s)
            if sample is None:
                return
            felt_s, motion = sample.at_s, sample.motion
        if self._parameters.raw_imu:
            yield from self._print(RawImu(*self._imu.counts(motion, self._chance)))
            return
        quaternion, luck = self._imu.orientation(motion, felt_s, self._chance), self._chance.random()
        if luck >= self._parameters.missing_imu_share:
            yield from self._print(Orientation(*quaternion))

    def _report_infrared(self) -> Iterator[float]:
        for sensor in self._wiring.infrared:
            level = self._resolved(sensor.adc_counts(self._robot.state.world_from_base, self._chance))
            yield from self._print(AnalogueLevel(sensor.channel, float(level)))

    def _report_battery(self) -> Iterator[float]:
        state = self._robot.state
        noise = float(self._chance.standard_normal()) * state.battery.parameters.adc_noise_counts
        counts = self._resolved(adc_counts(state.terminal_v, self._wiring.divider, noise))
        yield from self._print(BatteryLevel(float(counts)))

    def _resolved(self, counts: int) -> int:
        """The reading of this board's ADC, from one of 12 bits."""
        bits = self._parameters.adc_bits
        return counts >> 12 - bits if bits <= 12 else counts << bits - 12

    def _print_edges(self, wheels: list[CycleEdges]) -> Iterator[float]:
        """Every wheel's edges, as many a line as one holds; a line without any where it stood."""
        for wheel, cycle in enumerate(wheels):
            total, edges = cycle.total, cycle.edges
            if not edges:
                yield from self._print(QuadratureStill(wheel, total % UINT16_SPAN))
            before = total - len(edges)
            for start in range(0, len(edges), MOST_EDGES_A_LINE):
                line = edges[start : start + MOST_EDGES_A_LINE]
                yield from self._print(self._burst(wheel, before + start + len(line), line))

    def _burst(self, wheel: int, total: int, edges: list[Edge]) -> QuadratureEdges:
        micros = [self._micros(edge.at_s) for edge in edges[-MOST_TIMES_A_LINE:]]
        gaps_us = tuple((after - before) % UINT32_SPAN for before, after in pairwise(micros))
        levels = tuple(edge.levels for edge in edges)
        return QuadratureEdges(wheel, total % UINT16_SPAN, levels, micros[-1], gaps_us)

    def _drive_motors(self, duty: tuple[int, ...]) -> None:
        self.duty = duty
        law, full_scale = self._parameters.pwm_law, self._parameters.pwm_full_scale
        wheels = zip(duty, self._motor_signs, strict=True)
        self._robot.drive([sign * pwm_share(law, full_scale, value) for value, sign in wheels])

    def _micros(self, at_s: float) -> int:
        """Microseconds since the board started, in its 32-bit counter."""
        return (self._micros_at_start + int((at_s - self._started_s) * 1e6)) % UINT32_SPAN

    def _counted(self) -> tuple[int, ...]:
        """Encoder edges since power-on."""
        turned = zip(self._robot.wheel_angles_rad, self._counts_per_rad, strict=True)
        return tuple([math.floor(angle * per_rad) for angle, per_rad in turned])

    def _counts(self) -> tuple[int, ...]:
        """Encoder edges since the board booted, as int32."""
        pairs = zip(self._counted(), self._counts_at_boot, strict=True)
        return tuple((now - boot + INT32_LIMIT) % UINT32_SPAN - INT32_LIMIT for now, boot in pairs)

    def _print(self, message: FromBoard) -> Iterator[float]:
        """Pass a line to the UART; the sketch continues when the line fits the transmit buffer."""
        yield from self._send(self._encoder.encode(message))

    def _send(self, line: bytes) -> Iterator[float]:
        go_on_s = self._uart.send(line, self._now_s)
        yield from self._wait(go_on_s - self._now_s)

    def _wait(self, duration_s: float) -> Iterator[float]:
        if duration_s > 0:
            self._now_s += duration_s
            yield self._now_s
            self._robot.advance(self._now_s)
