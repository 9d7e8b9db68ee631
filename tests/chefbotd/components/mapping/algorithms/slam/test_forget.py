"""Memory is bounded: what is driven again and again is not kept again and again, and the map stays as it was."""

import math

import numpy as np
import pytest

from chefbotd.components.mapping.algorithms.forget import thin_scans
from chefbotd.components.mapping.algorithms.graph import NO_EDGES, edge, optimise_graph
from chefbotd.components.mapping.algorithms.parameters import SlamParameters, SubmapParameters
from chefbotd.components.mapping.algorithms.state import Nodes, Scan, SlamState, start
from chefbotd.core.record import replace
from tests.chefbotd.components.mapping.algorithms.slam.drives import drive, off_m, walls_off_m
from tests.chefbotd.components.mapping.algorithms.slam.flat import (
    Lidar,
    furnished_flat,
    odometry,
    poses_along,
)

NOTHING = Scan(np.zeros((0, 2), np.float32), np.zeros((0, 2), np.float32), np.zeros(2))


def chain(poses: list[tuple[float, float, float]], way: list[tuple[float, float, float]]) -> SlamState:
    """Nodes at these poses, bound by these steps: 0.1 m and 0.05 rad sure (one sigma)."""
    count, edges = len(poses), NO_EDGES
    for k, step in enumerate(way):
        edges = edges.joined(edge(k, k + 1, np.array(step), np.diag([0.01, 0.01, 0.0025]), loop=False))
    nodes = Nodes(
        np.arange(count) + 70,
        np.arange(count, dtype=float),
        np.array(poses),
        np.array(poses),
        np.arange(count, dtype=float),
        np.zeros(count, np.int64),
        (NOTHING,) * count,
    )
    return replace(start(), nodes=nodes, edges=edges)


def test_two_steps_become_one() -> None:
    """Of three nodes in a row within a metre the middle one goes: 0.3 m and 0.2 m make 0.5 m.

    Across, the variances add up, and the first step's error of heading swings the second step's 0.2 m.
    """
    cos, sin = math.cos(0.1), math.sin(0.1)
    poses = [(0.1 + way * cos, 0.1 + way * sin, 0.1) for way in (0, 0.3, 0.5)]
    state = chain(poses, [(0.3, 0, 0), (0.2, 0, 0)])
    fewer, told = thin_scans(state, most_per_place=1)
    assert fewer.nodes.number.tolist() == [70, 72]
    assert np.allclose(fewer.edges.pose, [[0.5, 0, 0]])
    covariance = np.linalg.inv(fewer.edges.information[0])
    assert covariance[1, 1] == pytest.approx(0.01 + 0.01 + 0.2**2 * 0.0025)
    assert covariance[2, 2] == pytest.approx(0.005)
    assert [(gone.number, gone.kept) for gone in told] == [(71, 72)]
    assert np.allclose(told[0].pose, [-0.2, 0, 0])


def test_a_loop_is_handed_to_the_next_node() -> None:
    """A loop from node 0 to the node that goes leads to the one after it, and the solution is as before."""
    poses = [(0.1, 0.1, 0.0), (5.2, 0.1, 0.0), (5.5, 0.1, 0.0), (5.7, 0.1, 0.0)]
    state = chain(poses, [(5.1, 0, 0), (0.3, 0, 0), (0.2, 0, 0)])
    loop = edge(0, 2, np.array([5.7, 0.0, 0.0]), np.diag([0.01, 0.01, 0.0025]), loop=True)
    state = replace(state, edges=state.edges.joined(loop))
    fewer, _ = thin_scans(state, most_per_place=1)
    assert fewer.nodes.number.tolist() == [70, 73]
    looped = fewer.edges.only(fewer.edges.loop)
    assert (looped.first.tolist(), looped.second.tolist()) == ([0], [1])
    assert looped.pose[0, 0] == pytest.approx(5.9)
    fixed = np.array([0])
    before, after = (optimise_graph(s.nodes.map, s.edges, fixed) for s in (state, fewer))
    assert after[-1, 0] == pytest.approx(before[-1, 0], abs=0.03)


def test_places_that_are_not_full_keep_everything() -> None:
    """Two nodes in one place where two are allowed; a node that looks elsewhere counts for itself."""
    state = chain([(0.1, 0.1, 0.1), (0.4, 0.1, 0.1), (0.4, 0.1, 2.0)], [(0.3, 0, 0), (0, 0, 1.9)])
    fewer, told = thin_scans(state, most_per_place=2)
    assert len(fewer.nodes) == 3
    assert told == ()


@pytest.mark.slow
def test_driving_up_and_down_does_not_fill_the_memory() -> None:
    """Ten times the same way: the last five add a few nodes at most, and every pose is still right."""
    walls = furnished_flat()
    back = [(9.2, 3.9), (2.0, 3.9), (2.05, 2.4), (2.0, 3.9)]
    way = [(2.0, 2.4), (2.05, 3.9), *(back * 10)]
    truth = poses_along(way)
    lidar = Lidar(walls, 5)
    params = SlamParameters(submaps=SubmapParameters(max_scans_per_place=8))
    half = len(truth) // 2
    odom = odometry(truth, 5)
    scans = [lidar.points(pose) for pose in truth]
    first = drive(odom[:half], lambda k: scans[k], finish=False, params=params)
    count = len(first.state.nodes)
    whole = drive(odom, lambda k: scans[k], finish=False, params=params)
    assert sum(len(report.forgotten) for report in whole.reports) > 100
    assert len(whole.state.nodes) < 1.25 * count
    assert len(whole.state.edges) < 8 * len(whole.state.nodes)
    assert off_m(whole.poses(), truth).max() < 0.05
    assert np.median(walls_off_m(whole.state, truth, walls)) < 0.03
