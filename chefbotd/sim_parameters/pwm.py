"""How a board's PWM treats values beyond its range."""

from enum import StrEnum


class PwmLaw(StrEnum):
    """How ``analogWrite`` treats a value that its range does not hold."""

    CLIPPED = "clipped"
    """Energia on the Tiva: full scale and more is full on."""

    LOW_BYTE = "low_byte"
    """An AVR: only the low eight bits count, so 256 is off and 400 is 144."""
