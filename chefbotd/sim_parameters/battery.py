"""The parameters of the simulated battery."""

from pydantic import Field

from chefbotd.core.parameters import Parameters


class BatteryParameters(Parameters):
    """A 12 V lead-acid battery, the electronics on it besides the motors, and the noise of the ADC that watches it."""

    capacity_ah: float = Field(10.0, gt=0, le=1000)
    start_charge_share: float = Field(1.0, ge=0, le=1)
    resistance_ohm: float = Field(0.05, ge=0, le=10)
    electronics_current_a: float = Field(2.0, ge=0, le=100)
    adc_noise_counts: float = Field(2.0, ge=0, le=100)
