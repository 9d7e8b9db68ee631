"""The sketch that runs on the simulated board, written as the program it stands for.

It prints, waits and loops: a generator that yields the time at which it goes on. So whatever blocks it (the
ultrasonic sensor, a full UART) delays all that follows, as on the board, and waiting costs nothing. There is
no watchdog: a motor command stays in force for ever, also in the second between ``r`` and the reset.

The same program runs on other robots' boards: what is not wired to it is not reported, and a board that decodes no
encoders sends their edges before each ``t``.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.sim.battery import Divider, adc_counts
from chefbotd.sim.chassis import Chassis
from chefbotd.sim.infrared import Infrared
from chefbotd.sim.pwm import PwmLaw, pwm_share
from chefbotd.sim.quadrature import Edge, EdgeRecorder, Taken
from chefbotd.sim.robot import Robot
from chefbotd.sim.sensors import Imu, ImuParameters, Ultrasonic
from chefbotd.sim.uart import Uart
from firmware_protocol.codec import MOST_EDGES_A_LINE, MOST_TIMES_A_LINE, Variant, from_board, to_board
from firmware_protocol.decoder import Decoder
from firmware_protocol.messages import (
    AnalogueLevel,
    Banner,
    BatteryLevel,
    BoardTime,
    DutyEcho,
    EncoderCounts,
    FromBoard,
    Orientation,
    QuadratureEdges,
    QuadratureStill,
    RawImu,
    ResetBoard,
    ResetDone,
    SetDuty,
    UltrasonicDistance,
)

SOUND_M_S = 343.0
SKETCH_US_PER_CM = 29
UINT16_SPAN, UINT32_SPAN = 1 << 16, 1 << 32
INT32_LIMIT = 1 << 31


class BoardParameters(Parameters):
    """The board and what its sketch is built for; ``cycle_s`` is the least time that a cycle takes.

    ``pwm_full_scale`` is the value of a motor command that switches a bridge full on: 255 for ``analogWrite``.

    Where it decodes no encoders, it keeps ``edge_buffer`` edges of each wheel from one cycle to the next. Its line is as
    fast as the robot's, unless ``line_rate_bytes_s`` says another.
    """

    cycle_s: float = Field(0.02, gt=0, le=10)
    line_rate_bytes_s: float | None = Field(None, gt=0)
    transmit_buffer_bytes: int = Field(64, ge=1)
    receive_buffer_bytes: int = Field(1024, ge=1)
    echo_timeout_s: float = Field(1.0, ge=0, le=1)
    blocking_ultrasonic: bool = True
    raw_imu: bool = False
    sends_battery: bool = True
    edge_buffer: int = Field(512, ge=1)
    pwm_full_scale: int = Field(255, ge=1, le=65_535)
    pwm_law: PwmLaw = PwmLaw.CLIPPED
    boot_s: float = Field(0.2, ge=0, le=60)
    reset_delay_s: float = Field(1.0, ge=0, le=60)
    boot_micros: int = Field(0, ge=0, lt=UINT32_SPAN)


@dataclass(frozen=True, slots=True)
class Wiring:
    """What the board is connected to, and the variant of the lines that it speaks."""

    robot: Robot
    chassis: Chassis
    ultrasonic: Ultrasonic | None
    imu: ImuParameters | None
    divider: Divider
    variant: Variant
    infrared: tuple[Infrared, ...] = ()


class Sketch:
    """The program on the board, from power-on at time 0."""

    def __init__(self, wiring: Wiring, parameters: BoardParameters, uart: Uart, seed: int) -> None:
        self._parameters, self._wiring, self._robot = parameters, wiring, wiring.robot
        self._encoder = from_board(wiring.variant)
        self._commands = Decoder(to_board(wiring.variant))
        self._uart, self._chance = uart, np.random.default_rng(seed)
        chassis = wiring.chassis
        self._motor_signs = [wheel.motor_sign for wheel in chassis.wheels]
        per_rad = chassis.counts_per_turn / math.tau
        self._counts_per_rad = np.array([wheel.encoder_sign * per_rad for wheel in chassis.wheels])
        self._now_s = self._started_s = 0.0
        self._micros_at_start = parameters.boot_micros
        self._counts_at_boot = self._counted()
        self._imu: Imu | None = None
        self._edges: EdgeRecorder | None = None
        if wiring.variant.speaks(QuadratureEdges):
            self._edges = EdgeRecorder(self._counts_per_rad.tolist(), parameters.edge_buffer)
            wiring.robot.watch(self._edges.watch)
        self.duty: tuple[int, ...] = (0,) * len(self._counts_at_boot)

    @property
    def commands_ignored(self) -> int:
        """Lines from the host that were no command."""
        return self._commands.malformed.total()

    def run(self) -> Iterator[float]:
        """Never ends; yields when to go on."""
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
        self._commands.reset()
        self._drive((0,) * len(self.duty))
        self._counts_at_boot = self._counted()
        if self._wiring.imu is not None:
            self._imu = Imu(self._wiring.imu, self._now_s, self._robot.motion.heading_rad)
        if self._edges is not None:
            self._edges.boot(self._now_s)
        for text in self._wiring.variant.banner:
            yield from self._print(Banner(text))

    def _loop_until_reset(self) -> Iterator[float]:
        previous_s = self._now_s
        while not self._told_to_reset():
            began_s = self._now_s
            if self._edges is not None:
                yield from self._print_edges(self._edges.take(began_s))
            yield from self._print(BoardTime(self._micros(began_s), began_s - previous_s))
            yield from self._report()
            previous_s = began_s
            yield from self._wait(began_s + self._parameters.cycle_s - self._now_s)
        yield from self._print(ResetDone())
        yield from self._wait(self._parameters.reset_delay_s)

    def _told_to_reset(self) -> bool:
        """Obey what has been received; what follows a reset is lost with it."""
        for _, command in self._commands.feed(self._uart.read()):
            if isinstance(command, ResetBoard):
                return True
            if isinstance(command, SetDuty):
                self._drive(command.duty)
        return False

    def _report(self) -> Iterator[float]:
        """The rest of a cycle, in the sketch's order."""
        if self._edges is None:
            yield from self._print(EncoderCounts(self._counts()))
        if self._wiring.ultrasonic is not None:
            yield from self._ping(self._wiring.ultrasonic)
        yield from self._print(DutyEcho(tuple(float(duty) for duty in self.duty)))
        inertial = self._inertial()
        if inertial is not None:
            yield from self._print(inertial)
        for sensor in self._wiring.infrared:
            level = sensor.adc_counts(self._robot.state.world_from_base, self._chance)
            yield from self._print(AnalogueLevel(sensor.channel, float(level)))
        if self._parameters.sends_battery:
            yield from self._print(self._battery())

    def _print_edges(self, wheels: list[Taken]) -> Iterator[float]:
        """Every wheel's edges, as many a line as one holds; a line without any where it stood."""
        for wheel, (total, edges) in enumerate(wheels):
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

    def _ping(self, ultrasonic: Ultrasonic) -> Iterator[float]:
        """The sketch stands still until the echo is back, or until it gives up."""
        distance_m = ultrasonic.distance_m(self._robot.state.world_from_base, self._chance)
        timeout_s = self._parameters.echo_timeout_s
        echo_s = math.inf if distance_m is None else 2 * distance_m / SOUND_M_S
        if self._parameters.blocking_ultrasonic:
            yield from self._wait(min(echo_s, timeout_s))
        heard = echo_s <= timeout_s
        yield from self._print(UltrasonicDistance(int(echo_s * 1e6) // SKETCH_US_PER_CM // 2 if heard else 0))

    def _inertial(self) -> Orientation | RawImu | None:
        if self._imu is None:
            return None
        if self._parameters.raw_imu:
            return RawImu(*self._imu.counts(self._robot.motion, self._chance))
        quaternion = self._imu.orientation(self._robot.motion, self._now_s, self._chance)
        return None if quaternion is None else Orientation(*quaternion)

    def _battery(self) -> BatteryLevel:
        state = self._robot.state
        noise = float(self._chance.standard_normal()) * state.battery.parameters.adc_noise_counts
        return BatteryLevel(float(adc_counts(state.terminal_v, self._wiring.divider, noise)))

    def _drive(self, duty: tuple[int, ...]) -> None:
        self.duty = duty
        law, full_scale = self._parameters.pwm_law, self._parameters.pwm_full_scale
        wheels = zip(duty, self._motor_signs, strict=True)
        self._robot.drive([sign * pwm_share(law, full_scale, each) for each, sign in wheels])

    def _micros(self, at_s: float) -> int:
        """Microseconds since the board started, as its 32-bit counter shows them."""
        return (self._micros_at_start + int((at_s - self._started_s) * 1e6)) % UINT32_SPAN

    def _counted(self) -> tuple[int, ...]:
        """Encoder edges since power-on."""
        counts = self._robot.wheel_angles_rad * self._counts_per_rad
        return tuple(math.floor(count) for count in counts)

    def _counts(self) -> tuple[int, ...]:
        """Encoder edges since the board booted, as int32."""
        pairs = zip(self._counted(), self._counts_at_boot, strict=True)
        return tuple((now - boot + INT32_LIMIT) % UINT32_SPAN - INT32_LIMIT for now, boot in pairs)

    def _print(self, message: FromBoard) -> Iterator[float]:
        """Hand a line to the UART; the sketch goes on when it fits the transmit buffer."""
        go_on_s = self._uart.send(self._encoder.encode(message), self._now_s)
        yield from self._wait(go_on_s - self._now_s)

    def _wait(self, duration_s: float) -> Iterator[float]:
        if duration_s > 0:
            self._now_s += duration_s
            yield self._now_s
            self._robot.advance(self._now_s)
