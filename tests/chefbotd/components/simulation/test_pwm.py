"""The board's PWM."""

import pytest

from chefbotd.components.simulation.parameters.sketches import PwmLaw
from chefbotd.components.simulation.peripherals import pwm_share


@pytest.mark.parametrize(
    ("law", "value", "share"),
    [
        (PwmLaw.CLIPPED, 51, 0.2),
        (PwmLaw.CLIPPED, -102, -0.4),
        (PwmLaw.CLIPPED, 255, 1.0),
        (PwmLaw.CLIPPED, 256, 1.0),
        (PwmLaw.CLIPPED, -6637, -1.0),
        (PwmLaw.LOW_BYTE, -51, -0.2),
        (PwmLaw.LOW_BYTE, 255, 1.0),
        (PwmLaw.LOW_BYTE, 256, 0.0),
        (PwmLaw.LOW_BYTE, 409, 0.6),
        (PwmLaw.LOW_BYTE, -6637, -237 / 255),
    ],
)
def test_full_scale_is_255(law: PwmLaw, value: int, share: float):
    """``value / 255``: clipped on the Tiva, of the low eight bits on an AVR (6637 is 25 * 256 + 237)."""
    assert pwm_share(law, 255, value) == pytest.approx(share)
