"""What the pins of a board that runs our own firmware read of the simulated robot, and drive."""

import math
from collections.abc import Sequence

import numpy as np

from chefbotd.components.simulation.sensors import Imu, adc_counts
from chefbotd.components.simulation.sketch import SOUND_M_S, Wiring


class BoardPins:
    """``duty`` is the motor command in force. While it ``loses_echoes``, the ultrasonic sensor has nothing in reach."""

    def __init__(self, wiring: Wiring, seed: int) -> None:
        self._wiring, self._robot = wiring, wiring.robot
        self._chance = np.random.default_rng(seed)
        per_rad = wiring.chassis.counts_per_turn / math.tau
        self.counts_per_rad = [wheel.encoder_sign * per_rad for wheel in wiring.chassis.wheels]
        self._motor_signs = [wheel.motor_sign for wheel in wiring.chassis.wheels]
        self._imu: Imu | None = None
        self.duty: tuple[int, ...] = (0, 0)
        self.loses_echoes = False

    @property
    def has_imu(self) -> bool:
        """Whether an IMU is wired."""
        return self._wiring.imu is not None

    def power_imu(self, now_s: float) -> None:
        """The IMU begins anew."""
        if self._wiring.imu is not None:
            self._imu = Imu(self._wiring.imu, now_s, self._robot.motion, self._wiring.true_imu)

    def drive(self, shares: Sequence[float]) -> None:
        """The shares of the PWM period, forward positive."""
        self._robot.drive([sign * share for share, sign in zip(shares, self._motor_signs, strict=True)])

    def read_counts(self) -> list[float]:
        """How far each encoder has turned since power-on, in counts and fractions of one."""
        wheels = zip(self._robot.wheel_angles_rad, self.counts_per_rad, strict=True)
        return [angle * per_rad for angle, per_rad in wheels]

    def read_battery(self) -> int:
        """The battery's divider by an ADC of 12 bits."""
        state = self._robot.state
        noise = float(self._chance.standard_normal()) * state.battery.parameters.adc_noise_counts
        return adc_counts(state.terminal_v, self._wiring.divider, noise)

    def read_echo_us(self) -> int | None:
        """How long an echo takes now; None: nothing comes back."""
        sensor = self._wiring.ultrasonic
        if sensor is None or self.loses_echoes:
            return None
        distance_m = sensor.distance_m(self._robot.state.world_from_base, self._chance)
        return None if distance_m is None else round(2e6 * distance_m / SOUND_M_S)

    def read_imu(self) -> tuple[int, ...]:
        """Six raw counts; zeros where no IMU is wired."""
        if self._imu is None:
            return (0,) * 6
        acceleration, rate = self._imu.counts(self._robot.motion, self._chance)
        return (*acceleration, *rate)
