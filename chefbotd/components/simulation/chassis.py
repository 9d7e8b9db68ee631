"""The chassis of a simulated robot: its wheels, and what skid steer costs them."""

import math
from collections import Counter
from collections.abc import Sequence

from msgspec import field

from chefbotd.components.simulation.parameters.true import TrueMotor
from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import Record
from chefbotd.motion.kinematics import places_x_m


class Wheel(Record, frozen=True):
    """A driven wheel, its motor's flaws in either direction, and its backlash.

    A sign of -1 marks a motor or an encoder that is wired backwards.
    """

    is_left: bool
    radius_m: float
    motor_sign: int = 1
    encoder_sign: int = 1
    forward: TrueMotor = field(default_factory=TrueMotor)
    reverse: TrueMotor = field(default_factory=TrueMotor)
    backlash_rad: float = 0.0


class Chassis(Record, frozen=True):
    """The wheels in the order of the wire, how far the sides are apart, and the counts of a wheel's turn.

    Raises:
        ValueError: a side has no wheel.
    """

    wheels: tuple[Wheel, ...]
    track_width_m: float
    counts_per_turn: float

    def __post_init__(self) -> None:
        if {wheel.is_left for wheel in self.wheels} != {True, False}:
            raise ValueError(f"there must be at least one wheel on each side, got {self.wheels}")

    def on_side_of(self, wheel: Wheel) -> int:
        """The number of wheels on this wheel's side, itself included."""
        return sum(other.is_left == wheel.is_left for other in self.wheels)


PUBLISHED = Chassis((Wheel(True, 0.045), Wheel(False, 0.045)), track_width_m=0.3, counts_per_turn=4200.0)
"""ChefBot's."""


class Scrub:
    """The torque that each axle loses so that the robot may turn.

    A wheel resists with ``grip_n`` at its distance from the middle, in the share of its way over the ground that is
    sideways. All wheels together overcome that, each with the same force at the rim, at a lever of half a track.
    """

    def __init__(self, chassis: Chassis, wheelbase_m: float, radii_m: Sequence[float], grip_n: float) -> None:
        sides = [wheel.is_left for wheel in chassis.wheels]
        reaches_m = Counter(map(abs, places_x_m(sides, wheelbase_m)))
        self._radii_m = tuple(radii_m)
        self._sideways_n = [
            (reach_m, grip_n * 2 * reach_m / chassis.track_width_m * wheels / reaches_m.total())
            for reach_m, wheels in reaches_m.items()
            if reach_m and grip_n
        ]

    def torque_n_m(self, moving: Twist2D) -> list[float]:
        """The torque of each axle for a robot that moves like this."""
        at_rim_n = 0.0
        for reach_m, all_sideways_n in self._sideways_n:
            sideways_m_s = moving.angular_rad_s * reach_m
            over_ground_m_s = math.hypot(moving.linear_m_s, sideways_m_s)
            if over_ground_m_s:
                at_rim_n += all_sideways_n * abs(sideways_m_s) / over_ground_m_s
        return [at_rim_n * radius_m for radius_m in self._radii_m]
