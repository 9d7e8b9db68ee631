"""The drive train by its data sheets: gear motor with its bridge, wheels and weight.

All quantities are referred to the gearbox's output shaft, which is the wheel's axle.
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Final, Self

from pydantic import Field, model_validator

from chefbotd.core.parameters import Parameters

GRAVITY_M_S2 = 9.80665

STATIC_TO_KINETIC_FRICTION: Final = 1.3
"""How much more a motor that stands is held than one that turns; assumed."""


class MotorParameters(Parameters):
    """A gear motor as its data sheet gives it, and the bridge that drives it.

    The defaults are the published robot's 80 rpm at 12 V; currents and stall torque are those of the common
    12 V motor of its class (64 counts per turn, 131.25:1 gear). Pulses shorter than ``dead_zone_share`` of the PWM's
    period do not switch the bridge (assumed).
    """

    retired: ClassVar[Mapping[str, Any]] = {"static_to_kinetic_friction": STATIC_TO_KINETIC_FRICTION}

    rated_voltage_v: float = Field(12.0, gt=0, le=60)
    """The voltage for which the data sheet's numbers hold."""
    no_load_speed_rpm: float = Field(80.0, gt=0, le=10_000)
    """How fast the wheel turns without a load."""
    no_load_current_a: float = Field(0.3, gt=0, le=10)
    """The current that it takes then."""
    stall_current_a: float = Field(5.0, gt=0, le=100)
    """The current of a motor that is held."""
    stall_torque_n_m: float = Field(1.765, gt=0, le=100)
    """The torque of a motor that is held."""
    dry_friction_share: float = Field(0.8, ge=0, le=1)
    """The share of the losses without a load that is dry friction (the rest grows with the speed)."""
    rotor_inertia_kg_m2: float = Field(0.012, gt=0, le=10)
    """The inertia of the rotor, as felt at the wheel."""
    dead_zone_share: float = Field(0.02, ge=0, lt=1)

    @model_validator(mode="after")
    def _is_a_motor(self) -> Self:
        if self.no_load_current_a >= self.stall_current_a:
            raise ValueError(f"no_load_current_a {self.no_load_current_a} must be below stall_current_a")
        if self.torque_constant_n_m_a > self.back_emf_constant_v_s:
            raise ValueError(
                f"stall_torque_n_m {self.stall_torque_n_m} is more than the electrical power can give"
            )
        return self

    @property
    def resistance_ohm(self) -> float:
        """Winding resistance: at stall there is no back-EMF."""
        return self.rated_voltage_v / self.stall_current_a

    @property
    def no_load_speed_rad_s(self) -> float:
        """Shaft speed at the rated voltage when nothing is driven."""
        return self.no_load_speed_rpm * math.tau / 60

    @property
    def back_emf_constant_v_s(self) -> float:
        """Volts per rad/s."""
        return (
            self.rated_voltage_v - self.resistance_ohm * self.no_load_current_a
        ) / self.no_load_speed_rad_s

    @property
    def torque_constant_n_m_a(self) -> float:
        """Newton metres per ampere; less than the back-EMF constant by what the gearbox loses."""
        return self.stall_torque_n_m / self.stall_current_a

    @property
    def dry_friction_n_m(self) -> float:
        """Coulomb friction of motor and gearbox: a share of what the no-load current overcomes."""
        return self.dry_friction_share * self.torque_constant_n_m_a * self.no_load_current_a

    @property
    def viscous_friction_n_m_s(self) -> float:
        """The rest of the no-load friction, in proportion to speed."""
        share = 1 - self.dry_friction_share
        return share * self.torque_constant_n_m_a * self.no_load_current_a / self.no_load_speed_rad_s


class SimBodyParameters(Parameters):
    """The robot's size and weight, and how its wheels meet the ground; a mass of 0 is a robot whose wheels hang free.

    A robot whose wheels are spread over a ``wheelbase_m`` turns by dragging them sideways (skid steer), against their
    grip: the tighter it turns, the harder. What hangs higher than ``height_m`` (assumed), such as a
    table's top, is passed under.
    """

    wheelbase_m: float = Field(0.0, ge=0, le=5)
    """How far the wheels are spread along the robot: it drags them sideways when it turns."""
    radius_m: float = Field(0.18, gt=0, le=2)
    """The radius of the round robot that touches walls and people."""
    height_m: float = Field(0.35, gt=0, le=3)
    mass_kg: float = Field(6.0, ge=0, le=500)
    """The robot's mass; 0: its wheels hang free."""
    yaw_inertia_kg_m2: float = Field(0.1, ge=0, le=100)
    """Its inertia against turning."""
    rolling_resistance: float = Field(0.03, ge=0, le=1)
    """The share of its weight that rolling takes."""
    grip: float = Field(0.6, ge=0, le=2)
    """The friction of its wheels on the floor."""


class SimBatteryParameters(Parameters):
    """A 12 V lead-acid battery, the electronics on it besides the motors, and the noise of the ADC that watches it."""

    capacity_ah: float = Field(10.0, gt=0, le=1000)
    """What a full battery holds."""
    start_charge_share: float = Field(1.0, ge=0, le=1)
    """How full it is at the start."""
    resistance_ohm: float = Field(0.05, ge=0, le=10)
    """Its inner resistance, by which it sags under load."""
    electronics_current_a: float = Field(2.0, ge=0, le=100)
    """What the electronics take besides the motors."""
    adc_noise_counts: float = Field(2.0, ge=0, le=100)
    """The noise of the analogue input that watches it."""
