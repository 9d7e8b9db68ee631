"""How the board's PWM reads the number in a motor command."""

import math
from collections.abc import Callable

from chefbotd.sim_parameters.pwm import PwmLaw

BYTE = 256


def pwm_share(law: PwmLaw, full_scale: int, value: int) -> float:
    """The share of the period that the bridge is on for a command's ``value``; its sign is the direction."""
    return math.copysign(_MAGNITUDES[law](abs(value), full_scale) / full_scale, value)


def _clipped(magnitude: int, full_scale: int) -> int:
    return min(magnitude, full_scale)


def _low_byte(magnitude: int, full_scale: int) -> int:
    return min(magnitude % BYTE, full_scale)


_MAGNITUDES: dict[PwmLaw, Callable[[int, int], int]] = {
    PwmLaw.CLIPPED: _clipped,
    PwmLaw.LOW_BYTE: _low_byte,
}
