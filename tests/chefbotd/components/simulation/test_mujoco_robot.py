"""The robot in three dimensions: the same motors, on a floor that it can slip on, climb and lean on."""

import math
from typing import Any

import pytest

from chefbotd.components.simulation.chassis import PUBLISHED, Chassis
from chefbotd.components.simulation.crowd import Crowd
from chefbotd.components.simulation.ground import Slip
from chefbotd.components.simulation.parameters.floor import FloorParameters
from chefbotd.components.simulation.parameters.motor import (
    MotorParameters,
    SimBatteryParameters,
    SimBodyParameters,
)
from chefbotd.components.simulation.parameters.simulation import SimImuParameters, SimulationParameters
from chefbotd.components.simulation.parameters.true import TrueMotor, TrueParameters
from chefbotd.components.simulation.plant import Plant, Push
from chefbotd.components.simulation.scene import of_walls
from chefbotd.components.simulation.sensors import Battery, Imu
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import replace
from tests.chefbotd.components.simulation.test_sensors import AT_REST, EXACT_IMU, chance

pytest.importorskip("mujoco", reason="an extra")

import numpy as np

from chefbotd.components.simulation.mujoco_robot import MujocoRobot

FAR_WALL = [(50.0, -50.0, 50.0, 50.0)]
FULL_BATTERY = SimBatteryParameters(resistance_ohm=0.0)


def robot_with(
    *floor: FloorParameters,
    chassis: Chassis = PUBLISHED,
    walls: list[tuple[float, float, float, float]] = FAR_WALL,
    crowd: Crowd | None = None,
    **body: Any,
) -> MujocoRobot:
    """ChefBot at the origin, on its wheels."""
    motor, shape = MotorParameters(), SimBodyParameters(**body)
    plant = Plant(motor, shape, 0.005, chassis)
    slip = Slip(TrueParameters(), chassis, seed=1)
    battery, scene = Battery.fresh(FULL_BATTERY), of_walls(np.array(walls))
    others = crowd or Crowd((), (), seed=0)
    return MujocoRobot(plant, motor, shape, chassis, scene, floor, battery, Pose2D(), slip, others)


def rolled_m(robot: MujocoRobot) -> list[float]:
    """How far each rim has turned."""
    return [0.045 * angle for angle in robot.wheel_angles_rad]


def test_a_robot_that_is_not_driven_stays_where_it_is() -> None:
    """Braked for 5 s it moves less than a tenth of a millimetre, level and without touching anything."""
    robot = robot_with()
    robot.drive([0, 0])
    robot.advance(5)
    state = robot.state
    assert math.hypot(state.world_from_base.x_m, state.world_from_base.y_m) < 1e-4
    assert state.tilt is not None
    assert abs(state.tilt.pitch_rad) < math.radians(0.1)
    assert not state.in_contact


def test_wheels_in_the_air_reach_the_speed_of_the_motors_curve() -> None:
    """What is lifted turns as the plant's own motors do, and goes nowhere."""
    robot = robot_with(mass_kg=0)
    plant = Plant(MotorParameters(), SimBodyParameters(mass_kg=0), 0.005)
    robot.drive([0.5, -0.5])
    robot.advance(3)
    curve = plant.curve(0, robot.state.terminal_v, forward=True)
    speed = curve.gain_rad_s * (0.5 - curve.dead_zone_share)
    assert robot.state.wheels.velocity_rad_s == pytest.approx([speed, -speed], rel=0.001)
    assert robot.state.world_from_base == Pose2D()


def test_a_motors_flaw_is_the_same_as_in_the_plane() -> None:
    """A left motor of nine tenths of the gain turns at nine tenths of the right one's speed."""
    left, right = PUBLISHED.wheels
    wheels = (replace(left, forward=TrueMotor(gain=0.9)), right)
    robot = robot_with(chassis=replace(PUBLISHED, wheels=wheels), mass_kg=0)
    robot.drive([0.5, 0.5])
    robot.advance(3)
    slow, fast = robot.state.wheels.velocity_rad_s
    assert slow == pytest.approx(0.9 * fast, rel=0.001)


def test_it_rolls_as_far_as_its_wheels_turn() -> None:
    """Straight on within 0.1 %, and on the spot within 0.5 %: treads have a width, and tyres give a little."""
    robot = robot_with()
    robot.drive([0.4, 0.4])
    robot.advance(3)
    assert robot.state.world_from_base.x_m == pytest.approx(sum(rolled_m(robot)) / 2, rel=0.001)
    robot.drive([0, 0])
    robot.advance(4)
    before_rad, before_m = robot.state.turned_rad, rolled_m(robot)
    robot.drive([-0.3, 0.3])
    robot.advance(6)
    left, right = (after - before for after, before in zip(rolled_m(robot), before_m, strict=True))
    assert robot.state.turned_rad - before_rad == pytest.approx((right - left) / 0.3, rel=0.005)


def test_wheels_without_grip_spin() -> None:
    """With a hundredth of the grip at full duty the wheels turn more than twice as far as the robot goes."""
    robot = robot_with()
    robot.slip.left = robot.slip.right = 0.99
    robot.drive([1, 1])
    robot.advance(1)
    assert robot.state.world_from_base.x_m < rolled_m(robot)[0] / 2


def test_a_slippery_patch_is_where_it_is() -> None:
    """A patch under the left wheel alone: the robot, at full duty, turns towards it."""
    robot = robot_with(
        FloorParameters(kind="slippery", x_m=0, y_m=0.15, length_m=4, width_m=0.1, friction=0.02)
    )
    robot.drive([1, 1])
    robot.advance(1)
    assert robot.state.turned_rad > math.radians(2)


def test_a_ramp_leans_the_robot_back_and_its_imu_feels_gravity() -> None:
    """On a slope of 0.1 m in 1 m the nose is up by 5.7 degrees, and 1 g * sin(5.7 degrees) is felt ahead."""
    robot = robot_with(FloorParameters(kind="ramp", x_m=1.7, y_m=0, length_m=3, width_m=2, height_m=0.1))
    slope_rad = math.atan2(0.1, 1.0)
    robot.drive([0.5, 0.5])
    while robot.state.world_from_base.x_m < 0.6:
        robot.advance(robot.trail[-1][0] + 0.1)
    robot.drive([0, 0])
    robot.advance(robot.trail[-1][0] + 2)
    tilt, motion = robot.state.tilt, robot.motion
    assert tilt is not None
    assert tilt.pitch_rad == pytest.approx(-slope_rad, abs=math.radians(0.3))
    acceleration, _ = Imu(EXACT_IMU, 0, AT_REST).counts(motion, chance())
    assert acceleration[0] == pytest.approx(16384 * math.sin(slope_rad), rel=0.05)
    x, y, z, w = Imu(SimImuParameters(heading_noise_rad=0), 0, AT_REST).orientation(motion, 0.0, chance())
    assert math.asin(2 * (w * y - z * x)) == pytest.approx(-slope_rad, abs=math.radians(0.3))


def test_a_bump_is_climbed_and_felt() -> None:
    """Crossing a sill of 8 mm the robot leans by a degree and more, and goes on."""
    robot = robot_with(FloorParameters(kind="bump", x_m=0.4, y_m=0, length_m=0.06, width_m=1, height_m=0.008))
    robot.drive([0.6, 0.6])
    most_rad = 0.0
    for step in range(600):
        robot.advance(step * 0.01)
        assert robot.state.tilt is None or abs(robot.state.tilt.pitch_rad) < math.radians(20)
        if robot.state.tilt is not None:
            most_rad = max(most_rad, abs(robot.state.tilt.pitch_rad))
    assert most_rad > math.radians(1)
    assert robot.state.world_from_base.x_m > 0.7


def test_a_wall_stops_it() -> None:
    """With a wall 0.5 m ahead and a radius of 0.18 m, it comes no further than 0.32 m, and touches."""
    robot = robot_with(walls=[(0.5, -2.0, 0.5, 2.0)])
    robot.drive([0.3, 0.3])
    robot.advance(5)
    assert robot.state.world_from_base.x_m == pytest.approx(0.315, abs=0.005)
    assert robot.state.in_contact


def test_a_thing_that_is_put_in_its_way_stops_it_until_it_is_taken_away() -> None:
    """A disc of 0.1 m, 0.6 m ahead: its near side is at 0.5 m. Without it the robot goes on."""
    crowd = Crowd((), (), seed=0)
    robot = robot_with(crowd=crowd)
    robot.drive([0.3, 0.3])
    robot.advance(0.5)
    crowd.put("chair", 0.6, 0.0, 0.1)
    robot.advance(5)
    assert robot.state.world_from_base.x_m == pytest.approx(0.32, abs=0.01)
    assert robot.state.in_contact
    crowd.take_away("chair")
    robot.advance(8)
    assert robot.state.world_from_base.x_m > 0.5


def test_a_push_moves_it_against_its_brakes() -> None:
    """40 N forward for half a second move a braked robot forward, 40 N to the left aside; then it stands again."""
    for push, ahead, aside in ((Push(forward_n=40), True, False), (Push(leftward_n=40), False, True)):
        robot = robot_with()
        robot.drive([0, 0])
        robot.advance(1)
        robot.push(push, 0.5)
        robot.advance(3)
        pose = robot.state.world_from_base
        assert (pose.x_m > 0.01, pose.y_m > 0.01) == (ahead, aside)
        assert robot.state.twist.linear_m_s == pytest.approx(0, abs=1e-3)


def test_a_start_in_a_wall_is_refused() -> None:
    """As in the plane."""
    with pytest.raises(ValueError, match="from a wall"):
        robot_with(walls=[(0.1, -2.0, 0.1, 2.0)])


def test_a_floor_needs_the_physics_that_knows_it() -> None:
    """In the plane there are no bumps, and a bump has a height."""
    bump = {"kind": "bump", "x_m": 1, "y_m": 0, "length_m": 0.1, "height_m": 0.01}
    SimulationParameters.model_validate({"physics": "mujoco", "floor": [bump]})
    with pytest.raises(ValueError, match="needs physics = 'mujoco', got 'planar'"):
        SimulationParameters.model_validate({"floor": [bump]})
    with pytest.raises(ValueError, match="a bump needs a height_m above 0"):
        FloorParameters.model_validate({**bump, "height_m": 0})
