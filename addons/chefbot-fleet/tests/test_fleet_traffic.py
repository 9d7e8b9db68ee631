"""Plans, the order in which robots use a place, and what is released. An edge takes two seconds."""

import pytest
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace, Stop
from chefbot_fleet.traffic import RETRY_S, Traffic, Wait, wait_cycle


@pytest.fixture
def traffic(corridor: Roadmap, pace: Pace) -> Traffic:
    """Ann at home at 0, Bob at home at 4; two moves ahead."""
    traffic = Traffic(corridor, pace)
    traffic.add("ann", 0, 0)
    traffic.add("bob", 4, 4)
    return traffic


def drive(traffic: Traffic, until_s: float, slow: dict[str, float]) -> list[tuple[float, str, int]]:
    """Have robots obey, each ``slow`` times slower than planned; time, robot and node of every arrival."""
    arrivals, begun, now_s = [], dict[str, float](), 0.0
    while now_s < until_s:
        traffic.release(now_s)
        now_s += 0.5
        for name, robot in traffic.robots.items():
            if robot.work is not None:
                traffic.worked(name)
            if robot.released:
                begun.setdefault(name, now_s - 0.5)
                if now_s - begun[name] >= 2.0 * slow.get(name, 1.0):
                    traffic.arrived(name, now_s)
                    del begun[name]
                    arrivals.append((now_s, name, robot.node))
    return arrivals


def test_a_robot_alone_gets_two_moves_ahead_and_comes_home_after_its_work(traffic: Traffic) -> None:
    """To 2 and back, at two seconds an edge."""
    assert traffic.assign("ann", (Stop(2),), 0.0)
    assert [(name, move.target) for name, move in traffic.release(0.0)] == [("ann", 1), ("ann", 2)]
    assert [node for _, _, node in drive(traffic, 10.0, {})] == [1, 2, 1, 0]


@pytest.mark.parametrize("slow", [{}, {"ann": 4.0}, {"bob": 4.0}, {"ann": 2.5, "bob": 1.5}])
def test_two_robots_that_meet_in_a_corridor_both_get_through(
    traffic: Traffic, slow: dict[str, float]
) -> None:
    """Ann works at 3, Bob at 1, whoever is late: one lets the other pass, and both come home."""
    assert traffic.assign("ann", (Stop(3),), 0.0)
    assert traffic.assign("bob", (Stop(1),), 0.0)
    nodes: dict[str, list[int]] = {"ann": [], "bob": []}
    for _, name, node in drive(traffic, 200.0, slow):
        nodes[name].append(node)
        assert traffic.robots["ann"].node != traffic.robots["bob"].node
    assert 3 in nodes["ann"]
    assert 1 in nodes["bob"]
    assert (nodes["ann"][-1], nodes["bob"][-1]) == (0, 4)
    assert all(robot.is_idle and not robot.moves for robot in traffic.robots.values())


def test_what_is_released_excludes_what_others_have(traffic: Traffic) -> None:
    """At every moment of a meeting no two released moves, and no move and standing robot, exclude each other."""
    traffic.assign("ann", (Stop(3),), 0.0)
    traffic.assign("bob", (Stop(1),), 0.0)
    roadmap, checked = traffic.roadmap, 0
    for _ in range(60):
        traffic.release(0.0)
        ann, bob = traffic.robots["ann"], traffic.robots["bob"]
        for one, other in ((ann, bob), (bob, ann)):
            edges = {move.edge for move in one.moves[: one.released]}
            for move in other.moves[: other.released]:
                assert not edges & roadmap.edges_at_edge[move.edge]
                checked += 1
            if not other.released:
                assert not edges & roadmap.edges_at_node[other.node]
        for name in ("ann", "bob"):
            robot = traffic.robots[name]
            if robot.work is not None:
                traffic.worked(name)
            elif robot.released:
                traffic.arrived(name, 0.0)
    assert checked > 5


def test_the_order_at_a_place_is_kept_when_the_first_is_late(traffic: Traffic) -> None:
    """Bob waits for Ann, who does not move, and the wait is told."""
    traffic.assign("ann", (Stop(3),), 0.0)
    traffic.assign("bob", (Stop(1),), 0.0)
    for now_s in range(0, 120, 10):
        traffic.release(float(now_s))
        bob = traffic.robots["bob"]
        if bob.released:
            traffic.arrived("bob", float(now_s))
    assert bob.node != 1
    assert {(wait.robot, wait.waits_for) for wait in traffic.waits()} == {("bob", "ann")}
    assert traffic.deadlock() == ()


def test_a_vanished_robot_keeps_what_was_released_to_it(traffic: Traffic) -> None:
    """Ann vanishes on her way to 2: nobody gets the corridor there, until she is removed."""
    traffic.assign("ann", (Stop(3),), 0.0)
    traffic.release(0.0)
    traffic.arrived("ann", 2.0)
    traffic.lose("ann", 2.0)
    assert traffic.robots["ann"].last_released_node == 2
    assert not traffic.assign("bob", (Stop(1),), 2.0)
    assert traffic.assign("bob", (Stop(3),), 2.0)
    for name, move in traffic.release(2.0):
        assert (name, move.target) == ("bob", 3)
    traffic.withdraw("bob", 2.0)
    traffic.remove("ann")
    assert traffic.assign("bob", (Stop(1),), 4.0)


def test_who_waits_for_a_vanished_robot_gets_a_new_plan(traffic: Traffic) -> None:
    """Bob's way to 1 leads past Ann, who may be on edge 1-2: he waits, and goes on when she is there again."""
    traffic.assign("ann", (Stop(3),), 0.0)
    traffic.assign("bob", (Stop(1),), 0.0)
    traffic.release(0.0)
    traffic.lose("ann", 0.0)
    drive_bob = [name for name, _ in traffic.release(0.5)]
    assert "ann" not in drive_bob
    assert traffic.robots["bob"].stops == (Stop(1),)
    traffic.find("ann", 20.0)
    assert 1 in [node for _, name, node in drive(traffic, 200.0, {}) if name == "bob"]
    assert all(robot.is_idle and not robot.moves for robot in traffic.robots.values())


def test_work_is_for_idle_robots_that_are_there(traffic: Traffic) -> None:
    """Neither a second order at once, nor one for a robot that has vanished."""
    assert traffic.assign("ann", (Stop(1),), 0.0)
    assert not traffic.assign("ann", (Stop(2),), 0.0)
    traffic.lose("bob", 0.0)
    assert not traffic.assign("bob", (Stop(3),), 0.0)


def test_reports_of_what_was_not_released_are_refused(traffic: Traffic) -> None:
    """An arrival, and work that is not due."""
    with pytest.raises(ValueError, match="ann: nothing was released"):
        traffic.arrived("ann", 0.0)
    with pytest.raises(ValueError, match="ann: no work is due at node 0"):
        traffic.worked("ann")


def test_a_robot_without_a_home_in_reach_yields_to_a_passing_place(corridor: Roadmap, pace: Pace) -> None:
    """Ann's home 0 is cut off by Bob, who stands at 1 for ever: from 2 she goes aside to 5, and Cid gets to 3."""
    traffic = Traffic(corridor, pace)
    traffic.add("bob", 1, 1)
    traffic.lose("bob", 0.0)
    traffic.add("ann", 2, 0)
    traffic.add("cid", 4, 4)
    arrivals = drive(traffic, 20.0, {})
    assert [(name, node) for _, name, node in arrivals] == [("ann", 5)]
    assert traffic.assign("cid", (Stop(2),), 20.0)


def test_a_deadlock_is_detected_and_resolved(traffic: Traffic) -> None:
    """Two plans that wait for each other (which no plan of ours does) are made anew, and both robots come home."""
    traffic.assign("ann", (Stop(3),), 0.0)
    traffic.assign("bob", (Stop(1),), 0.0)
    ann, bob = traffic.robots["ann"].moves, traffic.robots["bob"].moves
    ann[0].after.add(bob[0].number)
    bob[0].after.add(ann[0].number)
    assert set(traffic.deadlock()) == {"ann", "bob"}
    drive(traffic, 200.0, {})
    assert traffic.deadlocks == 1
    assert all(robot.is_idle and not robot.moves for robot in traffic.robots.values())


@pytest.mark.parametrize(
    ("waits", "cycle"),
    [
        ({"a": {"b"}, "b": {"c"}}, ()),
        ({"a": {"b"}, "b": {"a"}}, ("a", "b")),
        ({"x": {"a", "z"}, "a": {"b"}, "b": {"c"}, "c": {"a"}}, ("a", "b", "c")),
        ({"a": {"c"}, "b": {"c"}, "c": {"d"}}, ()),
    ],
)
def test_cycles_of_waiting(waits: dict[str, set[str]], cycle: tuple[str, ...]) -> None:
    """Chains and joins are none."""
    assert wait_cycle(waits) == cycle


def test_the_same_calls_give_the_same_plans(corridor: Roadmap, pace: Pace) -> None:
    """Chance is the seed's."""
    runs = []
    for _ in range(2):
        traffic = Traffic(corridor, pace, seed=3)
        traffic.add("ann", 0, 0)
        traffic.add("bob", 4, 4)
        traffic.assign("ann", (Stop(3),), 0.0)
        traffic.assign("bob", (Stop(1),), 0.0)
        runs.append(drive(traffic, 100.0, {"ann": 1.5}))
    assert runs[0] == runs[1]
    assert RETRY_S > 0
    assert Wait("a", "b", 1).node == 1
