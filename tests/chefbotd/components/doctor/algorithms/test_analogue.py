"""Analogue inputs that read a share of what they should."""

import pytest

from chefbotd.components.doctor.algorithms.analogue import AnalogueInput, check_adc
from chefbotd.components.doctor.algorithms.finding import Finding, Verdict

FULL, BAND_V = 4095, (11.1, 12.6)
VOLTS_PER_COUNT = 13.2 / 4095
"""3.3 V behind a divider of 4: 12 V are a reading of 3723, of which 10 bits make 930."""


def found(battery: float | None, *infrared: float | None, bits: int = 12) -> Finding | None:
    """What is said of these highest readings."""
    inputs = [AnalogueInput(f"ir{n}", highest, bits, 3.3) for n, highest in enumerate(infrared)]
    return check_adc(battery, FULL, VOLTS_PER_COUNT, BAND_V, inputs)


def test_all_inputs_at_a_quarter_are_ten_bits() -> None:
    """12 V read as 3 V, and 0.4 V as 0.1 V."""
    finding = found(930, 124)
    assert finding is not None
    assert finding.verdict is Verdict.PROBLEM
    assert "10 bits" in finding.measured
    assert "ir0 at most 0.10 V" in finding.measured
    assert "adc_full_scale = 1023" in finding.advice
    assert "adc_bits = 10" in finding.advice


@pytest.mark.parametrize(("battery", "bits"), [(3723 / 16, 8), (930, 10)])
def test_other_bits_are_found_by_the_battery_alone(battery: float, bits: int) -> None:
    """A sixteenth, a quarter."""
    finding = found(battery)
    assert finding is not None
    assert f"of {bits} bits" in finding.measured


def test_readings_beyond_the_bits_are_of_more_bits() -> None:
    """12 V of 16 bits are 59,577; of 14 bits 14,895."""
    for battery, bits in ((59577.0, 16), (14895.0, 14)):
        finding = found(battery, 9000.0)
        assert finding is not None
        assert finding.verdict is Verdict.PROBLEM
        assert f"adc_bits = {bits}" in finding.advice


def test_an_infrared_input_below_what_a_sensor_gives_is_asked_about() -> None:
    """The battery is right, the sensor never above 0.1 V: unplugged, or another ADC."""
    finding = found(3723, 124)
    assert finding is not None
    assert finding.verdict is Verdict.WARNING
    assert "adc_bits" in finding.advice


def test_right_readings_and_none() -> None:
    """12 V and 0.4 V are right; a board without analogue inputs is not asked."""
    finding = found(3723, 500)
    assert finding is not None
    assert finding.verdict is Verdict.OK
    assert found(None) is None
    assert found(None, None) is None


@pytest.mark.parametrize("battery", [0.0, 60.0, 1800.0])
def test_a_battery_that_no_bits_explain_is_left_to_its_own_finding(battery: float) -> None:
    """Nothing wired; a flat one of 5.8 V."""
    finding = found(battery)
    assert finding is not None
    assert finding.verdict is Verdict.OK
