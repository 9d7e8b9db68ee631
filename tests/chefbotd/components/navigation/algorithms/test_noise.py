"""A lidar with random beams: what is far must be confirmed, what is near counts at once, and it is said."""

import math

import numpy as np
import pytest

from benchmarks.situations import noisy
from chefbotd.components.navigation.algorithms.interface import Seen
from chefbotd.components.navigation.algorithms.noise import Noise, after_turn, find_confirmed, noise_sentence
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.components.zones.zone_file import NO_ZONES
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import box
from tests.chefbotd.components.navigation.algorithms.drives import ROUND
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

HERE, LIDAR = Pose2D(3.0, 2.0), np.zeros(2)
BEARINGS = np.linspace(-math.pi, math.pi, 360, endpoint=False)


def turn(at: dict[int, float]) -> np.ndarray:
    """A turn of 360 beams that end 1.5 m away, but for these."""
    ranges = np.full(360, 1.5)
    for beam, range_m in at.items():
        ranges[beam] = range_m
    return np.stack([np.cos(BEARINGS), np.sin(BEARINGS)], axis=1) * ranges[:, None]


def world() -> WorldModel:
    """A hall of 6 by 4 m."""
    return WorldModel(ROUND, rasterised(box(0, 0, 6.0, 4.0), 6.0, 4.0), NO_ZONES)


def seen_at(model: WorldModel, x_m: float, y_m: float) -> bool:
    """Whether the world model has an obstacle within 8 cm of a place."""
    points = model.obstacles(model.scan_stamp_s)
    return bool((np.hypot(points[:, 0] - x_m, points[:, 1] - y_m) < 0.08).any())


def test_one_beam_at_something_far_marks_nothing_until_a_second_turn_has_it_too() -> None:
    """1 m ahead: after one turn nothing is there, after the second there is, as for a chair's leg."""
    model = world()
    model.add_scan(Seen(1.0, HERE, LIDAR, turn({180: 1.0})))
    assert not seen_at(model, 4.0, 2.0)
    model.add_scan(Seen(1.1, HERE, LIDAR, turn({180: 1.0})))
    assert seen_at(model, 4.0, 2.0)


def test_two_beams_side_by_side_mark_something_far_at_once() -> None:
    """A leg of 3 cm, 1 m ahead."""
    model = world()
    model.add_scan(Seen(1.0, HERE, LIDAR, turn({180: 1.0, 181: 1.0})))
    assert seen_at(model, 4.0, 2.0)


def test_one_beam_at_something_near_is_driven_by_at_once() -> None:
    """0.4 m ahead, 0.22 m before the outline: it is among the points that the next arc is checked against."""
    model = world()
    model.add_scan(Seen(1.0, HERE, LIDAR, turn({180: 0.4})))
    near = model.surroundings(HERE, 1.0)
    assert (np.hypot(near.points_m[:, 0] - 0.4, near.points_m[:, 1]) < 0.01).any()


def test_the_share_of_points_that_nothing_confirms_is_said_from_one_in_two_hundred() -> None:
    """18 of 360 beams at random, turn after turn: five in a hundred, within one."""
    chance, noise = np.random.default_rng(1), Noise()
    for _ in range(100):
        points = turn(
            {int(beam): float(chance.uniform(2, 9)) for beam in chance.choice(360, 18, replace=False)}
        )
        confirmed = find_confirmed(noise, points, LIDAR[None, :])
        noise = after_turn(noise, points, ~confirmed)
    assert noise.share == pytest.approx(0.05, abs=0.01)
    assert (
        noise_sentence(noise.share) == "the lidar is noisy: 5% of its points are confirmed by no other beam"
    )
    assert not noise_sentence(0.004)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "most_s"), [(0.0, 19.0), (0.01, 19.5), (0.03, 21.0), (0.1, 30.0)])
def test_a_noisy_lidar_slows_the_robot_little(share: float, most_s: float) -> None:
    """5 m of a hall, which take 17.6 s; nobody is invented, so the way is straight."""
    run = noisy(1, share)
    assert run.end is End.REACHED
    assert run.time_s < most_s
    assert run.way_m < 5.1
    assert any("the lidar is noisy" in sentence for sentence in run.said) == (share > 0)
