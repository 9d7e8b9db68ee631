"""A simulated board that runs our firmware's own image: an ATmega328P in simavr, wired to the simulated robot.

The wheels turn the encoders, the pins of the motor drivers drive the wheels, and the sensors answer when
the program asks them. Image and robot take turns on a grid of a millisecond, so runs are the same however they are cut.
"""

import math
from pathlib import Path

import numpy as np

from chefbotd.components.simulation.axles import Wheels
from chefbotd.components.simulation.board import SimulatedBoard
from chefbotd.components.simulation.parameters.sketches import BoardParameters
from chefbotd.components.simulation.peripherals import Uart
from chefbotd.components.simulation.sensors import ADC_MAX, Imu, adc_counts
from chefbotd.components.simulation.simavr import BUILD, CYCLES_S, SimavrBoard
from chefbotd.components.simulation.sketch import SOUND_M_S, Wiring

TURN_S = 0.001
FULL_SCALE = 255
ADC_MV = 5_000
"""The board's ADC compares with its supply."""


class EmulatedProgram:
    """The motor command that its pins give, and whether the ultrasonic sensor has nothing in reach."""

    def __init__(self) -> None:
        self.duty: tuple[int, ...] = (0, 0)
        self.loses_echoes = False


class EmulatedLaunchpad(SimulatedBoard):
    """The board, with the image that `make firmware` builds.

    Raises:
        FileNotFoundError: image or emulator is not built; the message says how.
        ValueError: the robot has not two wheels.
    """

    def __init__(
        self,
        wiring: Wiring,
        parameters: BoardParameters,
        seed: int,
        line_rate_bytes_s: float,
        folder: Path = BUILD,
    ) -> None:
        if len(wiring.chassis.wheels) != 2:
            raise ValueError(
                f"the emulated board drives two wheels, the robot has {len(wiring.chassis.wheels)}"
            )
        self.robot, self._wiring = wiring.robot, wiring
        self._byte_s = 1 / line_rate_bytes_s
        self.uart = Uart(line_rate_bytes_s, ADC_MAX, ADC_MAX, parameters.handover_s)
        self.sketch = EmulatedProgram()
        self._chance = np.random.default_rng(seed)
        per_rad = wiring.chassis.counts_per_turn / math.tau
        self._counts_per_rad = [wheel.encoder_sign * per_rad for wheel in wiring.chassis.wheels]
        self._motor_signs = [wheel.motor_sign for wheel in wiring.chassis.wheels]
        self._imu: Imu | None = None
        if wiring.imu is not None:
            self._imu = Imu(wiring.imu, 0.0, self.robot.motion, wiring.true_imu)
        self._board = SimavrBoard(folder, echo_us=self._echo_us, imu_counts=self._imu_counts)
        self._board.set_imu(self._imu is not None)
        self._turns, self._line = 0, bytearray()
        self.robot.watch(self._turn_encoders)
        self.robot.release()

    def next_event_s(self) -> float:
        """When to call ``advance`` next."""
        return min(self.uart.next_s, (self._turns + 1) * TURN_S)

    def advance(self, to_s: float) -> list[tuple[float, bytes]]:
        """Run until ``to_s``: lines that left since the last call, with the times of their last bytes."""
        self._run(to_s)
        return self.uart.take_lines(to_s)

    def receive(self, data: bytes, at_s: float) -> None:
        """Bytes from the host, on the wire from now on, one after the other."""
        self._run(at_s)
        self._board.receive(data, _cycle(at_s))
        self.heard_s = self._board.received_cycle / CYCLES_S

    def _run(self, to_s: float) -> None:
        while (self._turns + 1) * TURN_S <= to_s:
            self._turns += 1
            now_s = self._turns * TURN_S
            self.robot.advance(now_s)
            self._measure_battery()
            self._board.run(_cycle(now_s))
            self._send_lines()
            self._drive_motors()

    def _send_lines(self) -> None:
        """The lines that are complete, each when its last byte has left."""
        for at_cycle, byte in self._board.take_bytes():
            self._line.append(byte)
            if byte == 0x0A:
                self.uart.send(bytes(self._line), at_cycle / CYCLES_S - len(self._line) * self._byte_s)
                self._line.clear()

    def _drive_motors(self) -> None:
        for change in self._board.take_duties():
            self.sketch.duty, self.duty_since_s = change.duty, change.at_cycle / CYCLES_S
            signed = zip(change.duty, self._motor_signs, strict=True)
            self.robot.drive([sign * duty / FULL_SCALE for duty, sign in signed])

    def _turn_encoders(self, from_s: float, to_s: float, before_rad: Wheels, after_rad: Wheels) -> None:
        wheels = zip(before_rad, after_rad, self._counts_per_rad, strict=True)
        for wheel, (before, after, per_rad) in enumerate(wheels):
            if before != after:
                self._board.turn(wheel, before * per_rad, after * per_rad, _cycle(from_s), _cycle(to_s))

    def _measure_battery(self) -> None:
        state = self.robot.state
        noise = float(self._chance.standard_normal()) * state.battery.parameters.adc_noise_counts
        counts = adc_counts(state.terminal_v, self._wiring.divider, noise)
        self._board.set_battery_mv(round(counts / (ADC_MAX + 1) * ADC_MV))

    def _echo_us(self) -> int:
        sensor = self._wiring.ultrasonic
        if sensor is None:
            return 0
        distance_m = sensor.distance_m(self.robot.state.world_from_base, self._chance)
        return 0 if distance_m is None or self.sketch.loses_echoes else round(2e6 * distance_m / SOUND_M_S)

    def _imu_counts(self) -> tuple[int, ...]:
        if self._imu is None:
            return (0,) * 6
        acceleration, rate = self._imu.counts(self.robot.motion, self._chance)
        return (*acceleration, *rate)


def _cycle(at_s: float) -> int:
    return round(at_s * CYCLES_S)
