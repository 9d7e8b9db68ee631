"""How much of the motors' turning becomes motion over the ground: backlash, and slip that is constant or random."""

import math
import random
from collections.abc import Sequence

from chefbotd.components.simulation.axles import Wheels
from chefbotd.components.simulation.chassis import Chassis
from chefbotd.components.simulation.parameters.true import TrueParameters
from chefbotd.core.geometry import Twist2D

CORRELATION_M, CORRELATION_RAD = 0.05, 0.2
"""Travel and turn after which random slip is another (assumed): the size of a patch of floor under a wheel."""


class Backlash:
    """The play of each wheel behind its encoder: a wheel follows where its motor has taken up the play.

    A robot that is pushed, or that rolls on while its motors brake, is not moved within the play.
    """

    def __init__(self, chassis: Chassis) -> None:
        self._half_rad = [wheel.backlash_rad / 2 for wheel in chassis.wheels]
        self._wheel_rad = [0.0] * len(self._half_rad)
        self._exists = any(self._half_rad)

    def turned_rad(self, before: Wheels, after: Wheels) -> Sequence[float]:
        """How far each wheel turns while its motor's angle goes from ``before`` to ``after``."""
        if not self._exists:
            return [now - earlier for now, earlier in zip(after, before, strict=True)]
        turned = []
        for number, (half, motor) in enumerate(zip(self._half_rad, after, strict=True)):
            earlier = self._wheel_rad[number]
            self._wheel_rad[number] = min(max(earlier, motor - half), motor + half)
            turned.append(self._wheel_rad[number] - earlier)
        return turned


class Slip:
    """The share of each side's rim travel that is lost, and random slip of the whole robot.

    Random slip is a share of travel and a share of turning, each a Gaussian process that is correlated over
    ``CORRELATION_M`` and ``CORRELATION_RAD``. Over longer ways its variance is that of the parameters.
    ``left`` and ``right`` may be changed while the robot runs.
    """

    def __init__(self, true: TrueParameters, chassis: Chassis, seed: int) -> None:
        self.left, self.right = true.left_slip, true.right_slip
        self._is_left = [wheel.is_left for wheel in chassis.wheels]
        self._chance = random.Random(seed)
        self._travel_share = math.sqrt(true.travel_variance_m2_per_m / (2 * CORRELATION_M))
        self._turn_share = math.sqrt(true.turn_variance_rad2_per_rad / (2 * CORRELATION_RAD))
        self._travel = self._turn = 0.0

    def gripped(self, turned_rad: Sequence[float]) -> Sequence[float]:
        """How far wheels that turn so roll over the ground, constant slip taken off."""
        if not (self.left or self.right):
            return turned_rad
        left, right = 1 - self.left, 1 - self.right
        wheels = zip(turned_rad, self._is_left, strict=True)
        return [angle * (left if is_left else right) for angle, is_left in wheels]

    def disturbed(self, twist: Twist2D, step_s: float) -> Twist2D:
        """The twist with random slip, over one step."""
        linear_m_s, angular_rad_s = twist.linear_m_s, twist.angular_rad_s
        if self._travel_share and linear_m_s:
            self._travel = self._next(self._travel, abs(linear_m_s) * step_s / CORRELATION_M)
            linear_m_s *= 1 + self._travel_share * self._travel
        if self._turn_share and angular_rad_s:
            self._turn = self._next(self._turn, abs(angular_rad_s) * step_s / CORRELATION_RAD)
            angular_rad_s *= 1 + self._turn_share * self._turn
        return Twist2D(linear_m_s, angular_rad_s)

    def _next(self, value: float, lengths: float) -> float:
        """The next value of an Ornstein-Uhlenbeck process of variance 1, so many correlation lengths on."""
        kept = math.exp(-lengths)
        return value * kept + math.sqrt(1 - kept * kept) * self._chance.gauss(0.0, 1.0)
