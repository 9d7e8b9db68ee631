"""The published ``map_from_odom``: it follows the estimate at a bounded rate, or reports a jump.

What is bounded is how fast the robot's own pose is corrected, not where the frame's origin goes: far from the origin
of ``odom``, a hundredth of a radian moves the robot by centimetres.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from chefbotd.mapping.poses import Floats, between, compose, inverse

RATE_M_S: Final = 0.2
RATE_RAD_S: Final = 0.35
JUMP_M: Final = 0.3
JUMP_RAD: Final = 0.35


class Corrected(NamedTuple):
    """``map_from_odom`` as told, and whether it jumped: then whatever was planned with it is void."""

    map_from_odom: Floats
    jumped: bool


def corrected(told: Floats, map_from_base: Floats, odom_from_base: Floats, dt_s: float) -> Corrected:
    """What to tell now, when ``told`` was told ``dt_s`` ago and the robot is at ``map_from_base``."""
    shown = compose(told, odom_from_base)
    off = between(shown, map_from_base)
    way_m, turn_rad = math.hypot(off[0], off[1]), abs(float(off[2]))
    if way_m > JUMP_M or turn_rad > JUMP_RAD:
        return Corrected(compose(map_from_base, inverse(odom_from_base)), jumped=True)
    by_way = RATE_M_S * dt_s / way_m if way_m > 0 else 1.0
    by_turn = RATE_RAD_S * dt_s / turn_rad if turn_rad > 0 else 1.0
    part = np.array([min(by_way, 1.0), min(by_way, 1.0), min(by_turn, 1.0)])
    return Corrected(compose(compose(shown, part * off), inverse(odom_from_base)), jumped=False)
