"""``cancelOrder`` from the manager: an order that people cancel, and a way that is taken back."""

from pathlib import Path

import pytest
from chefbot_fleet.orders import CancelOrder, Outgoing
from chefbot_fleet.places import place_on_path
from chefbot_fleet.store import Stage
from chefbot_fleet.view import fleet_view
from chefbot_vda5050.messages import State
from fleet_robots import StandardRobot
from fleet_world import World, small_roadmap, steps


def until_driving(world: World) -> StandardRobot:
    """Until the robot is on its first edge."""
    robot = world.robots["r0"]
    while robot._begun_s is None:
        world.step()
    return robot


def test_an_order_that_waits_is_cancelled_at_once_and_nobody_does_it(world: World) -> None:
    """Again, it changes nothing; the same order given again stays cancelled."""
    assert world.fleet.cancel_order("a").stage is Stage.CANCELLED
    assert world.fleet.cancel_order("a").stage is Stage.CANCELLED
    assert world.fleet.add_order("a", "counter", "table", 0.0).stage is Stage.CANCELLED
    steps(world, 60.0)
    assert world.robots["r0"].worked == []
    assert [order["stage"] for order in fleet_view(world.fleet, world.now_s)["orders"]] == ["cancelled"]


def test_what_has_ended_or_never_was_cannot_be_cancelled(world: World) -> None:
    """With a sentence."""
    with pytest.raises(ValueError, match="there is no order 'b'"):
        world.fleet.cancel_order("b")
    world.run(200.0)
    with pytest.raises(ValueError, match="order 'a' is done already"):
        world.fleet.cancel_order("a")


def test_a_robot_on_its_way_stops_and_keeps_no_more_than_the_edge_where_it_stands(world: World) -> None:
    """It is on edge 0-1, and 1 and 6 are released: it drives to 1 and home, and does the next order."""
    robot = until_driving(world)
    assert world.fleet.vehicles["r0"].base == [1, 6]
    world.fleet.cancel_order("a")
    assert world.fleet.orders["a"].stage is Stage.CANCELLING
    world.step()
    assert [one["doing"] for one in fleet_view(world.fleet, world.now_s)["robots"]] == [
        "is stopped by cancelOrder"
    ]
    assert world.fleet.vehicles["r0"].base == [1, 6]
    world.step()
    assert robot.point == (0.5, 0.0)
    assert world.fleet.orders["a"].stage is Stage.CANCELLED
    assert (world.fleet.orders["a"].why, world.fleet.vehicles["r0"].task) == (None, None)
    assert world.fleet.vehicles["r0"].base[:1] == [1]
    assert 6 not in world.fleet.vehicles["r0"].base
    steps(world, 30.0)
    assert robot.point == world.roadmap.points_m[0]
    world.fleet.add_order("b", "counter", "table", world.now_s)
    world.run(200.0)
    assert world.fleet.orders["b"].stage is Stage.DONE
    assert (robot.stops, robot.refused, world.work()) == (1, [], ["b-0", "b-1"])


@pytest.mark.parametrize("stage", [Stage.ASSIGNED, Stage.PICKED])
def test_a_load_that_the_robot_has_or_may_have_is_said(world: World, stage: Stage) -> None:
    """Cancelled while it loads, and when it has loaded; it is never brought."""
    while world.fleet.orders["a"].stage is not stage or not (
        stage is Stage.PICKED or world.robots["r0"]._pending
    ):
        world.step()
    world.fleet.cancel_order("a")
    steps(world, 60.0)
    order = world.fleet.orders["a"]
    assert (order.stage, order.why) == (
        Stage.CANCELLED,
        "r0 has its load" if stage is Stage.PICKED else "r0 may have its load",
    )
    assert {kind for _, kind in world.robots["r0"].worked} == ({"pick"} if stage is Stage.PICKED else set())


def test_an_order_that_ends_before_its_cancellation_is_done(world: World) -> None:
    """The drop is over when cancelOrder comes, which the robot answers with FAILED; the next order is done as well."""
    robot = world.robots["r0"]
    while not any(kind == "drop" for _, kind in robot._pending):
        world.step()
    while len(robot.worked) < 2:
        robot.step(world.now_s)
        world.now_s += 0.5
    world.fleet.cancel_order("a")
    steps(world, 20.0)
    assert world.fleet.orders["a"].stage is Stage.DONE
    assert robot.stops == 0
    world.fleet.add_order("b", "table", "counter", world.now_s)
    world.run(200.0)
    assert world.work() == ["a-0", "a-1", "b-0", "b-1"]


@pytest.mark.parametrize("what", ["broker", "manager", "robot", "loss"])
@pytest.mark.parametrize("seed", range(4))
def test_whatever_is_started_again_meanwhile_the_order_ends_once(
    tmp_path: Path, what: str, seed: int
) -> None:
    """Four orders, and one of them is cancelled at a random moment: it is cancelled or done, the others are done."""
    world = World(small_roadmap(), tmp_path / "fleet.db", seed=seed)
    world.give(4)
    for _ in range(world.chance.randrange(3, 60)):
        world.step()
    identifier = world.chance.choice(
        [one.identifier for one in world.fleet.orders.values() if one.robot] or ["o0"]
    )
    if world.fleet.orders[identifier].stage is not Stage.DONE:
        world.fleet.cancel_order(identifier)
    for _ in range(world.chance.randrange(3)):
        world.step()
    if what == "broker":
        world.broker_down_until_s = world.now_s + world.chance.uniform(1.0, 40.0)
    elif what == "manager":
        world.kill_manager()
    elif what == "robot":
        world.robots["r0"].restart()
    else:
        world.loss = 0.33
    steps(world, 400.0)
    stages = {one.identifier: one.stage for one in world.fleet.orders.values()}
    assert stages.pop(identifier) in (Stage.CANCELLED, Stage.DONE)
    assert set(stages.values()) == {Stage.DONE}
    assert world.done_by_two() == 0
    assert world.repeated() <= (what == "robot")
    assert all(robot.refused == [] for robot in world.robots.values()) or what == "loss"


def test_an_order_of_a_robot_that_vanished_is_cancelled_when_it_is_removed(world: World) -> None:
    """Until then it is being cancelled: nobody can tell whether the robot goes on."""
    robot = until_driving(world)
    world.fleet.cancel_order("a")
    del world.robots[robot.name]
    steps(world, 30.0)
    assert world.fleet.orders["a"].stage is Stage.CANCELLING
    world.fleet.remove_robot("r0", world.now_s)
    assert world.fleet.orders["a"].stage is Stage.CANCELLED


def test_a_robot_is_stopped_where_another_one_stands_in_what_was_released_to_it(world: World) -> None:
    """r0 has 1 and 6 when a new robot is switched on at 6: r0 goes no farther than 1, and the new one is taken."""
    robot = until_driving(world)
    new = StandardRobot("new", world.roadmap, 6)
    world.fleet.on_state("new", new.state(), world.now_s)
    assert world.fleet.ignored["new"] == "its place is reserved for r0"
    assert world.fleet.notices[-1] == "r0 is stopped: new is in the way that was released to it"
    world.robots["new"] = new
    world.run(300.0)
    assert world.fleet.orders["a"].stage is Stage.DONE
    assert set(world.fleet.vehicles) == {"r0", "new"}
    assert (robot.stops, robot.refused, new.refused) == (1, [], [])
    assert (world.done_by_two(), world.repeated()) == (0, 0)


def test_a_robot_that_does_not_answer_keeps_the_way_that_it_has(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After ten times; it goes on, and brings its order when the other one has gone."""
    robot = until_driving(world)
    monkeypatch.setattr(robot, "cancel", lambda action_id: None)
    new = StandardRobot("new", world.roadmap, 6)
    world.fleet.on_state("new", new.state(), world.now_s)
    steps(world, 35.0)
    assert world.fleet.notices[-1] == "r0 does not answer cancelOrder, and keeps its way"
    world.fleet.remove_robot("new", world.now_s)
    world.run(200.0)
    assert world.fleet.orders["a"].stage is Stage.DONE


def test_what_is_asked_again_has_the_same_number(world: World) -> None:
    """Every 3 s, until the robot has answered."""
    until_driving(world)
    world.fleet.cancel_order("a")
    sent: list[Outgoing | CancelOrder] = []
    for _ in range(14):
        world.now_s += 0.5
        sent += world.fleet.tick(world.now_s)
    assert len(sent) == 3
    assert len(set(sent)) == 1


def test_where_a_robot_stands_on_its_path() -> None:
    """Along 0-1-2 of the corridor, a metre each: at a node, on an edge, and beside it all."""

    def place(x_m: float, y_m: float) -> tuple[int, int] | None:
        robot = StandardRobot("r", small_roadmap(), 0)
        robot.point = (x_m, y_m)
        state: State = robot.state()
        return place_on_path(state, [0, 1, 2], small_roadmap())

    assert place(0.05, 0.0) == (0, 0)
    assert place(0.8, 0.1) == (0, 1)
    assert place(0.95, 0.0) == (1, 0)
    assert place(1.3, 0.0) == (1, 1)
    assert place(2.0, 0.0) == (2, 0)
    assert place(1.0, 3.0) is None
