"""The battery: volts, charge, and a status that does not flicker."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from chefbotd.core.events import BatteryCounted, BatteryLevelStatus, BatteryMeasured
from chefbotd.sensing import battery
from chefbotd.sensing.battery import BatteryParameters, BatteryState, measure
from tests.budget import examples

OK, LOW, CRITICAL = BatteryLevelStatus


def parameters(**changes: object) -> BatteryParameters:
    """4095 counts are 3 V at the pin and 15 V at the battery; 11 V is empty and 13 V full."""
    values = {
        "reference_v": 3.0,
        "divider_ratio": 5.0,
        "empty_v": 11.0,
        "full_v": 13.0,
        "hysteresis_v": 0.125,
    }
    return BatteryParameters.model_validate(values | changes)


def adc(voltage_v: float) -> float:
    """The counts for a voltage."""
    return voltage_v / 15 * 4095


def at(voltage_v: float, state: BatteryState = battery.START, **changes: object) -> BatteryMeasured:
    """What is measured at a voltage."""
    return measure(parameters(**changes), state, BatteryCounted(0.0, 0.1, adc(voltage_v)))[1]


def test_counts_become_volts() -> None:
    """3276 of 4095 counts are 0.8 * 3 V at the pin, 12 V at the battery: half way from 11 to 13 V."""
    _, measured = measure(parameters(), battery.START, BatteryCounted(4.0, 4.5, 3276.0))
    assert measured.stamp_s == 4.0
    assert measured.voltage_v == pytest.approx(12.0)
    assert measured.percentage == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("voltage_v", "percentage"), [(0, 0), (10.9, 0), (11.0, 0), (11.5, 25), (13.0, 100), (14.4, 100)]
)
def test_charge_is_a_line_from_empty_to_full(voltage_v: float, percentage: float) -> None:
    """Below empty it is 0 %, above full 100 %."""
    assert at(voltage_v).percentage == pytest.approx(percentage, abs=1e-9)


def test_charge_follows_the_configured_curve() -> None:
    """A point of 12 V and 80 % bends the line: 11.5 V is 40 %, 12.5 V is 90 %."""
    curve = ((12.0, 80.0),)
    assert at(11.5, curve_v_percent=curve).percentage == pytest.approx(40)
    assert at(12.5, curve_v_percent=curve).percentage == pytest.approx(90)


@given(st.floats(0, 15), st.floats(0, 15))
@settings(max_examples=examples(60))
def test_more_volts_are_never_less_charge(one_v: float, other_v: float) -> None:
    """The percentage rises with the voltage and stays within 0 and 100."""
    curve = ((11.6, 10.0), (12.0, 80.0), (12.5, 80.0))
    less, more = (at(v, curve_v_percent=curve).percentage for v in sorted((one_v, other_v)))
    assert 0 <= less <= more <= 100


@pytest.mark.parametrize(
    ("before", "voltage_v", "after"),
    [
        (OK, 12.01, OK),
        (OK, 11.99, LOW),
        (OK, 11.69, CRITICAL),
        (LOW, 12.1, LOW),  # above 12 V, but not by the hysteresis of 0.125 V
        (LOW, 12.13, OK),
        (LOW, 11.69, CRITICAL),
        (CRITICAL, 11.8, CRITICAL),
        (CRITICAL, 11.83, LOW),
        (CRITICAL, 12.1, LOW),
        (CRITICAL, 12.13, OK),
    ],
)
def test_status_worsens_at_once_and_recovers_with_hysteresis(
    before: BatteryLevelStatus, voltage_v: float, after: BatteryLevelStatus
) -> None:
    """Low below 12.0 V, critical below 11.7 V, better only 0.125 V above that."""
    state, measured = measure(parameters(), BatteryState(before), BatteryCounted(0.0, 0.1, adc(voltage_v)))
    assert measured.status == state.status == after


def test_a_voltage_on_the_threshold_does_not_flicker() -> None:
    """Readings that jump about 12 V by 50 mV change the status once."""
    state, seen = battery.START, []
    for number in range(20):
        state, measured = measure(
            parameters(), state, BatteryCounted(number, number, adc(12.05 if number % 2 else 11.95))
        )
        seen.append(measured.status)
    assert set(seen) == {LOW}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"critical_v": 12.5}, "critical_v must not be above low_v, got 12.5 and 12.0"),
        ({"empty_v": 13.5}, "the curve must rise"),
        ({"curve_v_percent": ((12.0, 50.0), (11.5, 60.0))}, "the curve must rise"),
        ({"curve_v_percent": ((12.0, 101.0),)}, "the curve must rise"),
        ({"divider_ratio": 0.5}, "divider_ratio"),
    ],
)
def test_a_battery_that_cannot_be_is_refused(changes: dict[str, object], message: str) -> None:
    """Thresholds and curves out of order are said with their values."""
    with pytest.raises(ValidationError, match=message):
        parameters(**changes)
