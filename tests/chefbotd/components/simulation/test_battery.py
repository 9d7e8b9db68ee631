"""The battery and its ADC reading."""

import pytest

from chefbotd.components.simulation.parameters.motor import SimBatteryParameters
from chefbotd.components.simulation.sensors import Battery, Divider, adc_counts


def test_charge_falls_by_what_is_drawn() -> None:
    """5 A for an hour out of 10 Ah leave half, which rests at 12.10 V."""
    battery = Battery.fresh(SimBatteryParameters(capacity_ah=10)).drained(5.0, 3600.0)
    assert battery.charge_share == pytest.approx(0.5)
    assert battery.supply.open_circuit_v == pytest.approx(12.10)


@pytest.mark.parametrize(("current_a", "left"), [(20.0, 0.0), (-20.0, 1.0)])
def test_charge_stays_between_empty_and_full(current_a: float, left: float) -> None:
    """Neither drawing from an empty battery nor braking into a full one leaves 0 to 1."""
    battery = Battery(SimBatteryParameters(capacity_ah=10), 0.5).drained(current_a, 3600.0)
    assert battery.charge_share == left


def test_supply_carries_resistance_and_electronics() -> None:
    """The motors see the battery's inner resistance and what the electronics draw."""
    parameters = SimBatteryParameters(resistance_ohm=0.07, electronics_current_a=1.5)
    supply = Battery.fresh(parameters).supply
    assert (supply.resistance_ohm, supply.base_load_a) == (0.07, 1.5)


def test_adc_reads_through_divider_and_reference() -> None:
    """12 V over a divider of 4 are 3 V of 3.3 V: 3 / 3.3 * 4095 = 3722.7 counts."""
    assert adc_counts(12.0, Divider(3.3, 4.0)) == 3723


def test_adc_noise_is_in_counts_and_the_ends_clip() -> None:
    """A draw of +6 counts adds 6; beyond the reference the ADC shows 4095, below zero 0."""
    assert adc_counts(12.0, Divider(), noise_counts=6.0) == 3729
    assert adc_counts(20.0, Divider()) == 4095
    assert adc_counts(0.0, Divider(), noise_counts=-3.0) == 0
