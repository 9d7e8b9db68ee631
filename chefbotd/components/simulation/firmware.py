"""Our own firmware on the simulated board: its program (``firmware_program.py``) with the robot's wheels and sensors.

It takes received bytes at once, as the real one does within a millisecond, and nothing makes it wait.
"""

import math
from collections import deque
from collections.abc import Iterator

import numpy as np

from chefbotd.components.simulation.firmware_loop import Edges
from chefbotd.components.simulation.firmware_motors import Kept
from chefbotd.components.simulation.firmware_program import (
    BATTERY,
    COMMAND,
    IMU,
    POWER_ON,
    ULTRASONIC,
    WHEEL_LOOP,
    FirmwareProgram,
)
from chefbotd.components.simulation.parameters.sketches import BoardParameters
from chefbotd.components.simulation.peripherals import Uart, pwm_share
from chefbotd.components.simulation.sensors import Imu, adc_counts
from chefbotd.components.simulation.sketch import SOUND_M_S, Wiring

IMU_S, BATTERY_S = 0.02, 0.2
"""How often the board's sensors have a new reading."""

ECHO_BEGINS_US = 450
"""An HC-SR04 sends its burst before it raises its line (assumed)."""


class FirmwareSketch:
    """The board's program from power-on at time 0, as ``Sketch`` is another; it is the hardware of ``FirmwareProgram``.

    While it ``loses_echoes``, the ultrasonic sensor has nothing in reach.
    """

    def __init__(self, wiring: Wiring, parameters: BoardParameters, uart: Uart, seed: int) -> None:
        self._wiring, self._parameters, self._uart, self._robot = wiring, parameters, uart, wiring.robot
        self._chance = np.random.default_rng(seed)
        chassis = wiring.chassis
        self._motor_signs = [wheel.motor_sign for wheel in chassis.wheels]
        per_rad = chassis.counts_per_turn / math.tau
        self._counts_per_rad = [wheel.encoder_sign * per_rad for wheel in chassis.wheels]
        self.duty: tuple[int, ...] = (0,) * len(chassis.wheels)
        self.loses_echoes = False
        self._kept, self._cause = Kept(), POWER_ON
        self._micros_at_start = parameters.boot_micros
        self._now_s = self._started_s = 0.0
        self._echoes: deque[tuple[int, bool]] = deque()
        self._imu: Imu | None = None
        self._imu_s = self._battery_s = -math.inf
        self._program: FirmwareProgram | None = None

    @property
    def is_checked(self) -> bool:
        """Whether the checked mode is in force."""
        return self._program is not None and self._program.is_checked

    def run(self) -> Iterator[float]:
        """Run for ever; yields the time at which to continue at the latest."""
        while True:
            self._started_s, self._program = self._now_s, None
            self._robot.release()
            begins_s = self._now_s + self._parameters.boot_s
            yield begins_s
            self._go_to(begins_s)
            program = self._start()
            while self._program is program:
                due_s = self.next_s
                yield due_s
                if self.next_s <= due_s:  # a command may have put it off
                    self._go_to(self.next_s)
                    self._act(program)
            self._micros_at_start = 0

    @property
    def next_s(self) -> float:
        """When something is due next; inf while it starts."""
        if self._program is None:
            return math.inf
        due_us = self._program.next_us()
        if self._echoes:
            due_us = min(due_us, self._echoes[0][0])
        return max(self._started_s + (due_us - self._micros_at_start) * 1e-6, self._now_s)

    def receive(self, at_s: float) -> None:
        """Bytes have come into the UART; a board that starts reads none."""
        data, program = self._uart.read(), self._program
        if program is None:
            return
        self._go_to(at_s)
        program.receive(data, self._micros())
        program.run(self._micros())

    def _start(self) -> FirmwareProgram:
        self._uart.read()
        self._echoes.clear()
        wiring = self._wiring
        has_imu = wiring.imu is not None
        if wiring.imu is not None:
            self._imu = Imu(wiring.imu, self._now_s, self._robot.motion, wiring.true_imu)
        sensors = (ULTRASONIC if wiring.ultrasonic is not None else 0) + (IMU if has_imu else 0) + BATTERY
        self._program = FirmwareProgram(
            self,
            self._kept,
            self._micros(),
            self._cause,
            wheels=len(self.duty),
            capabilities=WHEEL_LOOP + sensors,
            has_imu=has_imu,
        )
        return self._program

    def _act(self, program: FirmwareProgram) -> None:
        now_us = self._micros()
        while self._echoes and self._echoes[0][0] <= now_us:
            at_us, rising = self._echoes.popleft()
            program.echo(rising, at_us)
        self._read_sensors(program, now_us)
        program.run(now_us)

    def _read_sensors(self, program: FirmwareProgram, now_us: int) -> None:
        readings = program.readings
        if self._imu is not None and self._now_s - self._imu_s >= IMU_S:
            self._imu_s = self._now_s
            acceleration, rate = self._imu.counts(self._robot.motion, self._chance)
            readings.imu, readings.imu_us, readings.is_new_imu = (*acceleration, *rate), now_us, True
        if self._now_s - self._battery_s >= BATTERY_S:
            self._battery_s = self._now_s
            state = self._robot.state
            noise = float(self._chance.standard_normal()) * state.battery.parameters.adc_noise_counts
            readings.battery_level = adc_counts(state.terminal_v, self._wiring.divider, noise)
            readings.has_battery = True

    def _go_to(self, at_s: float) -> None:
        self._now_s = max(at_s, self._now_s)
        self._robot.advance(self._now_s)

    def _micros(self) -> int:
        """The board's clock now, not wrapped."""
        return self._micros_at_start + round((self._now_s - self._started_s) * 1e6)

    # What the program asks of its hardware

    def write_motors(self, duty: tuple[int, ...]) -> None:
        """Put a duty on the motors."""
        self.duty = duty
        law, full_scale = self._parameters.pwm_law, self._parameters.pwm_full_scale
        wheels = zip(duty, self._motor_signs, strict=True)
        self._robot.drive([sign * pwm_share(law, full_scale, value) for value, sign in wheels])

    def edges(self) -> Edges:
        """Each wheel's count, and when its newest edge came, at the speed that it has."""
        speeds = self._robot.state.wheels.velocity_rad_s
        wheels = zip(self._robot.wheel_angles_rad, speeds, self._counts_per_rad, strict=True)
        now_us = self._micros()
        return [_edge(angle * per_rad, speed * per_rad, now_us) for angle, speed, per_rad in wheels]

    def trigger_ultrasonic(self, now_us: int) -> None:
        """The sensor's line rises, and falls when the echo is back."""
        sensor = self._wiring.ultrasonic
        if sensor is None or self.loses_echoes:
            return
        distance_m = sensor.distance_m(self._robot.state.world_from_base, self._chance)
        if distance_m is not None:
            rises_us = now_us + ECHO_BEGINS_US
            falls_us = rises_us + round(2 * distance_m / SOUND_M_S * 1e6)
            self._echoes.extend([(rises_us, True), (falls_us, False)])

    def send(self, data: bytes) -> None:
        """Put bytes on the wire."""
        self._uart.send(data, self._now_s)

    def room_bytes(self) -> int:
        """What the transmit ring has room for."""
        return self._parameters.transmit_buffer_bytes - self._uart.backlog_bytes(self._now_s)

    def restart(self) -> None:
        """Begin again, by command."""
        self.write_motors((0,) * len(self.duty))
        self._cause, self._program = COMMAND, None


def _edge(counts: float, counts_s: float, now_us: int) -> tuple[int, int]:
    count = math.floor(counts)
    if not counts_s:
        return count, now_us
    since = (counts - count if counts_s > 0 else count + 1 - counts) / abs(counts_s)
    return count, now_us - min(round(since * 1e6), 1_000_000)
