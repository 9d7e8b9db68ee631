"""Gear motor and body: what follows from the data sheet."""

import math

import pytest
from pydantic import ValidationError

from chefbotd.components.simulation.chassis import PUBLISHED
from chefbotd.components.simulation.parameters.motor import MotorParameters


def test_constants_follow_from_the_data_sheet() -> None:
    """Resistance, back-EMF and torque constants are those that a data sheet's four points imply."""
    motor = MotorParameters(
        rated_voltage_v=12, no_load_speed_rpm=60, no_load_current_a=1, stall_current_a=6, stall_torque_n_m=3
    )
    assert motor.resistance_ohm == pytest.approx(12 / 6)
    assert motor.no_load_speed_rad_s == pytest.approx(2 * math.pi)
    assert motor.back_emf_constant_v_s == pytest.approx((12 - 2 * 1) / (2 * math.pi))
    assert motor.torque_constant_n_m_a == pytest.approx(3 / 6)


def test_no_load_friction_is_split_into_dry_and_viscous() -> None:
    """Both kinds of friction together take exactly the torque of the no-load current at no-load speed."""
    motor = MotorParameters(dry_friction_share=0.75)
    no_load_n_m = 1.765 / 5 * 0.3
    viscous_n_m = motor.viscous_friction_n_m_s * 80 * 2 * math.pi / 60
    assert motor.dry_friction_n_m == pytest.approx(0.75 * no_load_n_m)
    assert motor.dry_friction_n_m + viscous_n_m == pytest.approx(no_load_n_m)


def test_default_rim_speed_is_the_published_one() -> None:
    """80 rpm on a 0.09 m wheel are 0.377 m/s."""
    rim_m_s = MotorParameters().no_load_speed_rad_s * PUBLISHED.wheels[0].radius_m
    assert rim_m_s == pytest.approx(0.377, abs=0.0005)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"no_load_current_a": 5.0}, "no_load_current_a 5.0"),
        ({"dead_zone_share": 1.0}, "dead_zone_share"),
        ({"stall_torque_n_m": 7.0}, "stall_torque_n_m 7.0"),
        ({"volts": 12}, "volts"),
    ],
)
def test_impossible_motors_are_refused(wrong: dict[str, float], named: str) -> None:
    """A motor that idles at its stall current, never switches or makes energy is named and refused."""
    with pytest.raises(ValidationError, match=named):
        MotorParameters.model_validate(wrong)
