"""Matching: surfaces, grids, search and polish, each against what can be worked out by hand or by brute force."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.mapping.algorithms import correlate
from chefbotd.components.mapping.algorithms.correlate import Excluded, Window, search
from chefbotd.components.mapping.algorithms.local_map import CELL_M, SURFEL_M, LocalMap, empty, insert_scan
from chefbotd.components.mapping.algorithms.refine import Prior, polish, solve3
from chefbotd.components.mapping.algorithms.surfaces import Singles, normals
from chefbotd.core.poses import Floats, between, transform
from tests.budget import examples

CENTER, NO_PRIOR = np.zeros(2), np.zeros((3, 3))
SIGMA_M = 0.03


def line(ax: float, ay: float, bx: float, by: float, step_m: float = 0.03) -> Singles:
    """Points on a wall, both ends included."""
    count = math.ceil(math.hypot(bx - ax, by - ay) / step_m) + 1
    return np.linspace([ax, ay], [bx, by], count).astype(np.float32)


def corner() -> Singles:
    """Two walls at 80 degrees that meet ahead on the right, seen from the right to the left."""
    return np.vstack([line(-0.5, -1.1, 1.9, -1.4), line(1.93, -1.37, 2.3, 1.2)])


def seen_from(pose: Floats, points: Singles) -> Singles:
    """The points in the frame of a pose."""
    poses = np.column_stack([points, np.zeros(len(points))])
    return between(pose, poses)[:, :2].astype(np.float32)


def mapped(points: Singles) -> LocalMap:
    """A map of one scan taken at the origin."""
    return insert_scan(empty(), np.zeros(3), CENTER, points, normals(points, CENTER))


def test_normals_face_the_sensor() -> None:
    """A wall from (2, -0.4) to (2.3, 0.6) runs at 73.3 degrees, so its normal looks back at 163.3.

    Its ends, with neighbours on one side only, may be corners: they have none.
    """
    found = normals(line(2.0, -0.4, 2.3, 0.6), CENTER)
    along = math.atan2(1.0, 0.3)
    assert np.allclose(found[1:-1], [math.cos(along + math.pi / 2), math.sin(along + math.pi / 2)], atol=1e-3)
    assert np.allclose(found[[0, -1]], 0)


def test_points_of_two_lidars_are_no_line() -> None:
    """A wall 2 m ahead, its right half seen from the middle, its left one from behind: each half faces its lidar."""
    points = line(2.0, -0.4, 2.0, 0.4)
    places = np.where(points[:, 1:] < 0, CENTER, [[4.3, 0.2]])
    found = normals(points, places)
    right = int((points[:, 1] < 0).sum())
    assert np.allclose(found[1 : right - 1], [-1.0, 0.0], atol=1e-5)
    assert np.allclose(found[right + 1 : -1], [1.0, 0.0], atol=1e-5)
    assert np.allclose(found[[0, right - 1, right, -1]], 0)


def test_each_beam_clears_the_way_from_its_own_lidar() -> None:
    """Two posts, each seen from straight before it: the slant to the other lidar is unseen."""
    posts = np.array([[1.05, 0.05], [1.05, 2.05]], np.float32)
    places, none = np.array([[0.05, 0.05], [0.05, 2.05]]), np.zeros((2, 2), np.float32)
    grids = insert_scan(empty(), np.zeros(3), places, posts, none)
    passes = {
        (x, y): int(grids.seen[int((y - grids.origin_m[1]) / 0.1), int((x - grids.origin_m[0]) / 0.1), 1])
        for x, y in ((0.55, 0.05), (0.55, 2.05), (0.55, 1.05))
    }
    assert passes == {(0.55, 0.05): 1, (0.55, 2.05): 1, (0.55, 1.05): 0}


def test_a_lone_point_has_no_normal() -> None:
    """A table's leg, half a metre before the wall, belongs to no surface."""
    points = np.vstack([line(2.0, -0.5, 2.0, -0.1), [[1.5, 0.0]], line(2.0, 0.1, 2.0, 0.5)]).astype(
        np.float32
    )
    found = normals(points, CENTER)
    lone = int(np.argmin(points[:, 0]))
    assert np.allclose(found[lone], 0)
    assert np.allclose(found[1:5], [-1, 0], atol=1e-6)


def test_a_cell_keeps_the_mean_of_its_points() -> None:
    """No precision is lost to the grid: the surfaces along a wall at x = 1.537 lie there."""
    grids = mapped(line(1.537, -0.6, 1.537, 0.6, step_m=0.01))
    weight = grids.surfels[..., 0, 0]
    rows, columns = np.nonzero(weight)
    x = (
        grids.origin_m[0]
        + (columns + 0.5) * SURFEL_M
        + grids.surfels[rows, columns, 0, 1] / weight[rows, columns]
    )
    assert np.allclose(x, 1.537, atol=1e-5)
    assert weight.sum() == pytest.approx(121)


def test_beams_count_where_they_end_and_what_they_pass() -> None:
    """One beam along x of 1.02 m: it ends in the cell at 1.0, and passes those up to 0.87."""
    grids = mapped(np.array([[1.02, 0.05]], np.float32))
    column, row = (np.array([1.02, 0.05]) - grids.origin_m) / SURFEL_M
    assert grids.seen[int(row), int(column), 0] == 1
    passed = grids.origin_m[0] + SURFEL_M * np.flatnonzero(grids.seen[..., 1].sum(axis=0))
    assert passed.min() == pytest.approx(0.0)
    assert passed.max() == pytest.approx(0.8)


def test_both_sides_of_a_thin_wall_are_kept_apart() -> None:
    """A wall of 4 cm seen from both rooms: a scan of either side fits its own side."""
    near, far = line(1.51, -0.8, 1.51, 0.8), line(1.55, 0.8, 1.55, -0.8)
    grids = mapped(near)
    behind = np.array([3.0, 0.0, math.pi])
    there = seen_from(behind, far)
    grids = insert_scan(grids, behind, CENTER, there, normals(there, CENTER))
    for pose, points in ((np.zeros(3), near), (behind, there)):
        fit = polish(grids, points, normals(points, CENTER), pose, Prior(pose, np.eye(3)), SIGMA_M)
        assert abs(fit.pose[0] - pose[0]) < 2e-3
        assert fit.share == 1


def test_a_map_grows_without_losing_anything() -> None:
    """A scan taken 7 m away leaves what was there in its place."""
    before = mapped(corner())
    total, place = (
        before.surfels[..., 0].sum(),
        before.origin_m + np.argwhere(before.likelihood.T == 255).min(0),
    )
    after = insert_scan(before, np.array([-7.0, 5.0, 2.0]), CENTER, corner(), normals(corner(), CENTER))
    assert after.surfels[..., 0].sum() == pytest.approx(2 * total, rel=0.02)
    assert (after.origin_m <= before.origin_m).all()
    shift = np.rint((before.origin_m - after.origin_m) / CELL_M).astype(int)
    height, width = before.likelihood.shape
    kept = after.likelihood[shift[1] : shift[1] + height, shift[0] : shift[0] + width]
    assert (kept >= before.likelihood).all()
    assert place.shape == (2,)


@settings(max_examples=examples(20), deadline=None)
@given(st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=1, max_size=30))
def test_coarse_cells_bound_fine_ones(points: list[tuple[float, float]]) -> None:
    """For every shift within a coarse cell the fine likelihood is no higher than the coarse one."""
    grids = mapped(np.array(points, np.float32))
    for x in range(4):
        for y in range(4):
            shifted = np.zeros_like(grids.likelihood)
            rows, columns = grids.likelihood.shape
            shifted[: rows - y, : columns - x] = grids.likelihood[y:, x:]
            assert (grids.coarse.repeat(4, 0).repeat(4, 1) >= shifted).all()


@pytest.mark.parametrize("window", [Window(0.3, 0.2), Window(0.9, 0.3)])
def test_a_search_finds_what_trying_everything_finds(window: Window) -> None:
    """The best score in the window, with both numbers of levels, is that of the best of all poses on its raster."""
    grids, truth = mapped(corner()), np.array([0.15, -0.22, 0.13])
    points = seen_from(truth, corner())[::4]
    found = search(grids, points, np.zeros(3), window, points_at_most=1000)
    assert found is not None
    assert np.abs(found.pose[:2] - truth[:2]).max() <= CELL_M
    assert abs(found.pose[2] - truth[2]) < 0.04
    steps = np.arange(-4, 5) * CELL_M
    tried = [
        found.pose + np.array([dx, dy, turn]) for dx in steps for dy in steps for turn in (-0.03, 0.0, 0.03)
    ]
    scores = [likelihood(grids, pose, points) for pose in tried]
    assert found.score == pytest.approx(max(scores), abs=0.02)
    assert found.score == pytest.approx(likelihood(grids, found.pose, points), abs=1e-6)


def likelihood(grids: LocalMap, pose: Floats, points: Singles) -> float:
    """The mean likelihood of a scan at a pose."""
    cells = np.floor((transform(pose, points) - grids.origin_m) / CELL_M).astype(int)
    rows, columns = grids.likelihood.shape
    inside = (cells >= 0).all(axis=1) & (cells[:, 1] < rows) & (cells[:, 0] < columns)
    return float(grids.likelihood[cells[inside, 1], cells[inside, 0]].sum() / 255 / len(points))


def test_what_is_excluded_is_not_found() -> None:
    """With the right pose excluded the next best is elsewhere, and scores clearly less."""
    grids, points = mapped(corner()), corner()
    best = search(grids, points, np.zeros(3), Window(0.9, 0.2))
    other = search(grids, points, np.zeros(3), Window(0.9, 0.2), excluded=Excluded(0.0, 0.0, 0.0, 0.4, 0.5))
    assert best is not None
    assert other is not None
    assert math.hypot(*other.pose[:2]) >= 0.4
    assert other.score < 0.8 * best.score
    assert search(grids, points, np.zeros(3), Window(0.9, 0.2), above=best.score) is None


def test_polish_finds_millimetres() -> None:
    """From 6 cm and 3 degrees off, a corner is matched within 2 mm and 0.05 degrees."""
    grids, truth = mapped(corner()), np.array([0.043, -0.031, 0.052])
    points = seen_from(truth, corner())
    facing = normals(points, CENTER - truth[:2])
    fit = polish(grids, points, facing, np.zeros(3), Prior(np.zeros(3), NO_PRIOR), SIGMA_M)
    assert np.abs(fit.pose[:2] - truth[:2]).max() < 2e-3
    assert abs(fit.pose[2] - truth[2]) < 1e-3
    assert fit.share > 0.98
    assert fit.contradictions == 0


def test_a_bare_corridor_does_not_say_how_far_along_it_the_robot_is() -> None:
    """Two parallel walls at 31 degrees: the information along them is under a thousandth of that across."""
    along = np.array([math.cos(0.54), math.sin(0.54)])
    across = np.array([-along[1], along[0]])
    right, left = -4 * along - across, 4 * along + across
    points = np.vstack([line(*right, *(4 * along - across)), line(*left, *(-4 * along + across))])
    grids = mapped(points)
    inner = np.vstack([points[60:200], points[-200:-60]])
    fit = polish(grids, inner, normals(inner, CENTER), np.zeros(3), Prior(np.zeros(3), np.eye(3)), SIGMA_M)
    place = fit.information[:2, :2]
    assert along @ place @ along < 1e-3 * (across @ place @ across)
    assert across @ place @ across > 1e4


def test_a_prior_decides_what_the_walls_leave_open() -> None:
    """Along one long wall x comes from the prior, y from the wall, which is 2 cm off it."""
    points = line(-5.0, 1.0, 5.0, 1.0)[::-1].copy()
    grids = mapped(points)
    inner = points[60:-60]
    prior = Prior(np.array([0.07, 0.02, 0.0]), np.diag([100.0, 100.0, 100.0]))
    fit = polish(grids, inner, normals(inner, CENTER), prior.pose, prior, SIGMA_M)
    assert fit.pose[0] == pytest.approx(0.07, abs=2e-3)
    assert fit.pose[1] == pytest.approx(0.0, abs=2e-3)


def test_points_in_known_free_space_are_contradictions() -> None:
    """A scan of a wall a metre before the known one fits nowhere, and says so."""
    grids = mapped(line(3.0, -1.5, 3.0, 1.5))
    nearer = line(2.0, -0.8, 2.0, 0.8)
    prior = Prior(np.zeros(3), np.eye(3) * 1e6)
    fit = polish(grids, nearer, normals(nearer, CENTER), np.zeros(3), prior, SIGMA_M)
    assert fit.inliers == 0
    assert fit.contradictions > 0.9 * fit.points
    assert fit.share == 0


def test_three_equations_are_solved_as_numpy_does() -> None:
    """And a matrix that is not positive is refused."""
    root = np.array([[2.0, 0.3, -1.0], [0.0, 1.5, 0.4], [0.2, 0.0, 0.9]])
    matrix, right = root @ root.T, np.array([1.0, -2.0, 0.5])
    found = np.zeros(3)
    assert solve3(np.column_stack([matrix, right]), found)
    assert np.allclose(found, np.linalg.solve(matrix, right))
    assert not solve3(np.column_stack([np.diag([1.0, -1.0, 1.0]), right]), found)


def test_a_search_in_parts_finds_the_same_as_one_at_once() -> None:
    """In how many parts it goes on changes neither the pose nor the work."""
    known, points = mapped(corner()), seen_from(np.array([0.15, -0.22, 0.13]), corner())
    parts = correlate.start_window_search(known, points, np.zeros(3), Window(0.9, 0.5))
    at_once = correlate.advance_window_search(
        correlate.start_window_search(known, points, np.zeros(3), Window(0.9, 0.5)), 10**12
    )
    steps = 0
    while not parts.is_done:
        parts, steps = correlate.advance_window_search(parts, 50_000), steps + 1
    assert steps > 3
    assert parts.work == at_once.work
    assert parts.best_pose is not None
    assert at_once.best_pose is not None
    assert parts.best_pose.score == at_once.best_pose.score
    assert parts.best_pose.pose.tolist() == at_once.best_pose.pose.tolist()
