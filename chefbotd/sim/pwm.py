"""What the board's PWM makes of the number in a motor command."""

import math
from collections.abc import Callable
from enum import StrEnum

BYTE = 256


class PwmLaw(StrEnum):
    """How ``analogWrite`` treats a value that its range does not hold."""

    CLIPPED = "clipped"
    """Energia on the Tiva: full scale and more is full on."""

    LOW_BYTE = "low_byte"
    """An AVR: only the low eight bits count, so 256 is off and 400 is 144."""


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
