"""The published ``map_from_odom``: it follows the estimate at a bounded rate, or reports a jump.

What is bounded is how fast the robot's own pose is corrected, not where the frame's origin goes: far from the origin
of ``odom``, a hundredth of a radian moves the robot by centimetres.
"""

import math
from typing import Final

import numpy as np

from chefbotd.mapping.poses import Floats, between, compose, inverse

RATE_M_S: Final = 0.2
RATE_RAD_S: Final = 0.35
JUMP_M: Final = 0.3
JUMP_RAD: Final = 0.35


def corrected(
    published: Floats, map_from_base: Floats, odom_from_base: Floats, dt_s: float
) -> tuple[Floats, bool]:
    """The next ``map_from_odom``, ``dt_s`` after ``published``, and whether it jumped: then plans made with it are void.

    The robot is at ``map_from_base``.
    """
    shown = compose(published, odom_from_base)
    off = between(shown, map_from_base)
    distance_m, turn_rad = math.hypot(off[0], off[1]), abs(float(off[2]))
    if distance_m > JUMP_M or turn_rad > JUMP_RAD:
        return compose(map_from_base, inverse(odom_from_base)), True
    by_distance = RATE_M_S * dt_s / distance_m if distance_m > 0 else 1.0
    by_turn = RATE_RAD_S * dt_s / turn_rad if turn_rad > 0 else 1.0
    part = np.array([min(by_distance, 1.0), min(by_distance, 1.0), min(by_turn, 1.0)])
    return compose(compose(shown, part * off), inverse(odom_from_base)), False
