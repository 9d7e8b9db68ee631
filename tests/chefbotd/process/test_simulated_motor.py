"""The simulated robot has the motors that its own configuration describes, and not always ChefBot's."""

import asyncio
import math

import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.simulation.parameters.motor import MotorParameters
from chefbotd.components.simulation.process.simulated_robot import motor_of
from chefbotd.settings import Settings, load, packaged
from chefbotd.testing.daemon import simulated_robot

ROVER = {
    "imu": False,
    "ultrasonic": False,
    "battery": False,
    "safety.guard.enabled": False,
    "chassis.track_width_m": 0.17,
    "chassis.wheels.left_wheel.radius_m": 0.033,
    "chassis.wheels.right_wheel.radius_m": 0.033,
    "encoders.counts_per_turn": 1440.0,
    "encoders.max_speed_rad_s": 36.0,
    "encoders.max_acceleration_rad_s2": 108.0,
    "drive.max_rim_speed_m_s": 0.535,
    "limits.linear.max_forward_m_s": 0.5,
    "pid.ks_duty": 30.0,
    "pid.kv_duty_per_m_s": 378.8,
    "pid.ka_duty_per_m_s2": 9.5,
    "pid.kp_duty_per_m_s": 126.7,
    "pid.ki_duty_per_m": 1267.0,
}
"""A small robot whose free rim makes 18 rad/s of 33 mm at full duty: 0.594 m/s, where ChefBot's motors make 0.276."""


def rover(**overrides: object) -> Settings:
    """It, with some keys changed."""
    return load(overrides={**ROVER, **overrides})


def test_the_packaged_robots_keep_their_motors() -> None:
    """ChefBot's 80 rpm, and KHAN's from its own section."""
    assert motor_of(load()) == MotorParameters()
    khan = load(packaged("khan"))
    assert motor_of(khan) == khan.sim.motor


def test_a_faster_robot_has_faster_motors() -> None:
    """0.535 m/s under load are nine tenths of 0.594 m/s: 18 rad/s are 172 rpm. The power of the motor is the same."""
    motor, usual = motor_of(rover()), MotorParameters()
    assert motor.no_load_speed_rpm == pytest.approx(18.0 * 60 / math.tau, rel=0.005)
    assert motor.no_load_speed_rpm * motor.stall_torque_n_m == pytest.approx(80.0 * usual.stall_torque_n_m)


def test_calibrated_models_count_in_place_of_the_gains() -> None:
    """(255 - 30) duties of 0.08 rad/s are the same 18 rad/s."""
    model = {"dead_zone_duty": 30.0, "gain_rad_s_per_duty": 0.08, "time_constant_s": 0.1}
    motors = {name: {"forward": model, "reverse": model} for name in ("left_wheel", "right_wheel")}
    motor = motor_of(rover(**{"drive.motors": motors, "pid.kv_duty_per_m_s": 0.0}))
    assert motor.no_load_speed_rpm == pytest.approx(171.9, rel=0.005)


@pytest.mark.parametrize(
    "overrides",
    [{"drive.max_rim_speed_m_s": 0.2}, {"pid.kv_duty_per_m_s": 300.0}, {"sim.motor.no_load_speed_rpm": 80.0}],
)
def test_a_limit_or_a_wrong_feedforward_alone_makes_no_other_motor(overrides: dict[str, object]) -> None:
    """Only both together describe a motor; and [sim.motor] is the last word."""
    assert motor_of(load(overrides=overrides)) == MotorParameters()


def test_a_fast_robot_reaches_its_speed_in_the_simulator() -> None:
    """0.45 m/s is asked for and reached within 5 %: ChefBot's motors end below 0.3 m/s on these wheels."""

    async def scenario() -> float:
        async with simulated_robot(rover()) as robot:
            await robot.client.arm()
            for _ in range(30):
                await robot.client.drive(0.45, 0.0)
                await asyncio.sleep(0.1)
            state = await robot.client.get_state()
            return float(state.odometry.linear_m_s)

    assert run_virtual(scenario()) == pytest.approx(0.45, rel=0.05)
