"""Robots that refuse what they are sent."""

from pathlib import Path

import pytest
from chefbot_fleet.sending import MOST_REFUSALS
from chefbot_fleet.store import Stage
from fleet_robots import StandardRobot
from fleet_world import World, small_roadmap, steps


@pytest.fixture
def world(tmp_path: Path) -> World:
    """Two robots, and one order."""
    world = World(small_roadmap(), tmp_path / "fleet.db")
    world.step()
    world.fleet.add_order("a", "counter", "table", 0.0)
    return world


def test_why_a_robot_refuses_is_said_of_the_order_until_it_accepts(world: World) -> None:
    """The robot stays with the order for a while, and does it when the reason is gone."""
    for robot in world.robots.values():
        robot.refuses = "noRouteError"
    steps(world, 8.0)
    order = world.fleet.orders["a"]
    assert order.stage is Stage.ASSIGNED
    assert order.why == f"{order.robot} refuses it: noRouteError - a test"
    for robot in world.robots.values():
        robot.refuses = None
    steps(world, 5.0)
    assert (order.stage, order.why) == (Stage.ASSIGNED, None)
    world.run(200.0)
    assert order.stage is Stage.DONE


def test_an_order_that_one_robot_refuses_is_anothers(world: World) -> None:
    """After ten refusals. The first one is asked seldom then, gets no other work, and keeps what is released to it."""
    steps(world, 0.5)
    name = world.fleet.orders["a"].robot
    assert name is not None
    robot = world.robots[name]
    robot.restart()
    robot.refuses = "orderError"
    steps(world, 3.0 * (MOST_REFUSALS + 2))
    order = world.fleet.orders["a"]
    assert (order.stage, order.why) == (Stage.ASSIGNED, None)
    assert order.robot not in (None, name)
    refused = len(robot.refused)
    world.fleet.add_order("b", "counter", "table", world.now_s)
    steps(world, 300.0)
    assert 5 <= len(robot.refused) - refused <= 300 // 30 + 1
    assert world.fleet.vehicles[name].task is None
    assert any(wait.waits_for == name for wait in world.fleet.traffic.waits())
    del world.robots[name]
    steps(world, 30.0)
    world.fleet.remove_robot(name, world.now_s)
    world.run(400.0)
    assert (world.lost(), world.done_by_two(), robot.worked) == (0, 0, [])


@pytest.fixture
def loaded(world: World) -> tuple[World, StandardRobot]:
    """A robot that has fetched the load, and refused to go on for two minutes."""
    while world.fleet.orders["a"].stage is not Stage.PICKED:
        world.step()
    order = world.fleet.orders["a"]
    assert order.robot is not None
    robot = world.robots[order.robot]
    robot.refuses = "orderError"
    steps(world, 120.0)
    return world, robot


def test_a_load_that_a_robot_does_not_bring_is_not_fetched_again(loaded: tuple[World, StandardRobot]) -> None:
    """The order stays its own, with the reason; the robot is asked every 30 s, and brings the load when it accepts."""
    world, robot = loaded
    order, refused = world.fleet.orders["a"], len(robot.refused)
    assert order.stage is Stage.PICKED
    assert order.why == f"{order.robot} refuses it: orderError - a test"
    steps(world, 300.0)
    assert 5 <= len(robot.refused) - refused <= 300 // 30 + 1
    robot.refuses = None
    world.run(300.0)
    assert (order.stage, order.why) == (Stage.DONE, None)
    assert (world.lost(), world.done_by_two(), world.repeated()) == (0, 0, 0)


def test_a_load_that_a_robot_does_not_bring_can_be_given_up(loaded: tuple[World, StandardRobot]) -> None:
    """Somebody cancels the order, and takes the load off the robot, which does the next order when it accepts."""
    world, robot = loaded
    world.fleet.cancel_order("a")
    steps(world, 40.0)
    order = world.fleet.orders["a"]
    assert order.stage is Stage.CANCELLED
    assert "load" in (order.why or "")
    robot.refuses = None
    world.fleet.add_order("b", "counter", "table", world.now_s)
    world.run(300.0)
    assert world.fleet.orders["b"].stage is Stage.DONE


def test_why_a_robot_refused_is_forgotten_when_it_accepts_after_the_managers_death(
    loaded: tuple[World, StandardRobot],
) -> None:
    """The manager that starts again has counted no refusal, and still takes back what was said of the order."""
    world, robot = loaded
    world.kill_manager()
    assert world.fleet.orders["a"].why == f"{robot.name} refuses it: orderError - a test"
    robot.refuses = None
    world.run(300.0)
    assert (world.fleet.orders["a"].stage, world.fleet.orders["a"].why) == (Stage.DONE, None)


def test_a_robot_that_refuses_to_load_frees_the_place_for_another(world: World) -> None:
    """It has loaded nothing, since it never took that order: after ten refusals another robot loads and brings it."""
    while world.fleet.orders["a"].robot is None:
        world.step()
    name = world.fleet.orders["a"].robot or ""
    world.robots[name].cannot_work = True
    world.run(600.0)
    order = world.fleet.orders["a"]
    assert (order.stage, order.why) == (Stage.DONE, None)
    assert order.robot not in (None, name)
    assert (world.done_by_two(), world.robots[name].worked) == (0, [])


def test_a_robot_that_accepts_again_gets_work_again(world: World) -> None:
    """All refuse, so the order waits with the reason; then one is ready, and does it."""
    for robot in world.robots.values():
        robot.refuses = "orderError"
    steps(world, 3.0 * (MOST_REFUSALS + 2) * len(world.robots))
    order = world.fleet.orders["a"]
    assert order.stage is Stage.WAITING
    assert order.why is not None
    for robot in world.robots.values():
        robot.refuses = None
    world.run(300.0)
    assert (order.stage, order.why) == (Stage.DONE, None)
