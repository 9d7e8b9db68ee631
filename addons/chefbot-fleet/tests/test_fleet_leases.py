"""Robots that vanish, are removed, and come back; a broker that is away for longer than a lease."""

from pathlib import Path

import pytest
from chefbot_fleet.manager import steady_clock
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.store import Stage
from chefbot_vda5050.messages import ActionState, ActionStatus, OperatingMode
from fleet_robots import StandardRobot
from fleet_world import World, small_roadmap, steps
from msgspec.structs import replace

LEASE_S = 30.0


@pytest.fixture
def roadmap() -> Roadmap:
    """The corridor."""
    return small_roadmap()


@pytest.fixture
def world(roadmap: Roadmap, tmp_path: Path) -> World:
    """Two robots, and one order from the counter to the table."""
    world = World(roadmap, tmp_path / "fleet.db", lease_s=LEASE_S)
    world.fleet.add_order("a", "counter", "table", 0.0)
    return world


def until(world: World, stage: Stage) -> str:
    """Go on until the order is so far; the robot that has it."""
    for _ in range(1000):
        if world.fleet.orders["a"].stage is stage:
            name = world.fleet.orders["a"].robot
            assert name is not None
            return name
        world.step()
    raise AssertionError(f"the order was never {stage}")


def test_without_a_broker_no_lease_runs(world: World) -> None:
    """Minutes without a word say nothing of the robots: all are kept, and the order is done once."""
    until(world, Stage.PICKED)
    world.broker_down_until_s = world.now_s + 10 * LEASE_S
    while world.now_s <= world.broker_down_until_s:
        world.step()
    assert set(world.fleet.vehicles) == {"r0", "r1"}
    assert all(robot.lost_s is None for robot in world.fleet.traffic.robots.values())
    world.run(300.0)
    assert (world.lost(), world.done_by_two(), world.repeated()) == (0, 0, 0)


def test_after_the_broker_was_away_a_robot_has_all_of_its_time_again(world: World) -> None:
    """It vanished before; its lease begins anew when it could be heard again: 30 s, of which 25 are over here."""
    name = until(world, Stage.ASSIGNED)
    silent = world.robots.pop(name)
    for _ in range(60):
        world.step()
    assert world.fleet.traffic.robots[name].lost_s is not None
    world.broker_down_until_s = world.now_s + 2 * LEASE_S
    while world.now_s <= world.broker_down_until_s + 25.0:
        world.step()
    assert name in world.fleet.vehicles
    world.robots[name] = silent
    world.run(300.0)
    assert (world.lost(), world.done_by_two()) == (0, 0)


def test_a_load_that_a_removed_robot_has_is_nobody_elses_order(world: World) -> None:
    """Its lease is over: the order has failed, with the reason, and stays so."""
    name = until(world, Stage.PICKED)
    del world.robots[name]
    for _ in range(400):
        world.step()
    order = world.fleet.orders["a"]
    assert name not in world.fleet.vehicles
    assert (order.stage, order.why) == (Stage.FAILED, f"{name} was removed, perhaps with its load")
    assert all(not robot.worked for robot in world.robots.values())


def test_a_load_that_may_be_on_the_robot_is_not_fetched_again(world: World) -> None:
    """It vanished while it was loading, so nobody knows."""
    name = until(world, Stage.ASSIGNED)
    while world.fleet.vehicles[name].action_id is None:
        world.step()
    world.fleet.traffic.lose(name, world.now_s)
    world.fleet.remove_robot(name, world.now_s)
    assert world.fleet.orders["a"].stage is Stage.FAILED


def test_a_robot_that_is_removed_on_its_way_comes_back_when_it_stands(world: World) -> None:
    """What it reports of the first time counts for nothing, its orders have names of their own, and all is done once."""
    name = until(world, Stage.ASSIGNED)
    robot = world.robots[name]
    while not robot.ahead:
        world.step()
    first = robot.order[0]
    world.fleet.traffic.lose(name, world.now_s)
    world.fleet.remove_robot(name, world.now_s)
    world.fleet.on_state(name, robot.state(), world.now_s)
    assert world.fleet.ignored == {name: "it is on its way by an order that is not ours"}
    while robot.ahead:
        robot.step(world.now_s)
        world.now_s += 0.5
    world.run(300.0)
    assert world.fleet.ignored == {}
    for k in range(6):
        world.fleet.add_order(f"b{k}", "counter", "table", world.now_s)
    world.run(900.0)
    assert robot.order[0] != first
    assert first.split("-")[1] != robot.order[0].split("-")[1]
    assert (world.lost(), world.done_by_two(), world.repeated()) == (0, 0, 0)


def test_a_robot_is_taken_only_where_it_stands_idle_on_our_map_and_nobody_else_is(world: World) -> None:
    """Otherwise the reason is kept; once it is gone the robot is taken."""
    world.step()
    new = StandardRobot("new", world.roadmap, 5)
    state = new.state()
    assert state.agv_position is not None
    at_work = ActionState(action_id="x", action_status=ActionStatus.RUNNING)
    held = world.roadmap.points_m[world.fleet.vehicles["r0"].node]
    obstacles = {
        "its map is 'cellar', not 'map'": replace(
            state, agv_position=replace(state.agv_position, map_id="cellar")
        ),
        "it is on its way by an order that is not ours": replace(state, driving=True),
        "it is at work by an order that is not ours": replace(state, action_states=(at_work,)),
        "its place is reserved for r0": replace(
            state, agv_position=replace(state.agv_position, x=held[0], y=held[1])
        ),
    }
    for why, odd in obstacles.items():
        world.fleet.on_state("new", odd, world.now_s)
        assert world.fleet.ignored == {"new": why}
        assert "new" not in world.fleet.vehicles
    world.fleet.on_state("new", state, world.now_s)
    assert world.fleet.ignored == {}
    assert world.fleet.vehicles["new"].node == 5


def test_plans_through_the_place_of_a_new_robot_are_made_anew(world: World) -> None:
    """Whoever was to pass it waits until it has gone: node 3 is the only way to the table."""
    name = until(world, Stage.PICKED)
    robot = world.fleet.traffic.robots[name]
    assert 3 in [move.target for move in robot.moves[robot.released :]]
    other = next(one for one in world.robots if one != name)
    world.robots.pop(other)
    world.fleet.traffic.lose(other, world.now_s)
    world.fleet.remove_robot(other, world.now_s)
    world.fleet.on_state("new", StandardRobot("new", world.roadmap, 3).state(), world.now_s)
    assert "new" in world.fleet.vehicles
    for move in robot.moves[robot.released :]:
        if 3 in (move.origin, move.target):
            assert move.after


def test_a_robot_that_was_driven_by_hand_goes_on_with_its_work(world: World) -> None:
    """Its order is deleted on the way to the counter; free again, it gets another, and the work is done once."""
    name = until(world, Stage.ASSIGNED)
    robot = world.robots[name]
    while not robot.ahead:
        world.step()
    robot.take_by_hand()
    before = robot.order
    for _ in range(20):
        world.step()
    assert robot.order == before
    robot.mode = OperatingMode.AUTOMATIC
    until(world, Stage.DONE)
    assert (world.lost(), world.done_by_two(), world.repeated(), robot.refused) == (0, 0, 0, [])


def test_a_robot_that_was_sent_an_update_while_it_was_driven_by_hand_goes_on(world: World) -> None:
    """With its load: it refuses the update, and each later one of the order that it has deleted; it gets another."""
    name = until(world, Stage.PICKED)
    robot, vehicle = world.robots[name], world.fleet.vehicles[name]
    while not vehicle.update_id or not robot.ahead:
        world.step()
    robot.take_by_hand()
    vehicle.update_id += 1
    steps(world, 60.0)
    assert robot.refused
    assert set(robot.refused) == {robot.order[0]}
    robot.mode = OperatingMode.AUTOMATIC
    world.run(200.0)
    assert (world.lost(), world.done_by_two(), world.repeated()) == (0, 0, 0)


def test_the_fleets_clock_goes_on_evenly_when_the_computers_is_set() -> None:
    """An hour forward is no hour of silence."""
    wall_s, even_s = [1_700_000_000.0], [50.0]
    clock = steady_clock(lambda: wall_s[0], lambda: even_s[0])
    wall_s[0] += 3600.0
    even_s[0] += 2.0
    assert clock() == 1_700_000_002.0
