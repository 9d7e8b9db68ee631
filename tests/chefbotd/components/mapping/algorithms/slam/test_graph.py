"""The pose graph, against sums that can be done by hand."""

import math

import numpy as np
import pytest

from chefbotd.components.mapping.algorithms.graph import (
    NO_EDGES,
    Edges,
    drift_m,
    edge,
    optimise_graph,
    residuals,
    squared_errors,
    weights,
)
from chefbotd.core.poses import Floats, between, compose

FIRST = np.array([0])


def joined(*edges: Edges) -> Edges:
    """All of them as one."""
    found = NO_EDGES
    for each in edges:
        found = found.joined(each)
    return found


def straight(first: int, second: int, way_m: float, sigma_m: float = 0.1, *, loop: bool = False) -> Edges:
    """So far ahead, as surely as that; the heading to 0.1 rad."""
    return edge(
        first, second, np.array([way_m, 0.0, 0.0]), np.diag([sigma_m**2, sigma_m**2, 0.01]), loop=loop
    )


def test_a_loop_of_equals_is_spread_evenly() -> None:
    """Two steps of 1 m and a loop that says 2.3 m: each of the three gives way by a tenth of a metre."""
    edges = joined(straight(0, 1, 1.0), straight(1, 2, 1.0), straight(0, 2, 2.3, loop=True))
    found = optimise_graph(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], float), edges, FIRST)
    assert np.allclose(found, [[0, 0, 0], [1.1, 0, 0], [2.2, 0, 0]], atol=1e-6)


def test_what_is_known_more_surely_gives_way_less() -> None:
    """With twice the sigma, so four times the variance, the loop takes four sixths of the 0.3 m."""
    edges = joined(straight(0, 1, 1.0), straight(1, 2, 1.0), straight(0, 2, 2.3, 0.2, loop=True))
    found = optimise_graph(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], float), edges, FIRST)
    assert np.allclose(found[:, 0], [0, 1.05, 2.1], atol=1e-6)


def test_residuals_are_in_the_frame_of_the_first_node() -> None:
    """A node that looks left (90 degrees) sees one at (0, 2) straight ahead, half a metre further than told."""
    poses = np.array([[0, 0, math.pi / 2], [0, 2, math.pi / 2]])
    off = residuals(poses, straight(0, 1, 1.5))
    assert np.allclose(off, [[0.5, 0, 0]])
    assert np.allclose(squared_errors(poses, straight(0, 1, 1.5)), 25)


def circle(nodes: int = 24) -> Floats:
    """Poses around a circle of 3 m."""
    angle = math.tau * np.arange(nodes) / nodes
    return np.stack(
        [3 * np.sin(angle), 3 - 3 * np.cos(angle), (angle + math.pi) % math.tau - math.pi], axis=1
    )


def driven(truth: Floats, seed: int, turn_rad: float) -> Edges:
    """Steps as odometry has them that turns a little too much in each."""
    chance, found = np.random.default_rng(seed), NO_EDGES
    for k in range(len(truth) - 1):
        step = between(truth[k], truth[k + 1]) + np.array([*chance.normal(0, 0.01, 2), turn_rad])
        found = found.joined(edge(k, k + 1, step, np.diag([4e-4, 4e-4, 9e-4]), loop=False))
    return found


def laid_out(edges: Edges, nodes: int) -> Floats:
    """Where the steps alone lead."""
    poses = [np.zeros(3)]
    for k in range(nodes - 1):
        poses.append(compose(poses[-1], edges.pose[k]))
    return np.array(poses)


def test_a_loop_that_corrects_a_metre_of_drift_is_not_switched_off() -> None:
    """Sixteen degrees of drift around a circle: the true loop pulls the end to where it began."""
    truth = circle()
    edges = driven(truth, 1, 0.012)
    begin = laid_out(edges, len(truth))
    assert math.hypot(*(begin[-1] - truth[-1])[:2]) > 0.5
    loop = edge(0, len(truth) - 1, between(truth[0], truth[-1]), np.diag([1e-4, 1e-4, 1e-5]), loop=True)
    scale = float(squared_errors(begin, loop)[0])
    found = optimise_graph(begin, edges.joined(loop), FIRST, scale)
    assert math.hypot(*(found[-1] - truth[-1])[:2]) < 0.01
    assert weights(squared_errors(found, loop), loop.loop, 10.0)[0] == 1


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_wrong_loop_among_right_ones_does_not_fold_the_map(seed: int) -> None:
    """One says that opposite ends of the circle are the same place; three right ones stand against it."""
    truth = circle()
    edges, last = driven(truth, seed, 0.004), len(truth) - 1
    tight = np.diag([4e-4, 4e-4, 1e-4])
    right = [
        edge(a, b, between(truth[a], truth[b]), tight, loop=True) for a, b in ((0, last), (2, 20), (4, 16))
    ]
    wrong = edge(1, 13, np.array([0.1, 0.0, 0.2]), tight, loop=True)
    begin = laid_out(edges, len(truth))
    everything = joined(edges, *right, wrong)
    found = optimise_graph(begin, everything, FIRST, float(squared_errors(begin, everything).max()))
    assert np.hypot(*(found - truth)[:, :2].T).max() < 0.2
    assert weights(squared_errors(found, wrong), wrong.loop, 10.0)[0] < 0.05


def test_parts_that_are_not_connected_stay_where_they_are() -> None:
    """With a fixed node in each part there is one solution, and neither part moves the other."""
    edges = joined(straight(0, 1, 1.0), straight(2, 3, 2.0))
    poses = np.array([[0, 0, 0], [1.2, 0, 0], [5, 5, 0], [6.5, 5, 0]])
    found = optimise_graph(poses, edges, np.array([0, 2]))
    assert np.allclose(found, [[0, 0, 0], [1, 0, 0], [5, 5, 0], [7, 5, 0]], atol=1e-6)


def test_drift_is_that_of_the_surest_way() -> None:
    """By 0-1-2 it is sqrt(0.1^2 + 0.1^2) and the heading's 0.1 rad twice, times a lever of 2 m; directly it is less."""
    around = joined(straight(0, 1, 1.0), straight(1, 2, 1.0))
    expected = math.sqrt(2 * (0.01 + 4 * 0.01))
    assert drift_m(3, around, 2, lever_m=2.0)[0] == pytest.approx(expected)
    direct = around.joined(edge(0, 2, np.zeros(3), np.diag([0.01, 0.03, 0.005]), loop=True))
    assert drift_m(3, direct, 2, lever_m=2.0)[0] == pytest.approx(math.sqrt(0.02 + 4 * 0.005))
    assert np.isinf(drift_m(4, direct, 2, lever_m=2.0)[3])
