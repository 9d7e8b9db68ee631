"""People who walk about, things in the way, and the robot among them."""

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from chefbotd.components.simulation.crowd import Crowd
from chefbotd.components.simulation.parameters.simulation import (
    PersonParameters,
    SimulationParameters,
    ThingParameters,
)
from chefbotd.components.simulation.simulation import Simulation, build_launchpad
from chefbotd.components.simulation.world import World
from chefbotd.core.geometry import Pose2D

FAR = Pose2D(50.0, 50.0)


def person(**values: Any) -> PersonParameters:
    """Somebody on an oblique way of 5 m: from (1, 2) to (4, 6)."""
    return PersonParameters.model_validate({"path_m": [[1.0, 2.0], [4.0, 6.0]], "pause_s": 0, **values})


def walk(crowd: Crowd, seconds: float, robot: Pose2D = FAR) -> np.ndarray:
    """Where the first disc was, every 0.01 s."""
    places = []
    for _ in range(round(seconds / 0.01)):
        crowd.step(0.01, robot, 0.18)
        places.append(crowd.discs[0, :2])
    return np.array(places)


def test_people_walk_at_their_speed_to_and_fro() -> None:
    """5 m at about 0.5 m/s take 10 s; they keep to their path and come back to its begin."""
    places = walk(Crowd([person(speed_m_s=0.5)], [], seed=4), 25.0)
    steps = np.hypot(*np.diff(places, axis=0).T)
    assert 0.3 < np.median(steps) / 0.01 < 0.7
    assert (places[:, 1] - 2) * 3 == pytest.approx((places[:, 0] - 1) * 4)
    assert places[:, 0].max() == pytest.approx(4.0, abs=0.01)
    assert places[places[:, 0].argmax() :, 0].min() == pytest.approx(1.0, abs=0.2)


def test_the_seed_decides_how_they_walk() -> None:
    """The same seed, the same steps; another, others; two people differ."""
    ways = [walk(Crowd([person(), person()], [], seed=seed), 8.0) for seed in (1, 1, 2)]
    assert (ways[0] == ways[1]).all()
    assert not (ways[0] == ways[2]).all()


def test_going_round_leads_back_along_the_last_side() -> None:
    """A triangle of 3, 4 and 5 m: after 12 m at the begin again, never turned."""
    path = [[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]
    places = walk(Crowd([person(path_m=path, closed_path=True, speed_m_s=2.0)], [], seed=1), 5.0)
    assert np.abs(places[:, 1] * 3 - places[:, 0] * 4)[places[:, 0] < 2.9][-80:].min() == pytest.approx(
        0, abs=0.05
    )
    with pytest.raises(ValidationError, match="three points"):
        person(closed_path=True)


@pytest.mark.parametrize(("stops", "nearest_m"), [(True, 0.25 + 0.18 + 0.3), (False, 0.0)])
def test_who_waits_keeps_off_the_robot(stops: bool, nearest_m: float) -> None:
    """A robot on the path: one stops 0.3 m before touching it, the other walks through it."""
    robot = Pose2D(2.5, 4.0)
    places = walk(Crowd([person(stops_for_robot=stops)], [], seed=1), 10.0, robot)
    assert np.hypot(places[:, 0] - 2.5, places[:, 1] - 4.0).min() == pytest.approx(nearest_m, abs=0.02)


def test_things_are_put_and_taken_away() -> None:
    """A configured chair, and one that comes and goes by its name."""
    crowd = Crowd([], [ThingParameters(x_m=1.0, y_m=2.0)], seed=1)
    crowd.put("bag", 3.0, 4.0, 0.1)
    assert crowd.discs.tolist() == [[1.0, 2.0, 0.25], [3.0, 4.0, 0.1]]
    crowd.put("bag", 3.5, 4.0, 0.1)
    crowd.take_away("bag")
    assert crowd.discs.tolist() == [[1.0, 2.0, 0.25]]
    with pytest.raises(KeyError):
        crowd.take_away("bag")


def test_a_beam_ends_at_a_person() -> None:
    """The wall at 2 m, a person of 0.25 m at 1.2 m before it."""
    world = World([(2.0, -5.0, 2.0, 5.0)], Crowd([], [ThingParameters(x_m=1.2, y_m=0.0)], seed=1))
    assert world.first_hits_m((0.0, 0.0), np.array([0.0, math.pi / 4])) == pytest.approx(
        [0.95, 2 * math.sqrt(2)]
    )


def test_a_robot_that_touches_a_thing_goes_no_further_and_says_so() -> None:
    """Full speed into a disc of 0.25 m at 1 m: the robot of 0.18 m comes to rest 0.57 m from its start, in contact."""
    things = {"things": [{"x_m": 1.0, "y_m": 0.0}]}
    board = build_launchpad(Simulation(SimulationParameters.model_validate(things)))
    board.receive(b"s 255 255\r", 1.0)
    assert not board.truth(1.0, 0.0).in_contact
    touching = board.truth(4.0, 0.0)
    assert touching.in_contact
    assert math.dist((touching.world_from_base.x_m, touching.world_from_base.y_m), (1.0, 0.0)) == (
        pytest.approx(0.43, abs=1e-6)
    )


def test_a_robot_slides_off_a_thing_that_it_meets_with_its_side() -> None:
    """A disc 0.3 m beside its way: it is pushed aside, passes, and is free again."""
    things = {"things": [{"x_m": 0.8, "y_m": 0.3}]}
    board = build_launchpad(Simulation(SimulationParameters.model_validate(things)))
    board.receive(b"s 255 255\r", 1.0)
    contacts = [board.truth(1.0 + k / 10, 0.0) for k in range(60)]
    assert any(truth.in_contact for truth in contacts)
    assert contacts[-1].world_from_base.x_m > 1.3
    assert not contacts[-1].in_contact
    assert contacts[-1].world_from_base.y_m < -0.05


def test_a_person_who_walks_into_a_standing_robot_is_a_contact_and_moves_it_nowhere() -> None:
    """The robot stays where it is while the person passes through, and is told to be touched meanwhile."""
    people = {
        "people": [
            {
                "path_m": [[-1.0, 0.05], [1.0, 0.05]],
                "stops_for_robot": False,
                "pause_s": 60.0,
                "speed_m_s": 1.0,
            }
        ]
    }
    board = build_launchpad(Simulation(SimulationParameters.model_validate(people)))
    truths = [board.truth(k / 20, 0.0) for k in range(80)]
    assert {truth.world_from_base for truth in truths} == {Pose2D()}
    assert any(truth.in_contact for truth in truths)
    assert not truths[-1].in_contact


def test_when_the_robot_is_looked_at_changes_nothing_among_people() -> None:
    """Asked every 7 ms or once: the same pose, though people wait for it."""
    values = {"people": [{"path_m": [[1.0, -0.5], [1.0, 1.0]]}], "seed": 5}
    poses = []
    for times in ([3.0], [k * 0.007 for k in range(429)] + [3.0]):
        board = build_launchpad(Simulation(SimulationParameters.model_validate(values)))
        board.receive(b"s 200 220\r", 0.5)
        for at_s in times:
            truth = board.truth(at_s, 0.0) if at_s >= 0.5 else None
        poses.append(truth)
    assert poses[0] == poses[1]
    trail = board.trail(3.0, 2.5)
    assert trail[-1, 0] == pytest.approx(3.0)
    assert np.diff(trail[:, 0]) == pytest.approx(0.005)
