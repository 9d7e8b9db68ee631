"""The manager's decisions, with robots that keep to the standard, and with messages, robots and the manager failing."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from chefbot_fleet.fleet import Fleet
from chefbot_fleet.lanes import LaneParameters, free_space
from chefbot_fleet.records import FleetParameters
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace
from chefbot_fleet.store import Correction, Stage, Store
from chefbot_vda5050.messages import ConnectionState
from fleet_robots import StandardRobot
from fleet_world import VICTIMS, World, small_roadmap

from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, OccupancyGrid


@pytest.fixture
def roadmap() -> Roadmap:
    """The corridor."""
    return small_roadmap()


@pytest.fixture
def world(roadmap: Roadmap, tmp_path: Path) -> World:
    """Two robots."""
    return World(roadmap, tmp_path / "fleet.db")


def test_every_order_is_picked_and_dropped_once(world: World) -> None:
    """Six orders for two robots that meet in the corridor."""
    world.give(6)
    world.run(600.0)
    assert {order.stage for order in world.fleet.orders.values()} == {Stage.DONE}
    assert world.work() == sorted(f"o{k}-{stage}" for k in range(6) for stage in (0, 1))
    assert all(not robot.refused for robot in world.robots.values())


def test_a_third_of_all_messages_may_be_lost(world: World) -> None:
    """The work is the same; a robot that gets something twice does it once."""
    world.loss = 0.33
    world.give(4)
    world.run(1500.0)
    assert {order.stage for order in world.fleet.orders.values()} == {Stage.DONE}
    assert world.work() == sorted(f"o{k}-{stage}" for k in range(4) for stage in (0, 1))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("victim", VICTIMS)
def test_killed_at_a_random_moment_and_nothing_is_lost_or_doubled(
    roadmap: Roadmap, tmp_path: Path, victim: str, seed: int
) -> None:
    """Manager, broker or a robot: every order is done, and no load is fetched or brought by two."""
    world = World(roadmap, tmp_path / "fleet.db", seed=seed)
    world.give(4)
    world.kill_and_go_on(victim)
    assert world.lost() == 0
    assert world.done_by_two() == 0
    assert world.repeated() <= (1 if victim == "robot" else 0)


@pytest.mark.parametrize("seed", range(4))
def test_robots_are_killed_again_and_again_and_nothing_is_lost_or_done_by_two(
    roadmap: Roadmap, tmp_path: Path, seed: int
) -> None:
    """One of three, 25 times: plans are made anew while robots are at work, who end it before they drive on."""
    world = World(roadmap, tmp_path / "fleet.db", robots=3, seed=seed)
    world.give(6)
    world.kill_robots_and_go_on(25)
    assert (world.lost(), world.done_by_two()) == (0, 0)
    assert all(robot.refused == [] for robot in world.robots.values())


def test_an_order_sent_twice_is_one_order(world: World) -> None:
    """Another one of the same name, an unknown place and a way to nowhere are refused."""
    first = world.fleet.add_order("a", "counter", "table", 0.0)
    assert world.fleet.add_order("a", "counter", "table", 5.0) is first
    with pytest.raises(ValueError, match="is there already, from 'counter' to 'table'"):
        world.fleet.add_order("a", "table", "counter", 0.0)
    with pytest.raises(ValueError, match="no place 'kitchen'; there are: counter, table"):
        world.fleet.add_order("b", "kitchen", "table", 0.0)
    with pytest.raises(ValueError, match="two different places"):
        world.fleet.add_order("b", "table", "table", 0.0)


def test_a_silent_robot_keeps_its_place_until_somebody_removes_it(world: World) -> None:
    """Its order goes to the other one then; a robot that is there cannot be removed."""
    world.fleet.add_order("a", "counter", "table", 0.0)
    for _ in range(6):
        world.step()
    (name,) = [order.robot for order in world.fleet.orders.values()]
    assert name is not None
    with pytest.raises(ValueError, match="switch it off first"):
        world.fleet.remove_robot(name, world.now_s)
    del world.robots[name]
    for _ in range(60):
        world.step()
    assert world.fleet.traffic.robots[name].lost_s is not None
    assert world.fleet.orders["a"].robot == name
    world.fleet.remove_robot(name, world.now_s)
    world.run(200.0)
    assert world.fleet.orders["a"].stage is Stage.DONE
    assert world.fleet.orders["a"].robot != name


def test_what_connection_says_counts_at_once(world: World) -> None:
    """And a state says that the robot is there again."""
    world.step()
    world.fleet.on_connection("r0", ConnectionState.BROKEN, world.now_s)
    assert world.fleet.traffic.robots["r0"].lost_s is not None
    world.step()
    assert world.fleet.traffic.robots["r0"].lost_s is None


def test_a_robot_far_from_every_node_is_not_taken_and_the_reason_is_kept(world: World) -> None:
    """Nor is one more than there are homes."""
    stranger = StandardRobot("far", world.roadmap, 0)
    stranger.point = (10.0, 10.0)
    world.fleet.on_state("far", stranger.state(), 1.0)
    assert world.fleet.ignored == {"far": "it is not within 1.0 m of a node"}
    assert "far" not in world.fleet.vehicles


def test_corrections_by_hand_are_kept_and_used(world: World) -> None:
    """Without edge 1-2 nobody gets through; a correction that makes no sense changes nothing."""
    world.step()
    world.fleet.correct(Correction("remove edge", 1, 2), world.now_s)
    world.fleet.add_order("a", "counter", "table", world.now_s)
    world.run(60.0)
    assert world.fleet.orders["a"].stage is Stage.WAITING
    with pytest.raises(ValueError, match="no edge between 1 and 2"):
        world.fleet.correct(Correction("remove edge", 1, 2), world.now_s)
    world.kill_manager()
    assert len(world.fleet.roadmap.edges) == len(world.roadmap.edges) - 1
    world.fleet.correct(Correction("add edge", 1, 2), world.now_s)
    world.run(100.0)
    assert world.fleet.orders["a"].stage is Stage.DONE


def test_a_robot_that_was_carried_elsewhere_brings_its_order_from_there(tmp_path: Path) -> None:
    """It stands idle at home; somebody puts it at the corridor's other end, where nobody is, and gives it work."""
    world = World(small_roadmap(), tmp_path / "fleet.db", robots=1)
    world.step()
    assert world.fleet.vehicles["r0"].node == 0
    world.robots["r0"].point = world.roadmap.points_m[3]
    world.robots["r0"].restart()
    world.give(1)
    world.run(200.0)
    assert world.work() == ["o0-0", "o0-1"]
    assert not world.robots["r0"].refused


def test_a_robot_that_was_wrong_about_its_place_is_followed_to_the_right_one(tmp_path: Path) -> None:
    """What was released to it from the wrong place is given up, as it never took that order."""
    world = World(small_roadmap(), tmp_path / "fleet.db", robots=1)
    robot = world.robots["r0"]
    robot.point = world.roadmap.points_m[3]
    world.fleet.on_state("r0", robot.state(), 0.0)
    world.give(1)
    assert world.fleet.tick(0.5)  # and that message is lost
    robot.point = world.roadmap.points_m[0]
    world.run(200.0)
    assert world.work() == ["o0-0", "o0-1"]
    assert not robot.refused


def test_nobody_is_put_where_another_robot_has_reserved(tmp_path: Path) -> None:
    """r0 says that it stands where r1 is: it stays in the manager's memory where it was, and the page says why."""
    world = World(small_roadmap(), tmp_path / "fleet.db")
    world.step()
    world.robots["r0"].point = world.roadmap.points_m[world.fleet.vehicles["r1"].node]
    world.step()
    assert world.fleet.vehicles["r0"].node == 0
    assert world.fleet.ignored["r0"] == "it has been moved, and its place is reserved for r1"


@pytest.mark.parametrize(
    "correction",
    [
        Correction("add place", 0, x_m=1.0, y_m=0.1),  # in the wall
        Correction("add place", 0, x_m=4.0, y_m=30.0),  # beyond the map
        Correction("add place", 0, x_m=1e308, y_m=1.0),
        Correction("add edge", 0, 1),  # through the pillar
    ],
)
def test_no_correction_leads_where_a_robot_cannot_be(tmp_path: Path, correction: Correction) -> None:
    """A hall with a pillar in its middle and a node on either side: refused, with why, and nothing changes."""
    cells = np.full((68, 200), OCCUPIED, np.int8)
    cells[2:-2, 2:-2] = FREE
    cells[2:40, 95:105] = OCCUPIED
    space = free_space(OccupancyGrid(0.05, Pose2D(), cells), LaneParameters())
    roadmap = Roadmap(((2.0, 1.0), (8.0, 1.0), (5.0, 2.7)), ((0, 2), (1, 2)), 0.6)
    store = Store(tmp_path / "fleet.db")
    fleet = Fleet(roadmap, (0,), store, Pace(0.5, 0.0), FleetParameters("map"), 0.0, space)
    with pytest.raises(ValueError, match="by the map something is in the way"):
        fleet.correct(correction, 0.0)
    assert fleet.roadmap.points_m == roadmap.points_m
    assert store.corrections() == []
    fleet.correct(Correction("add place", 0, x_m=3.0, y_m=1.5), 0.0)
    assert fleet.roadmap.points_m[-1] == (3.0, 1.5)


def test_two_managers_do_not_share_a_database(tmp_path: Path) -> None:
    """The second one is refused at its start, until the first has ended."""
    first = Store(tmp_path / "fleet.db")
    with pytest.raises(sqlite3.OperationalError, match="locked"):
        Store(tmp_path / "fleet.db")
    first.close()
    Store(tmp_path / "fleet.db").close()
