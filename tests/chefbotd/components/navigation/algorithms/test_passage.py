"""What is too narrow is measured by the lidar, and ends a goal with its width."""

import re

import numpy as np
import pytest

from benchmarks.situations import squeezed
from chefbotd.components.navigation.algorithms.grid import Singles
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.passage import measured_passage
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.core.geometry import Pose2D

ROUND = Footprint(radius_m=0.18)
NO_MAP: Singles = np.full((100, 100), np.inf, np.float32)


def sides(width_m: float, noise_m: float = 0.01) -> Surroundings:
    """A corridor ahead from 0.2 m on, its middle 1 cm to the left, its walls seen with noise."""
    chance = np.random.default_rng(1)
    x = np.arange(0.2, 0.9, 0.01)
    points = np.vstack([np.stack([x, np.full_like(x, 0.01 + side * width_m / 2)], 1) for side in (-1, 1)])
    points[:, 1] += chance.normal(0, noise_m, len(points))
    still = np.zeros_like(points)
    return Surroundings(points, still, np.full(len(points), 0.015), NO_MAP, 0.05, Pose2D(2, 2))


@pytest.mark.parametrize(
    ("width_m", "is_too_narrow"), [(0.38, True), (0.40, True), (0.44, False), (0.5, False)]
)
def test_a_passage_is_measured_within_a_centimetre_or_two(width_m: float, is_too_narrow: bool) -> None:
    """The robot is 0.36 m wide and needs 6 cm more; the lidar's noise is a centimetre."""
    passage = measured_passage(ROUND, sides(width_m))
    assert passage is not None
    assert passage.width_m == pytest.approx(width_m, abs=0.02)
    assert passage.middle.y_m == pytest.approx(0.01, abs=0.02)
    assert passage.needed_m == pytest.approx(0.42)
    assert passage.is_too_narrow == is_too_narrow


def test_a_wall_on_one_side_is_no_passage() -> None:
    """The other side is open."""
    near = sides(0.4)
    left = near.points_m[:, 1] > 0
    one = Surroundings(
        near.points_m[left], near.velocity_m_s[left], near.margin_m[left], NO_MAP, 0.05, Pose2D(2, 2)
    )
    assert measured_passage(ROUND, one) is None


def test_a_wall_ahead_is_no_passage() -> None:
    """0.4 m ahead, from left to right."""
    y = np.arange(-0.4, 0.4, 0.01)
    points = np.stack([np.full_like(y, 0.4), y], 1)
    near = Surroundings(points, np.zeros_like(points), np.full(len(y), 0.015), NO_MAP, 0.05, Pose2D(2, 2))
    assert measured_passage(ROUND, near) is None


@pytest.mark.slow
def test_a_corridor_that_is_too_narrow_ends_the_goal_with_its_width() -> None:
    """4 cm wider than the robot; the map's cells of 5 cm do not show it."""
    run = squeezed(0, 0.04)
    assert run.end is End.BLOCKED
    told = re.search(r"the passage at \((.*), (.*)\) is (.*) m wide, and the robot needs 0.42 m", run.reason)
    assert told, run.reason
    assert 2.0 <= float(told[1]) <= 2.6
    assert float(told[3]) == pytest.approx(0.40, abs=0.025)
    assert run.time_s < 40.0
