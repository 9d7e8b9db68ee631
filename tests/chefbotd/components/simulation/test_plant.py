"""The drive train against closed-form solutions."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.simulation.chassis import PUBLISHED, Chassis, Wheel
from chefbotd.components.simulation.parameters.motor import MotorParameters, SimBodyParameters
from chefbotd.components.simulation.parameters.true import TrueMotor
from chefbotd.components.simulation.plant import Plant, Supply, WheelState
from chefbotd.core.record import replace
from tests.budget import examples

HANGING = SimBodyParameters(mass_kg=0)
FULL = (1.0, 1.0)
# The default motor: R = 12 / 5 ohm, Ke = (12 - 2.4 * 0.3) / 8.37758 V s, Kt = 1.765 / 5 N m/A.
RESISTANCE_OHM = 2.4
BACK_EMF_V_S = 11.28 / 8.37758
TORQUE_N_M_A = 0.353


def wheeled(order: str) -> Chassis:
    """The default chassis with wheels on these sides, in this order."""
    return replace(PUBLISHED, wheels=tuple(Wheel(side == "L", 0.045) for side in order))


def spin(plant: Plant, state: WheelState, shares: tuple[float, ...] | None, seconds: float) -> WheelState:
    """The wheels after so long at 12 V."""
    pulse_width = None if shares is None else plant.pulse_width(shares)
    for _ in range(round(seconds / plant.step_s)):
        state = plant.step(state, pulse_width, 12.0)
    return state


def spinning(*velocity_rad_s: float) -> WheelState:
    """Wheels at angle 0 with these speeds."""
    return WheelState((0.0,) * len(velocity_rad_s), velocity_rad_s)


def frictionless_motor() -> MotorParameters:
    """The default motor with all its no-load loss viscous."""
    return MotorParameters(dry_friction_share=0)


def test_free_wheels_reach_the_no_load_speed() -> None:
    """At the rated voltage a hanging wheel settles at 80 rpm = 8.37758 rad/s."""
    plant = Plant(MotorParameters(), HANGING, 0.005)
    state = spin(plant, plant.standing, FULL, 2.0)
    assert state.velocity_rad_s == pytest.approx([8.37758, 8.37758], abs=1e-4)


@pytest.mark.parametrize("step_s", [0.001, 0.005, 0.02])
def test_spin_up_has_the_motors_time_constant_at_any_step(step_s: float) -> None:
    """Without dry friction speed is 1 - 1/e of its final value after J / (b + Kt Ke / R), whatever the step."""
    friction_n_m_s = TORQUE_N_M_A * 0.3 / 8.37758
    damping = friction_n_m_s + TORQUE_N_M_A * BACK_EMF_V_S / RESISTANCE_OHM
    motor = frictionless_motor().model_copy(update={"rotor_inertia_kg_m2": 0.1 * damping})
    plant = Plant(motor, HANGING, step_s)  # the time constant is 0.1 s by choice of the inertia
    state = spin(plant, plant.standing, FULL, 0.1)
    assert state.velocity_rad_s == pytest.approx([8.37758 * (1 - math.exp(-1))] * 2, rel=1e-5)


def test_duty_zero_brakes_and_an_open_bridge_coasts() -> None:
    """A shorted motor is slowed by its own current (J R / (Kt Ke)), an open one by viscous friction alone."""
    motor = frictionless_motor()
    plant = Plant(motor, HANGING, 0.005)
    friction_n_m_s = TORQUE_N_M_A * 0.3 / 8.37758
    magnetic_n_m_s = TORQUE_N_M_A * BACK_EMF_V_S / RESISTANCE_OHM
    braked = spin(plant, spinning(8.0, -8.0), (0, 0), 0.05)
    coasted = spin(plant, spinning(8.0, -8.0), None, 0.05)
    shrunk = math.exp(-(friction_n_m_s + magnetic_n_m_s) / 0.012 * 0.05)
    assert braked.velocity_rad_s == pytest.approx([8 * shrunk, -8 * shrunk], rel=1e-5)
    assert coasted.velocity_rad_s[0] == pytest.approx(8 * math.exp(-friction_n_m_s / 0.012 * 0.05), rel=1e-5)


def test_dry_friction_stops_a_coasting_wheel_for_good() -> None:
    """With dry friction alone, 8 rad/s fade at 0.1059 N m / 0.012 kg m2 = 8.825 rad/s2: gone after 0.907 s."""
    plant = Plant(MotorParameters(dry_friction_share=1), HANGING, 0.005)
    assert spin(plant, spinning(8.0, 8.0), None, 0.5).velocity_rad_s == pytest.approx([3.5875] * 2)
    assert spin(plant, spinning(8.0, 8.0), None, 0.91).velocity_rad_s == (0.0, 0.0)


def test_static_friction_and_dead_zone_hold_a_wheel() -> None:
    """To start, the pulses must give 1.3 * 0.08472 N m: 0.749 V of 12 V, above the dead zone a share of 0.0811."""
    plant = Plant(MotorParameters(), HANGING, 0.005)
    start = 0.02 + 0.98 * 1.3 * 0.08472 / TORQUE_N_M_A * RESISTANCE_OHM / 12
    assert start == pytest.approx(0.08115, abs=1e-5)
    assert spin(plant, plant.standing, (0.081, -0.081), 0.5).velocity_rad_s == (0.0, 0.0)
    left, right = spin(plant, plant.standing, (0.0813, -0.0813), 0.5).velocity_rad_s
    assert left > 0 > right


def test_a_wheel_stands_while_the_other_drives() -> None:
    """The robot's inertia couples its wheels, yet friction holds the undriven one exactly still."""
    plant = Plant(MotorParameters(), SimBodyParameters(), 0.005)
    state = spin(plant, plant.standing, (0.3, 0.0), 1.0)
    assert state.velocity_rad_s[0] > 1
    assert state.angle_rad[1] == pytest.approx(0.0, abs=1e-9)


def test_weight_adds_inertia() -> None:
    """Straight ahead each wheel moves half the mass: J + 6 kg * (0.045 m)^2 / 2 = 0.018075 kg m2."""
    motor = frictionless_motor()
    plant = Plant(motor, SimBodyParameters(rolling_resistance=0), 1e-4)
    state = spin(plant, plant.standing, FULL, 1e-4)
    assert state.velocity_rad_s == pytest.approx([1e-4 * TORQUE_N_M_A * 5 / 0.018075] * 2, rel=2e-3)


def test_turning_feels_the_yaw_inertia() -> None:
    """On the spot each wheel turns Iz (r / track)^2 * 2: 0.012 + 0.1 * 0.0225 * 2 = 0.0165 kg m2."""
    plant = Plant(frictionless_motor(), SimBodyParameters(rolling_resistance=0), 1e-4)
    state = spin(plant, plant.standing, (-1.0, 1.0), 1e-4)
    gained_rad_s = 1e-4 * TORQUE_N_M_A * 5 / 0.0165
    assert state.velocity_rad_s == pytest.approx([-gained_rad_s, gained_rad_s], rel=2e-3)


def test_supply_sags_under_load_and_rises_when_braking() -> None:
    """Two stalled motors at full duty put 1.2 ohm behind 0.1 ohm: 13 V fall to 12 V; spinning ones give back."""
    plant = Plant(MotorParameters(), HANGING, 0.005)
    full = plant.pulse_width(FULL)
    supply = Supply(open_circuit_v=13.0, resistance_ohm=0.1)
    assert plant.load(plant.standing, full, supply) == pytest.approx((12.0, 10.0))
    assert plant.load(spinning(20.0, 20.0), full, supply)[0] > 13.0
    electronics = Supply(open_circuit_v=13.0, resistance_ohm=0.1, base_load_a=2.0)
    for idle in (plant.pulse_width((0, 0)), None):
        assert plant.load(spinning(5.0, 5.0), idle, electronics) == pytest.approx((12.8, 2.0))


def test_twist_follows_the_rims() -> None:
    """Left 1 rad/s and right 3 rad/s on 0.045 m wheels 0.3 m apart: 0.09 m/s and 0.3 rad/s to the left."""
    twist = Plant(MotorParameters(), HANGING, 0.005).twist([1.0, 3.0])
    assert (twist.linear_m_s, twist.angular_rad_s) == pytest.approx((0.09, 0.3))


def flawed(**factors: float) -> Chassis:
    """The default chassis, the left motor of which is flawed in its forward direction."""
    left, right = PUBLISHED.wheels
    return replace(PUBLISHED, wheels=(replace(left, forward=TrueMotor(**factors)), right))


def test_a_gain_is_one_of_the_speed_for_a_duty_in_one_direction() -> None:
    """With a gain of 0.9 a hanging wheel settles at nine tenths of 8.37758 rad/s forward, and at all of it backwards."""
    plant = Plant(MotorParameters(), HANGING, 0.005, flawed(gain=0.9))
    assert spin(plant, plant.standing, (1.0, 1.0), 2.0).velocity_rad_s == pytest.approx(
        [0.9 * 8.37758, 8.37758], abs=1e-4
    )
    assert spin(plant, plant.standing, (-1.0, -1.0), 2.0).velocity_rad_s == pytest.approx(
        [-8.37758] * 2, abs=1e-4
    )


def test_a_dead_zone_grows_with_its_factor() -> None:
    """Twice the dead zone: pulses of 0.04, and 2 * 1.3 * 0.08472 N m of friction before it starts, a share of 0.1597."""
    plant = Plant(MotorParameters(), HANGING, 0.005, flawed(dead_zone=2.0))
    start = 0.04 + 0.96 * 2 * 1.3 * 0.08472 / TORQUE_N_M_A * RESISTANCE_OHM / 12
    assert start == pytest.approx(0.15980, abs=1e-5)
    assert spin(plant, plant.standing, (0.1597, 0.0), 0.5).velocity_rad_s[0] == 0.0
    assert spin(plant, plant.standing, (0.1600, 0.0), 0.5).velocity_rad_s[0] > 0


def test_a_motors_curve_is_what_it_does() -> None:
    """Straight ahead, duties of 0.3 and 0.6 end at the curve's speeds, 1 - 1/e of the way after a time constant."""
    plant = Plant(MotorParameters(), SimBodyParameters(), 0.005)
    curve = plant.curve(0, 12.0, forward=True)
    for share in (0.3, 0.6):
        reached = spin(plant, plant.standing, (share, share), 3.0).velocity_rad_s[0]
        assert reached == pytest.approx(curve.gain_rad_s * (share - curve.dead_zone_share), rel=1e-6)
    rising = spin(plant, spinning(1.0, 1.0), (0.6, 0.6), curve.time_constant_s).velocity_rad_s[0]
    assert rising == pytest.approx(reached - (reached - 1.0) * math.exp(-1), rel=0.01)


def test_a_flawed_motors_curve_has_its_factors() -> None:
    """Without friction the dead zone is that of the pulses; the other direction is the healthy motor's."""
    healthy = Plant(frictionless_motor(), HANGING, 0.005).curve(0, 12.0, forward=True)
    flaws = flawed(gain=0.9, dead_zone=2.0, time_constant=1.3)
    flawed_one = Plant(frictionless_motor(), HANGING, 0.005, flaws).curve(0, 12.0, forward=True)
    assert flawed_one.gain_rad_s == pytest.approx(0.9 * healthy.gain_rad_s * 0.98 / 0.96)
    assert flawed_one.dead_zone_share == pytest.approx(2 * healthy.dead_zone_share)
    assert flawed_one.time_constant_s == pytest.approx(1.3 * healthy.time_constant_s)
    assert Plant(frictionless_motor(), HANGING, 0.005, flaws).curve(0, 12.0, forward=False) == healthy


def test_a_time_constant_is_one_of_the_approach_to_a_speed() -> None:
    """With 0.1 s by choice of the inertia and a factor of 1.3, speed is 1 - 1/e of its final value after 0.13 s."""
    friction_n_m_s = TORQUE_N_M_A * 0.3 / 8.37758
    damping = friction_n_m_s + TORQUE_N_M_A * BACK_EMF_V_S / RESISTANCE_OHM
    motor = frictionless_motor().model_copy(update={"rotor_inertia_kg_m2": 0.1 * damping})
    plant = Plant(motor, HANGING, 0.005, flawed(time_constant=1.3))
    state = spin(plant, plant.standing, FULL, 0.13)
    reached = [1 - math.exp(-1), 1 - math.exp(-1.3)]
    assert state.velocity_rad_s == pytest.approx([8.37758 * share for share in reached], rel=1e-5)


def test_four_wheels_average_per_side() -> None:
    """Front and rear wheels of a side share its motion: left (1, 3), right (5, 7) are left 2 and right 6."""
    twist = Plant(MotorParameters(), HANGING, 0.005, wheeled("LRLR")).twist([1.0, 5.0, 3.0, 7.0])
    assert (twist.linear_m_s, twist.angular_rad_s) == pytest.approx((4 * 0.045, 4 * 0.045 / 0.3))


@pytest.mark.parametrize(
    ("order", "velocity_rad_s"),
    [("LLRR", [1, 3, 5, 7]), ("RLLR", [5, 1, 3, 7]), ("LRL", [1, 6, 3]), ("RRRLLL", [5, 6, 7, 1, 2, 3])],
)
def test_wheels_come_in_any_order_and_number(order: str, velocity_rad_s: list[float]) -> None:
    """Left 2 rad/s and right 6 rad/s in the mean, however many wheels share a side and wherever they are listed."""
    twist = Plant(MotorParameters(), HANGING, 0.005, wheeled(order)).twist(velocity_rad_s)
    assert (twist.linear_m_s, twist.angular_rad_s) == pytest.approx((4 * 0.045, 4 * 0.045 / 0.3))


def test_every_wheel_has_its_own_radius() -> None:
    """Two left wheels of 0.04 and 0.06 m at 1 rad/s, a right one of 0.05 m at 2 rad/s: rims of 0.05 and 0.1 m/s."""
    chassis = Chassis((Wheel(True, 0.04), Wheel(True, 0.06), Wheel(False, 0.05)), 0.25, 1000)
    twist = Plant(MotorParameters(), HANGING, 0.005, chassis).twist([1.0, 1.0, 2.0])
    assert (twist.linear_m_s, twist.angular_rad_s) == pytest.approx((0.075, 0.2))


def test_skidding_against_a_wall_takes_the_grips_torque() -> None:
    """A held robot's wheels spin against grip * weight: 0.6 * 29.42 N * 0.045 m more friction each."""
    plant = Plant(frictionless_motor(), SimBodyParameters(rolling_resistance=0), 0.005)
    state, pulse_width = plant.standing, plant.pulse_width(FULL)
    for _ in range(400):
        state = plant.step(state, pulse_width, 12.0, skid=1.0)
    damping = TORQUE_N_M_A * 0.3 / 8.37758 + TORQUE_N_M_A * BACK_EMF_V_S / RESISTANCE_OHM
    lost_rad_s = 0.6 * 6 * 9.80665 / 2 * 0.045 / damping
    assert state.velocity_rad_s == pytest.approx([8.37758 - lost_rad_s] * 2, rel=1e-4)


@pytest.mark.parametrize(
    ("asked", "passed"), [(0.0, 0.0), (0.02, 0.0), (1.0, 1.0), (-1.0, -1.0), (-0.02, 0.0), (0.51, 0.5)]
)
def test_pulse_width_has_a_dead_zone(asked: float, passed: float) -> None:
    """Up to a share of 0.02 nothing passes, at 1 everything does: (0.51 - 0.02) / 0.98 is half."""
    passing = Plant(MotorParameters(), HANGING, 0.005).pulse_width((asked, 0.0))
    assert passing == pytest.approx([passed, 0.0])


def test_wrong_numbers_are_refused() -> None:
    """One duty for two wheels, and a step that is not positive, raise with what was given."""
    with pytest.raises(ValueError, match="1 PWM shares for 2 wheels"):
        Plant(MotorParameters(), HANGING, 0.005).pulse_width((0.1,))
    with pytest.raises(ValueError, match=r"step_s must be positive, got 0"):
        Plant(MotorParameters(), HANGING, 0)


def test_the_ground_holds_the_wheels_of_a_side_together() -> None:
    """Of two left motors one has nine tenths of the gain: on the ground they roll alike, in the air they do not."""
    khan = wheeled("LRLR")
    weak = replace(khan.wheels[0], forward=TrueMotor(gain=0.9))
    uneven = replace(khan, wheels=(weak, *khan.wheels[1:]))
    on_ground = Plant(MotorParameters(), SimBodyParameters(wheelbase_m=0.2), 0.005, uneven)
    left, _, rear_left, _ = spin(on_ground, on_ground.standing, (0.5,) * 4, 2.0).velocity_rad_s
    assert left == pytest.approx(rear_left, rel=0.02)
    hanging = Plant(MotorParameters(), HANGING, 0.005, uneven)
    left, _, rear_left, _ = spin(hanging, hanging.standing, (0.5,) * 4, 2.0).velocity_rad_s
    assert left == pytest.approx(0.9 * rear_left, rel=1e-6)


def test_tyres_change_nothing_where_the_wheels_of_a_side_are_alike() -> None:
    """Four equal wheels move as if each side had none to hold on to: grip is only spent where rims differ."""
    slick, rough = (
        Plant(MotorParameters(), SimBodyParameters(grip=grip), 0.005, wheeled("LRLR")) for grip in (0.0, 0.6)
    )
    shares = (0.5, 0.4, 0.5, 0.4)
    assert spin(rough, rough.standing, shares, 0.5).velocity_rad_s == pytest.approx(
        spin(slick, slick.standing, shares, 0.5).velocity_rad_s, rel=1e-9
    )


@settings(max_examples=examples(60))
@given(
    left=st.floats(-20, 20),
    right=st.floats(-20, 20),
    shares=st.sampled_from([None, (0.0, 0.0), (0.01, -0.01)]),
)
def test_without_drive_energy_never_grows(
    left: float, right: float, shares: tuple[float, float] | None
) -> None:
    """Neither braking nor coasting, at any pair of speeds, adds to the kinetic energy of robot and rotors."""
    plant = Plant(MotorParameters(), SimBodyParameters(), 0.005)

    def energy_j(state: WheelState) -> float:
        twist = plant.twist(state.velocity_rad_s)
        rotors = 0.012 * sum(speed**2 for speed in state.velocity_rad_s)
        return (rotors + 6 * twist.linear_m_s**2 + 0.1 * twist.angular_rad_s**2) / 2

    state = spinning(left, right)
    for _ in range(40):
        after = spin(plant, state, shares, 0.005)
        assert energy_j(after) <= energy_j(state) + 1e-12
        state = after


def test_a_motor_without_any_damping_coasts_for_ever() -> None:
    """The exact step has no division by a damping of zero: nothing slows a wheel that nothing rubs."""
    motor = MotorParameters(dry_friction_share=1, no_load_current_a=1e-9)
    plant = Plant(motor, HANGING, 0.005)
    assert spin(plant, spinning(3.0, 3.0), None, 1.0).velocity_rad_s == pytest.approx([3.0, 3.0])


def test_skid_steer_pays_for_turning_and_not_for_driving() -> None:
    """Turning on the spot a wheelbase of 0.1 m costs each axle 0.6 * 14.71 N * 0.1 / 0.3 * 0.045 m = 0.1324 N m.

    Against a damping of 0.353 * 1.34645 / 2.4 + 0.0025 = 0.2006 N m s that is 0.660 rad/s; straight on it is nothing.
    """
    skidding = Plant(MotorParameters(), SimBodyParameters(wheelbase_m=0.1), 0.005, wheeled("LRLR"))
    plain = Plant(MotorParameters(), SimBodyParameters(), 0.005, wheeled("LRLR"))
    turning = (-1.0, 1.0, -1.0, 1.0)
    slower = spin(plain, plain.standing, turning, 4.0).velocity_rad_s[1]
    slower -= spin(skidding, skidding.standing, turning, 4.0).velocity_rad_s[1]
    assert slower == pytest.approx(0.660, abs=0.003)
    straight = [spin(plant, plant.standing, FULL * 2, 1.0).velocity_rad_s for plant in (skidding, plain)]
    assert straight[0] == pytest.approx(straight[1])


def test_skidding_wheels_come_to_rest() -> None:
    """Braked out of a turn on the spot they stand, and what drags them sideways does not push them back."""
    skidding = Plant(MotorParameters(), SimBodyParameters(wheelbase_m=0.1), 0.005, wheeled("LRLR"))
    assert not any(spin(skidding, spinning(3.0, -3.0, 3.0, -3.0), (0,) * 4, 2.0).velocity_rad_s)
