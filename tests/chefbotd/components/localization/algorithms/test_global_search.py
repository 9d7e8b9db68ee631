"""The search of the whole map: it misses nothing that brute force finds, in bounded steps."""

import math

import numpy as np
import pytest

from chefbotd.components.localization.algorithms.branch_and_bound import CELL_M, Pyramid, pyramid
from chefbotd.components.localization.algorithms.global_search import (
    BOUNDS_A_STEP,
    GlobalSearch,
    advance_global_search,
    places,
    start_search,
    thin_points,
)
from chefbotd.components.localization.algorithms.surface_map import surface_map
from chefbotd.components.mapping.algorithms.surfaces import Singles
from chefbotd.core.poses import Floats, transform
from tests.chefbotd.components.localization.algorithms.buildings import drawn
from tests.chefbotd.components.mapping.algorithms.slam.flat import Lidar, box, wall

ROOM = np.vstack([box(0, 0, 4.2, 3.1), box(0.6, 0.5, 0.9, 0.6, 0.3), wall((2.6, 3.1), (2.9, 1.9))])
HERE = np.array([3.0, 1.2, 2.2])


@pytest.fixture(scope="module")
def levels() -> Pyramid:
    """The room's."""
    return pyramid(surface_map(drawn(ROOM)))


def done(search: GlobalSearch, bounds_a_step: int = BOUNDS_A_STEP) -> tuple[GlobalSearch, int]:
    """The finished search, and how many steps it took."""
    steps = 0
    while not search.is_done:
        search, steps = advance_global_search(search, bounds_a_step=bounds_a_step), steps + 1
    return search, steps


def brute_force(levels: Pyramid, points: Singles, turns: Floats) -> float:
    """The score of the best pose of all that stand on a free cell, tried one by one."""
    best, likelihood = 0.0, levels.levels[0]
    rows, columns = np.nonzero(levels.is_free[0])
    for turn in turns:
        cells = np.floor(transform(np.array([0, 0, turn]), points) / CELL_M + 0.5).astype(int)
        x, y = cells[:, 0][:, None] + columns, cells[:, 1][:, None] + rows
        inside = (x >= 0) & (y >= 0) & (x < likelihood.shape[1]) & (y < likelihood.shape[0])
        values = np.where(
            inside, likelihood[y.clip(0, len(likelihood) - 1), x.clip(0, likelihood.shape[1] - 1)], 0
        )
        best = max(best, float(values.mean(axis=0).max()) / 255)
    return best


@pytest.mark.slow
def test_nothing_that_brute_force_finds_is_missed(levels: Pyramid) -> None:
    """The best score is that of all poses tried one by one, and its place is where the scan was taken."""
    search, _ = done(start_search(levels, Lidar(ROOM, 3).points(HERE), points_at_most=40))
    found, is_complete = places(search)
    assert is_complete
    assert found[0].score == pytest.approx(brute_force(levels, search.points, search.turns), abs=1e-9)
    assert math.dist(found[0].pose[:2], HERE[:2]) < 0.15
    assert abs(math.remainder(found[0].pose[2] - HERE[2], math.tau)) < 0.08


def test_a_small_budget_takes_more_steps_and_finds_the_same(levels: Pyramid) -> None:
    """A hundredth of the work in a step: many steps, one result."""
    points = Lidar(ROOM, 3).points(HERE)
    (one, few), (other, many) = (
        done(start_search(levels, points)),
        done(start_search(levels, points), bounds_a_step=300),
    )
    assert many > 3 * few
    assert [place.score for place in places(one)[0]] == [place.score for place in places(other)[0]]


def test_too_many_places_are_said_to_be_too_many(levels: Pyramid) -> None:
    """Two points fit along every wall: it keeps as many places as it may, and says that these are not all."""
    search, _ = done(start_search(levels, np.array([[1.0, 0.0], [1.0, 0.3]], np.float32)))
    found, is_complete = places(search, at_most=5)
    assert len(found) == 5
    assert not is_complete


def test_points_near_the_robot_do_not_outweigh_the_rest() -> None:
    """A hundred points within 0.1 m count as one or two; those further apart all stay."""
    near = np.linspace([0.31, 0.02], [0.31, 0.11], 100)
    far = np.array([[2.0, 0.5 * k] for k in range(5)])
    kept = thin_points(np.vstack([near, far]).astype(np.float32), 80)
    assert len(kept) == 6


def test_a_scan_without_points_is_refused(levels: Pyramid) -> None:
    """There is nothing to search for."""
    with pytest.raises(ValueError, match="a scan with points"):
        start_search(levels, np.zeros((0, 2), np.float32))
