"""The robot in its world: exact arcs, readings between steps, and walls that hold."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.simulation.chassis import PUBLISHED
from chefbotd.components.simulation.ground import Backlash, Slip
from chefbotd.components.simulation.parameters.motor import (
    MotorParameters,
    SimBatteryParameters,
    SimBodyParameters,
)
from chefbotd.components.simulation.parameters.true import TrueParameters
from chefbotd.components.simulation.planar import PlanarRobot, arc
from chefbotd.components.simulation.plant import Plant
from chefbotd.components.simulation.rooms import scene_of
from chefbotd.components.simulation.sensors import Battery
from chefbotd.components.simulation.world import World
from chefbotd.core.geometry import Pose2D, Twist2D
from tests.budget import examples

FAR_WALL = World([(50.0, -50.0, 50.0, 50.0)])
NEAR_WALL = World([(0.5, -50.0, 0.5, 50.0)])


def robot_in(world: World, start: Pose2D | None = None) -> PlanarRobot:
    """The default robot in this world."""
    body = SimBodyParameters()
    plant = Plant(MotorParameters(), body, 0.005)
    battery, slip = Battery.fresh(SimBatteryParameters()), Slip(TrueParameters(), PUBLISHED, seed=1)
    return PlanarRobot(plant, body, world, battery, start or Pose2D(), Backlash(PUBLISHED), slip)


def test_an_arc_is_exact() -> None:
    """pi/2 m/s and pi/2 rad/s for 1 s is a quarter of a circle of radius 1: (1, 1, 90 degrees)."""
    end = arc(Twist2D(math.pi / 2, math.pi / 2), 1.0)
    assert (end.x_m, end.y_m, end.heading_rad) == pytest.approx((1.0, 1.0, math.pi / 2))


def test_a_straight_arc_is_a_line() -> None:
    """Without turning there is no radius to divide by: 2 m/s for 0.5 s is 1 m ahead."""
    assert arc(Twist2D(2.0, 0.0), 0.5) == Pose2D(1.0, 0.0, 0.0)


def test_pose_agrees_with_the_wheels() -> None:
    """Driven straight, the robot has gone as far as its wheels have rolled; turned, as far as they differ."""
    robot = robot_in(FAR_WALL)
    robot.drive((0.5, 0.5))
    robot.advance(2.0)
    rolled_m = 0.045 * robot.wheel_angles_rad[0]
    assert robot.truth(0.0).world_from_base.x_m == pytest.approx(rolled_m)
    before = robot.wheel_angles_rad
    robot.drive((0.0, 0.0))
    robot.advance(3.0)
    robot.drive((-0.3, 0.3))
    robot.advance(4.0)
    left, right = [0.045 * (now - then) for now, then in zip(robot.wheel_angles_rad, before, strict=True)]
    assert robot.truth(0.0).world_from_base.heading_rad == pytest.approx((right - left) / 0.3)


def test_looking_changes_nothing() -> None:
    """A robot that is looked at all the time ends exactly where one that is not does."""
    watched, alone = robot_in(FAR_WALL), robot_in(FAR_WALL)
    for robot in (watched, alone):
        robot.drive((0.6, 0.3))
    for step in range(1000):
        watched.advance(step / 1000)
        watched.truth(0.0)
    for robot in (watched, alone):
        robot.advance(1.0)
    assert watched.truth(0.0) == alone.truth(0.0)


def test_readings_between_steps_are_interpolated() -> None:
    """In steady motion the wheel angle grows evenly with time, also within a step of 5 ms."""
    robot = robot_in(FAR_WALL)
    robot.drive((0.8, 0.8))
    angles = []
    for millisecond in range(2000, 2011):
        robot.advance(millisecond / 1000)
        angles.append(robot.wheel_angles_rad[0])
    steps = [after - before for before, after in pairwise(angles)]
    assert steps == pytest.approx([robot.state.wheels.velocity_rad_s[0] / 1000] * 10, rel=1e-3)


def test_time_never_goes_back() -> None:
    """Asked for an earlier time, the robot stays where it is."""
    robot = robot_in(FAR_WALL)
    robot.drive((0.5, 0.5))
    robot.advance(1.0)
    angle = robot.wheel_angles_rad[0]
    robot.advance(0.5)
    assert robot.wheel_angles_rad[0] == angle


def test_released_motors_roll_on_and_braked_ones_stop() -> None:
    """Half a second after full speed the braked robot stands while the released one still rolls."""
    braked, released = robot_in(FAR_WALL), robot_in(FAR_WALL)
    for robot in (braked, released):
        robot.drive((1.0, 1.0))
        robot.advance(2.0)
    braked.drive((0.0, 0.0))
    released.release()
    for robot in (braked, released):
        robot.advance(2.5)
    assert braked.truth(0.0).twist.linear_m_s == 0.0
    assert released.truth(0.0).twist.linear_m_s > 0.05


def test_head_on_the_wall_stops_the_robot() -> None:
    """A robot of radius 0.18 m comes to rest 0.18 m before the wall, in contact, its wheels loaded."""
    robot = robot_in(NEAR_WALL)
    robot.drive((0.4, 0.4))
    robot.advance(5.0)
    truth = robot.truth(3.0)
    assert truth.stamp_s == 3.0
    assert truth.world_from_base.x_m == pytest.approx(0.32, abs=1e-6)
    assert truth.twist.linear_m_s == pytest.approx(0.0, abs=1e-6)
    assert truth.in_contact
    assert robot.state.wheels.velocity_rad_s[0] < 1.5


def test_backing_off_ends_the_contact() -> None:
    """Driven away from the wall, the robot is free at once."""
    robot = robot_in(NEAR_WALL)
    robot.drive((0.4, 0.4))
    robot.advance(5.0)
    robot.drive((-0.4, -0.4))
    robot.advance(6.0)
    assert not robot.truth(0.0).in_contact
    assert robot.truth(0.0).world_from_base.x_m < 0.3


def test_a_robot_far_from_walls_is_not_in_contact_wherever_it_stops() -> None:
    """It began so far from the wall behind it as it drives away, and half a micrometre: now it is twice as far off."""

    def driven(world: World) -> PlanarRobot:
        robot = robot_in(world)
        robot.drive((0.5, 0.5))
        robot.advance(0.5)
        robot.drive((0.0, 0.0))
        robot.advance(3.0)
        return robot

    way_m = driven(FAR_WALL).truth(0.0).world_from_base.x_m
    behind_m = -(SimBodyParameters().radius_m + way_m + 5e-7)
    truth = driven(World([(behind_m, -50.0, behind_m, 50.0)])).truth(0.0)
    assert truth.world_from_base.x_m == pytest.approx(way_m)
    assert not truth.in_contact


def test_at_an_angle_the_robot_slides_along_the_wall() -> None:
    """Heading 60 degrees from the wall's normal, it keeps moving along the wall and not into it."""
    robot = robot_in(NEAR_WALL, Pose2D(0.3, 0.0, math.pi / 3))
    robot.drive((0.8, 0.8))
    robot.advance(4.0)
    truth = robot.truth(0.0)
    assert truth.world_from_base.x_m == pytest.approx(0.32, abs=1e-6)
    assert truth.world_from_base.y_m > 0.3
    assert 0 < truth.twist.linear_m_s < 0.3


def test_the_imu_feels_the_turn() -> None:
    """On a left curve the acceleration points left: speed times turning rate."""
    robot = robot_in(FAR_WALL)
    robot.drive((0.4, 0.8))
    robot.advance(3.0)
    twist, motion = robot.truth(0.0).twist, robot.motion
    assert motion.leftward_m_s2 == pytest.approx(twist.linear_m_s * twist.angular_rad_s)
    assert motion.leftward_m_s2 > 0
    assert motion.forward_m_s2 == pytest.approx(0.0, abs=0.01)


def test_driving_drains_more_than_standing() -> None:
    """Standing, 2 A of electronics take 2 / 3600 Ah a second; driving takes more on top."""
    standing, driving = robot_in(FAR_WALL), robot_in(FAR_WALL)
    driving.drive((1.0, 1.0))
    for robot in (standing, driving):
        robot.advance(10.0)
    assert standing.state.battery.charge_share == pytest.approx(1 - 2 * 10 / 3600 / 10)
    assert driving.state.battery.charge_share < standing.state.battery.charge_share
    assert driving.state.terminal_v < standing.state.terminal_v


def test_a_start_inside_a_wall_is_refused() -> None:
    """Starting closer to a wall than the robot's radius is an error that says how close."""
    with pytest.raises(ValueError, match=r"0\.100 m from a wall"):
        robot_in(NEAR_WALL, Pose2D(0.4, 0.0, 0.0))


@pytest.mark.slow
@settings(max_examples=examples(8), deadline=None)
@given(shares=st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), max_size=6))
def test_no_drive_leaves_the_room(shares: list[tuple[float, float]]) -> None:
    """However it is driven, the robot never comes closer to a wall than its radius."""
    room = scene_of(None).below(1.0)
    robot = robot_in(room, Pose2D(2.2, 2.2, 0.5))
    for index, pair in enumerate(shares, start=1):
        robot.drive(pair)
        robot.advance(index * 2.0)
        pose = robot.truth(0.0).world_from_base
        assert room.clearance_m((pose.x_m, pose.y_m)) >= 0.18 - 1e-6
        assert max(abs(pose.x_m - 1), abs(pose.y_m - 1)) < 2.1
