"""Ten robots in the simulator's office, in simulated time."""

import random

import pytest
from chefbot_fleet.assignment import Order
from chefbot_fleet.lanes import LaneParameters, find_lanes
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace
from chefbot_fleet.simulation import CALM, Disturbance, FleetSimulation

from chefbotd.components.simulation.rooms import BUILDINGS

PLACES = {
    **{f"room {k + 1}": (6 * k + 2.9, 1.6) for k in range(4)},
    **{f"room {k + 5}": (6 * k + 4.6, 8.0) for k in range(3)},
    "room 8": (21.5, 8.3),
}
RADIUS_M = LaneParameters().radius_m


@pytest.fixture(scope="module")
def office() -> Roadmap:
    """The office with a place to work in each room."""
    return find_lanes(BUILDINGS["office"].grid(), LaneParameters(), PLACES)


def simulation(office: Roadmap, count: int, seed: int, *, rough: bool) -> FleetSimulation:
    """Ten robots, and so many orders between any two rooms."""
    chance = random.Random(seed)
    nodes = list(office.names.values())
    orders = [Order(f"order {k}", *chance.sample(nodes, 2)) for k in range(count)]
    disturbance = Disturbance(0.6, 1.1, 0.03, 30.0, 200.0, 60.0, 1) if rough else CALM
    return FleetSimulation(
        office, Pace(), office.homes(10), orders, dwell_s=5.0, disturbance=disturbance, seed=seed
    )


def test_every_order_is_brought_once_and_nothing_touches(office: Roadmap) -> None:
    """With robots as fast as planned."""
    result = simulation(office, 30, 1, rough=False).run(5000.0)
    assert set(result.done.values()) == {1}
    assert result.least_distance_m > 2 * RADIUS_M
    assert result.deadlocks == 0


@pytest.mark.parametrize("seed", [1, 2])
def test_the_same_with_robots_that_are_late_and_vanish(office: Roadmap, seed: int) -> None:
    """One is even carried away, and its order brought by another."""
    result = simulation(office, 30, seed, rough=True).run(10_000.0)
    assert set(result.done.values()) == {1}
    assert result.least_distance_m > 2 * RADIUS_M
    assert result.deadlocks == 0
    assert result.vanished > 0


def test_the_check_sees_robots_that_touch(office: Roadmap) -> None:
    """Without the order of moves, robots drive into each other: the measure is the discs' own."""
    careless = simulation(office, 20, 1, rough=False)
    for _ in range(4000):
        for robot in careless.traffic.robots.values():
            for move in robot.moves:
                move.after.clear()
        careless.step()
    assert careless.least_m < 2 * RADIUS_M
