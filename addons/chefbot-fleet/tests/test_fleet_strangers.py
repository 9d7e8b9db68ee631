"""Robots that are not in the fleet, robots that do another manager's orders, and other managers."""

from pathlib import Path

import pytest
from chefbot_fleet.orders import Outgoing
from chefbot_fleet.store import Correction, Stage
from chefbot_fleet.view import fleet_view
from chefbot_vda5050.messages import Action, BlockingType, ConnectionState, Node, NodePosition
from fleet_robots import StandardRobot
from fleet_world import World, small_roadmap, steps
from msgspec.structs import replace


def stranger_at(world: World, node: int) -> StandardRobot:
    """A robot that is not taken, as its map is another's; it stands at this node all the same."""
    robot = StandardRobot("far", world.roadmap, node)
    robot.order = ("of another", 0)
    return robot


def others_order(world: World, name: str, nodes: list[int], actions: int = 0) -> Outgoing:
    """Along these nodes, with so many actions of 3 s at each, by a manager that is not this one."""
    parts = tuple(
        Node(
            node_id=str(node),
            sequence_id=2 * k,
            released=True,
            actions=tuple(
                Action(action_type="wait", action_id=f"x{k}", blocking_type=BlockingType.HARD)
                for k in range(actions)
            ),
            node_position=NodePosition(
                x=world.roadmap.points_m[node][0],
                y=world.roadmap.points_m[node][1],
                map_id="map",
                allowed_deviation_xy=0.5,
            ),
        )
        for k, node in enumerate(nodes)
    )
    return Outgoing(name, "other-1", 0, parts, ())


def between(world: World, node: int, other: int) -> tuple[float, float]:
    """The middle of an edge."""
    (x_m, y_m), (to_x_m, to_y_m) = world.roadmap.points_m[node], world.roadmap.points_m[other]
    return (x_m + to_x_m) / 2, (y_m + to_y_m) / 2


def test_nobody_is_sent_through_the_place_of_a_robot_that_is_not_in_the_fleet(world: World) -> None:
    """It drives by another's order at 3, so the table waits: r0 stays free to go home, and the page says for whom."""
    far = StandardRobot("far", world.roadmap, 3)
    far.receive(others_order(world, "far", [3, 4]))
    far.point = between(world, 2, 3)
    world.fleet.on_state("far", far.state(), world.now_s)
    assert world.fleet.ignored["far"] == "it is on its way by an order that is not ours"
    before = world.robots["r0"].point
    for _ in range(40):
        world.step()
        world.fleet.on_state("far", far.state(), world.now_s)
        assert world.robots["r0"].point == before
    (robot,) = fleet_view(world.fleet, world.now_s)["robots"]
    assert world.fleet.orders["a"].stage is Stage.WAITING
    assert robot["doing"] == "is free"
    while far.ahead:
        far.step(world.now_s)
        world.now_s += 0.5
    far.order, far.point = ("", 0), world.roadmap.points_m[5]
    world.robots["far"] = far
    world.run(200.0)
    assert world.fleet.orders["a"].stage is Stage.DONE


def test_a_robot_that_is_on_its_way_goes_no_farther_than_what_was_released(world: World) -> None:
    """The stranger comes to 3 when r0 has its load; r0 waits, says for whom, and goes on when it has gone."""
    while world.fleet.orders["a"].stage is not Stage.PICKED:
        world.step()
    far = stranger_at(world, 3)
    far.receive(others_order(world, "far", [3, 4]))
    world.fleet.on_state("far", far.state(), world.now_s)
    released = [world.fleet.vehicles["r0"].node, *world.fleet.vehicles["r0"].base]
    assert 3 not in released
    for _ in range(40):
        world.step()
        world.fleet.on_state("far", far.state(), world.now_s)
        assert not {3, 4, 7} & set(world.fleet.vehicles["r0"].base)
    waits = [(wait.robot, wait.waits_for) for wait in world.fleet.traffic.waits()]
    assert waits == [("r0", "far")]
    far.point = world.roadmap.points_m[5]
    far.ahead = []
    world.fleet.on_state("far", replace(far.state(), driving=True), world.now_s)
    world.run(200.0)
    assert world.fleet.orders["a"].stage is Stage.DONE


def test_the_place_of_a_silent_stranger_is_taken_until_somebody_removes_it(world: World) -> None:
    """A correction of the roadmap meanwhile changes nothing; one that can be heard is not removed."""
    far = stranger_at(world, 3)
    far.receive(others_order(world, "far", [3, 4]))
    world.fleet.on_state("far", far.state(), world.now_s)
    with pytest.raises(ValueError, match="far is there: switch it off first"):
        world.fleet.remove_robot("far", world.now_s)
    world.fleet.correct(Correction("add place", 0, x_m=0.0, y_m=1.0), world.now_s)
    steps(world, 300.0)
    assert world.fleet.orders["a"].stage is Stage.WAITING
    (stranger,) = fleet_view(world.fleet, world.now_s)["strangers"]
    assert (stranger["name"], stranger["lost"], stranger["x"]) == ("far", True, 3.0)
    world.fleet.remove_robot("far", world.now_s)
    assert world.fleet.ignored == {}
    world.run(200.0)
    assert world.fleet.orders["a"].stage is Stage.DONE


def test_a_strangers_lease_ends_as_others_do(tmp_path: Path) -> None:
    """20 s until it counts as vanished, 30 s of lease, which do not run while there is no broker."""
    world = World(small_roadmap(), tmp_path / "fleet.db", robots=1, lease_s=30.0)
    world.step()
    far = stranger_at(world, 3)
    far.receive(others_order(world, "far", [3, 4]))
    world.fleet.on_state("far", far.state(), world.now_s)
    steps(world, 45.0)
    world.broker_down_until_s = world.now_s + 60.0
    steps(world, 61.0)
    assert set(world.fleet.traffic.occupied) == {"far"}
    steps(world, 45.0)
    assert set(world.fleet.traffic.occupied) == {"far"}
    steps(world, 10.0)
    assert world.fleet.traffic.occupied == {}


def test_a_robot_that_does_anothers_order_is_left_alone_until_it_is_idle(world: World) -> None:
    """Page and log say so; afterwards it brings the order that it had, from where it stands."""
    robot = world.robots["r0"]
    robot.receive(others_order(world, "r0", [0, 1, 2]))
    while robot.order[0] == "other-1":
        world.step()
        if robot.order[0] == "other-1" and robot.ahead:
            assert world.fleet.contacts["r0"].foreign == "other-1"
            assert [one["doing"] for one in fleet_view(world.fleet, world.now_s)["robots"]] == [
                "does another manager's order, and is left alone"
            ]
    assert robot.refused == []
    why = "it does order 'other-1' of another manager, and is left alone until it is idle"
    assert world.fleet.notices[0] == f"r0: {why}"
    world.run(200.0)
    assert (world.lost(), robot.refused) == (0, [])
    assert "r0 is idle, and gets orders from here again" in world.fleet.notices
    assert world.fleet.ignored == {}


def test_what_such_a_robot_had_not_begun_is_another_robots(tmp_path: Path) -> None:
    """r0 works at home for somebody else for 300 s; r1 brings its order. r0 is there all the time."""
    world = World(small_roadmap(), tmp_path / "fleet.db")
    world.step()
    world.fleet.add_order("a", "counter", "table", 0.0)
    world.step()
    name = world.fleet.orders["a"].robot
    assert name == "r0"
    robot = world.robots[name]
    robot.restart()
    robot.receive(others_order(world, name, [0], actions=100))
    world.step()
    assert world.fleet.orders["a"].robot != name
    with pytest.raises(ValueError, match="r0 is there: switch it off first"):
        world.fleet.remove_robot(name, world.now_s)
    world.run(300.0)
    assert (world.lost(), world.done_by_two()) == (0, 0)
    assert {kind for _, kind in robot.worked} == {"wait"}


def test_a_load_that_such_a_robot_has_is_brought_when_it_is_idle(world: World) -> None:
    """It was told by somebody else to go to 4 with it."""
    while world.fleet.orders["a"].stage is not Stage.PICKED:
        world.step()
    robot = world.robots["r0"]
    robot.restart()
    node = int(world.fleet.vehicles["r0"].node)
    robot.receive(others_order(world, "r0", [node, 1, 2]))
    world.step()
    assert world.fleet.contacts["r0"].foreign == "other-1"
    world.run(200.0)
    assert (world.lost(), world.repeated()) == (0, 0)


def test_a_robot_that_falls_silent_with_anothers_order_can_be_removed(world: World) -> None:
    """Its place is taken until then."""
    robot = world.robots.pop("r0")
    robot.receive(others_order(world, "r0", [0, 1]))
    world.fleet.on_state("r0", robot.state(), world.now_s)
    world.fleet.on_connection("r0", ConnectionState.BROKEN, world.now_s)
    assert set(world.fleet.traffic.occupied) == {"r0"}
    world.fleet.remove_robot("r0", world.now_s)
    assert world.fleet.traffic.occupied == {}
    assert world.fleet.ignored == {}


def test_another_manager_on_the_broker_is_said_once_and_shown_for_a_minute(world: World) -> None:
    """Whatever this one sends is its own."""
    sent = world.fleet.tick(world.now_s)
    for message in sent:
        assert isinstance(message, Outgoing)
        world.fleet.on_order("r0", message.order_id, world.now_s)
    assert sent
    assert world.fleet.notices == []
    for order_id in ("x1", "x2"):
        world.fleet.on_order("r0", order_id, world.now_s)
    assert world.fleet.notices == ["another manager sends orders to r0: 'x1'"]
    shown = fleet_view(world.fleet, world.now_s + 5.0)["managers"]
    assert shown == {"r0": "another manager sends orders to it: 'x2', 5 s ago"}
    steps(world, 62.0)
    assert fleet_view(world.fleet, world.now_s)["managers"] == {}


def test_two_managers_with_databases_of_their_own_do_not_fight_for_a_robot(tmp_path: Path) -> None:
    """For five minutes both have orders for the same two robots: none gets an order while it has one, both say so."""
    folders = [tmp_path / "one", tmp_path / "two"]
    for folder in folders:
        folder.mkdir()
    first, second = (World(small_roadmap(), folder / "fleet.db", seed=1) for folder in folders)
    second.robots = first.robots
    first.give(4)
    for k in range(4):
        second.fleet.add_order(f"p{k}", "table" if k % 2 else "counter", "counter" if k % 2 else "table", 0.0)
    for _ in range(600):
        first.step()
        second.now_s = first.now_s
        for robot in first.robots.values():
            second.fleet.on_state(robot.name, robot.state(), second.now_s)
        for message in second.fleet.tick(second.now_s):
            if isinstance(message, Outgoing):
                first.fleet.on_order(message.robot, message.order_id, first.now_s)
            first.deliver(message)
    assert [robot.refused for robot in first.robots.values()] == [[], []]
    assert first.done_by_two() == 0
    assert sum(order.stage is Stage.DONE for order in first.fleet.orders.values()) >= 3
    assert any("another manager sends orders to r0" in notice for notice in first.fleet.notices)
    assert any("is left alone until it is idle" in notice for notice in second.fleet.notices)
