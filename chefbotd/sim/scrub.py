"""What a robot pays for dragging wheels sideways when it turns by skidding."""

import math
from collections import Counter
from collections.abc import Sequence

from chefbotd.core.geometry import Twist2D
from chefbotd.sim.chassis import Chassis


class Scrub:
    """The torque that each axle loses so that the robot may turn.

    A wheel resists with ``grip_n`` at its distance from the middle, in the share of its way over the ground that is
    sideways. All wheels together overcome that, each with the same force at the rim, at a lever of half a track.
    """

    def __init__(self, chassis: Chassis, wheelbase_m: float, radii_m: Sequence[float], grip_n: float) -> None:
        reaches_m = Counter(abs(place_m) for place_m in chassis.places_x_m(wheelbase_m))
        self._radii_m = tuple(radii_m)
        self._sideways_n = [
            (reach_m, grip_n * 2 * reach_m / chassis.track_width_m * wheels / reaches_m.total())
            for reach_m, wheels in reaches_m.items()
            if reach_m and grip_n
        ]

    def torque_n_m(self, moving: Twist2D) -> list[float]:
        """Per axle, for a robot that moves so."""
        at_rim_n = 0.0
        for reach_m, all_sideways_n in self._sideways_n:
            sideways_m_s = moving.angular_rad_s * reach_m
            over_ground_m_s = math.hypot(moving.linear_m_s, sideways_m_s)
            if over_ground_m_s:
                at_rim_n += all_sideways_n * abs(sideways_m_s) / over_ground_m_s
        return [at_rim_n * radius_m for radius_m in self._radii_m]
