"""The battery: its charge, its voltage under load, and what the board's ADC reads of it."""

from itertools import pairwise

from chefbotd.core.record import Record
from chefbotd.sim.plant import Supply
from chefbotd.sim_parameters.motor import SimBatteryParameters

# Rest voltage of a 12 V lead-acid battery at 25 degrees C by state of charge, as battery makers publish it.
# Tenths of the charge, from empty to full.
REST_VOLTAGE_V = (10.50, 11.51, 11.66, 11.81, 11.96, 12.10, 12.24, 12.37, 12.50, 12.62, 12.73)
TENTHS = tuple(pairwise(REST_VOLTAGE_V))
ADC_MAX = 4095


class Divider(Record, frozen=True):
    """The voltage divider between the battery and the ADC, and the ADC's full scale."""

    reference_v: float = 3.3
    ratio: float = 4.0


class Battery(Record, frozen=True):
    """A battery with ``charge_share`` (0 to 1) left in it."""

    parameters: SimBatteryParameters
    charge_share: float

    @classmethod
    def fresh(cls, parameters: SimBatteryParameters) -> "Battery":
        """The battery at the start of the simulation."""
        return cls(parameters, parameters.start_charge_share)

    @property
    def supply(self) -> Supply:
        """The voltage and the resistance that the motors see."""
        tenths = 10 * self.charge_share
        number = min(int(tenths), 9)
        below_v, above_v = TENTHS[number]
        rest_v = below_v + (above_v - below_v) * (tenths - number)
        return Supply(rest_v, self.parameters.resistance_ohm, self.parameters.electronics_current_a)

    def drained(self, current_a: float, duration_s: float) -> "Battery":
        """The battery after it has supplied ``current_a`` for ``duration_s``; a negative current charges it."""
        used = current_a * duration_s / (3600 * self.parameters.capacity_ah)
        return Battery(self.parameters, min(max(self.charge_share - used, 0.0), 1.0))


def adc_counts(terminal_v: float, divider: Divider, noise_counts: float = 0.0) -> int:
    """The 12-bit reading of this voltage through the divider."""
    ideal = terminal_v / divider.ratio / divider.reference_v * ADC_MAX
    return min(max(round(ideal + noise_counts), 0), ADC_MAX)
