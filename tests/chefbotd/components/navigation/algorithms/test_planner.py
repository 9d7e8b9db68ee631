"""The cheapest path, smoothed and checked again; goals that are refused and why."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chefbotd.components.navigation.algorithms.costmap import costmap
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.path import Goal, NoPath, Path
from chefbotd.components.navigation.algorithms.planner import plan
from chefbotd.components.navigation.algorithms.search import prepare_costs, search
from chefbotd.components.navigation.algorithms.states import UnknownSpace
from chefbotd.components.zones.zone_file import Zones
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from tests.chefbotd.components.mapping.algorithms.slam.flat import box, furnished_flat, wall
from tests.chefbotd.components.navigation.algorithms.grids import (
    dijkstra,
    drawn,
    rasterised,
    segment_distance_m,
)

RADIUS_M = 0.18
ROUND = Footprint(radius_m=RADIUS_M)


def uniform(*rows: str) -> np.ndarray:
    """Costs of 1 from a drawing."""
    return np.where(drawn(*rows).percent == 0, 1, np.inf).astype(np.float32)


def test_a_straight_way_and_a_knights_move() -> None:
    """Four steps east cost 4; two east and one north cost 1 + sqrt 2."""
    costs = uniform(*["....."] * 3)
    assert search(costs, (1, 0), (1, 4)).cost == pytest.approx(4.0)
    assert search(costs, (1, 1), (2, 3)).cost == pytest.approx(1 + math.sqrt(2))


def test_a_diagonal_step_does_not_cut_a_corner() -> None:
    """Around the corner it takes two steps instead of sqrt 2."""
    assert search(uniform("..", ".#"), (0, 0), (1, 1)).cost == pytest.approx(2.0)
    assert search(uniform("#.", ".#"), (0, 0), (1, 1)) is None


def test_a_dear_cell_is_gone_around() -> None:
    """Through the cell that costs 9 it takes 1 + 5 + 5 + 1 = 12; around it two diagonals and two steps."""
    costs = uniform(*["....."] * 3)
    costs[1, 2] = 9.0
    assert search(costs, (1, 0), (1, 4)).cost == pytest.approx(2 * math.sqrt(2) + 2)


def test_a_cell_is_its_own_goal() -> None:
    """The path is that cell, for nothing; and a blocked cell has none."""
    found = search(uniform("..."), (0, 1), (0, 1))
    assert (found.cost, found.cells.tolist()) == (0.0, [[0, 1]])
    assert search(uniform(".#."), (0, 1), (0, 1)) is None


def test_costs_prepared_once_serve_many_searches() -> None:
    """Cells have their place in the whole grid, also where its free part is smaller; outside of that nothing is free."""
    grid = prepare_costs(uniform("#####", "#...#", "#.###"))
    assert grid.find_path((0, 1), (1, 3)).cells.tolist() == [[0, 1], [1, 1], [1, 2], [1, 3]]
    assert grid.find_path((1, 3), (1, 3)).cost == 0.0
    assert [grid.find_path(cell, (1, 1)) for cell in ((0, 2), (2, 2), (1, 0), (1, 4))] == [None] * 4
    assert prepare_costs(uniform("##", "##")).find_path((0, 0), (1, 1)) is None


@given(st.integers(0, 10_000), st.integers(2, 20), st.integers(2, 20), st.floats(0.0, 0.4))
def test_no_path_costs_less(seed: int, rows: int, columns: int, share: float) -> None:
    """On random grids with random costs the search finds what plain Dijkstra finds, and its cells add up to it."""
    chance = np.random.default_rng(seed)
    costs = chance.choice([1.0, 1.0, 1.3, 2.0, 7.7], (rows, columns)).astype(np.float32)
    costs[chance.random((rows, columns)) < share] = np.inf
    start, goal = (
        (int(chance.integers(rows)), int(chance.integers(columns))),
        (int(chance.integers(rows)), int(chance.integers(columns))),
    )
    costs[start] = costs[goal] = 1.0
    found, expected = search(costs, start, goal), dijkstra(costs, start, goal)
    if found is None:
        assert math.isinf(expected)
        return
    assert found.cost == pytest.approx(expected, rel=1e-6)
    assert tuple(found.cells[0]) == start
    assert tuple(found.cells[-1]) == goal
    assert np.abs(np.diff(found.cells, axis=0)).max(initial=1) == 1
    assert np.isfinite(costs[tuple(found.cells.T)]).all()


@given(st.integers(0, 10_000))
def test_a_smoothed_path_never_touches_an_obstacle(seed: int) -> None:
    """In rooms with random boxes the path keeps the radius from each obstacle's cell, to half a cell."""
    chance = np.random.default_rng(seed)
    boxes = [
        box(*chance.uniform(0.5, 5.0, 2), *chance.uniform(0.1, 1.0, 2), chance.uniform(0, 3))
        for _ in range(6)
    ]
    walls = np.vstack([box(0, 0, 6, 6), *boxes])
    grid = rasterised(walls, 6, 6)
    made = costmap(ROUND, grid, 0.3)
    free = np.argwhere(np.isfinite(made.costs))
    first, last = free[chance.integers(len(free), size=2)]
    start, goal = made.frame.center(*first), made.frame.center(*last)
    found = plan(ROUND, made, Pose2D(*start, 1.0), Goal(*goal))
    if isinstance(found, NoPath):
        assert math.isinf(dijkstra(made.costs, tuple(first), tuple(last)))
        return
    occupied = (np.argwhere(grid.percent > 0)[:, ::-1] + 0.5) * 0.05
    apart = np.hypot(*(found.points_m[:, None] - occupied[None]).transpose(2, 0, 1))
    assert apart.min() >= RADIUS_M - 0.025
    assert found.points_m[0] == pytest.approx(start)
    assert found.points_m[-1] == pytest.approx(goal)


def test_a_path_keeps_away_from_walls_where_there_is_room() -> None:
    """From one end of a hall along its wall to the other, round a pillar: 0.1 m and more between outline and walls."""
    walls = np.vstack([box(0, 0, 8.0, 4.0), box(3.1, 1.2, 0.7, 0.9, 0.4)])
    made = costmap(ROUND, rasterised(walls, 8.0, 4.0), 0.3)
    found = plan(ROUND, made, Pose2D(0.6, 1.6, 0.3), Goal(7.3, 1.9))
    assert isinstance(found, Path)
    assert min(segment_distance_m(walls, *point) for point in found.points_m) >= RADIUS_M + 0.10


@pytest.mark.parametrize("turn_rad", [0.0, 0.37, math.pi / 4, 1.2])
@pytest.mark.parametrize("shift_m", [0.0, 0.013, 0.025, 0.041])
def test_a_door_10_cm_wider_than_the_robot_is_passed(turn_rad: float, shift_m: float) -> None:
    """Whatever the wall's angle to the grid and wherever it begins in a cell; in the middle of the door to 3 cm."""
    half, cos, sin = (2 * RADIUS_M + 0.10) / 2, math.cos(turn_rad), math.sin(turn_rad)
    middle = np.array([3.0 + shift_m, 3.0 - shift_m / 2])
    along = np.array([cos, sin])
    ends = [middle + s * along for s in (-3.5, -half, half, 3.5)]
    walls = np.vstack([wall(tuple(ends[0]), tuple(ends[1])), wall(tuple(ends[2]), tuple(ends[3]))])
    made = costmap(ROUND, rasterised(walls, 6, 6), 0.3)
    across = np.array([-sin, cos])
    start, goal = middle - 1.1 * across + 0.4 * along, middle + 1.0 * across - 0.5 * along
    found = plan(ROUND, made, Pose2D(*start, 0.2), Goal(*goal))
    assert isinstance(found, Path)
    assert found.length_m < 2.6
    passing = found.points_m[np.argmin(np.abs((found.points_m - middle) @ across))]
    assert abs((passing - middle) @ along) < 0.03


def test_a_door_narrower_than_the_robot_is_not() -> None:
    """0.30 m are not enough for 0.36 m, and the reason says so."""
    walls = np.vstack([box(0, 0, 4, 3), wall((2, 0), (2, 1.3)), wall((2, 1.6), (2, 3))])
    found = plan(ROUND, costmap(ROUND, rasterised(walls, 4, 3), 0.3), Pose2D(0.7, 1.0), Goal(3.2, 1.9))
    assert isinstance(found, NoPath)
    assert found.reason.startswith("there is no way to (3.20, 1.90) that is wide enough for the robot; ")
    assert found.nearest.x_m < 1.95


def test_an_oblong_robot_does_not_take_a_bend_that_only_its_width_fits_through() -> None:
    """A corridor 0.5 m wide with a right angle: a robot of 0.9 by 0.3 m gets stuck, one of 0.36 by 0.3 m does not."""
    walls = np.vstack(
        [wall((0, 1), (2.5, 1), (2.5, 3.5)), wall((0, 1.5), (2.0, 1.5), (2.0, 3.5)), wall((0, 1), (0, 1.5))]
    )
    grid, start, goal = rasterised(walls, 3.5, 3.5), Pose2D(0.6, 1.25), Goal(2.25, 3.2, math.pi / 2)
    short = Footprint(corners_m=((0.18, 0.15), (-0.18, 0.15), (-0.18, -0.15), (0.18, -0.15)))
    long = Footprint(corners_m=((0.45, 0.15), (-0.45, 0.15), (-0.45, -0.15), (0.45, -0.15)))
    assert isinstance(plan(short, costmap(short, grid, 0.3), start, goal), Path)
    assert isinstance(plan(long, costmap(long, grid, 0.3), start, goal), NoPath)


FLAT = costmap(ROUND, rasterised(furnished_flat(), 10.4, 8.1), 0.3)
KITCHEN = Pose2D(2.0, 2.4, 0.3)


@pytest.mark.parametrize(
    ("goal", "told"),
    [
        (Goal(4.3, 0.5), "inside an obstacle"),
        (Goal(4.15, 0.5), "m from an obstacle, and the robot needs 0.18 m"),
        (Goal(20.0, 0.5), "outside of the map"),
    ],
)
def test_a_goal_where_the_robot_cannot_be_is_refused(goal: Goal, told: str) -> None:
    """The reason says why, and the pose that is offered instead is reached."""
    found = plan(ROUND, FLAT, KITCHEN, goal)
    assert isinstance(found, NoPath)
    assert told in found.reason
    assert found.nearest is not None
    offered = Goal(found.nearest.x_m, found.nearest.y_m)
    assert isinstance(plan(ROUND, FLAT, KITCHEN, offered), Path)


@pytest.mark.parametrize(("tolerance_m", "room_m"), [(0.0, 0.12), (0.12, 0.02), (0.4, 0.12)])
def test_what_is_offered_has_room_for_guards_where_that_is_near(tolerance_m: float, room_m: float) -> None:
    """In a wall at x = 3: facing it at 0 m, a guard would stop the robot short; 0.12 m, but what is tolerated first."""
    grid = rasterised(box(0.0, 0.0, 3.0, 2.0), 3.2, 2.2)
    costs = costmap(ROUND, grid, 0.3)
    found = plan(ROUND, costs, Pose2D(0.8, 0.9, 0.4), Goal(2.92, 1.1, tolerance_m=tolerance_m))
    x_m = found.nearest.x_m if isinstance(found, NoPath) else found.goal.x_m
    assert isinstance(found, NoPath) is (tolerance_m == 0.0)
    assert 3.0 - RADIUS_M - x_m == pytest.approx(room_m, abs=0.03)


def test_a_goal_in_unknown_space_is_refused_unless_configured() -> None:
    """The nearest known place is offered; where unknown space is avoided only, it is driven."""
    grid = drawn(*["." * 30 + "?" * 10] * 30)
    start, goal = Pose2D(0.4, 0.7), Goal(1.78, 0.71)
    refused = plan(ROUND, costmap(ROUND, grid, 0.3), start, goal)
    assert isinstance(refused, NoPath)
    assert "is in unknown space" in refused.reason
    assert (refused.nearest.x_m, refused.nearest.y_m) == pytest.approx((1.475, 0.725))
    avoided = costmap(ROUND, grid, 0.3, unknown_space=UnknownSpace.AVOIDED)
    assert isinstance(plan(ROUND, avoided, start, goal), Path)


def test_a_goal_is_substituted_only_within_its_tolerance() -> None:
    """0.1 m from a wall the robot is 0.08 m off: refused with 0.05 m, and with 0.15 m driven to what is offered."""
    assert isinstance(plan(ROUND, FLAT, KITCHEN, Goal(4.2, 2.5, 0.7, 0.05)), NoPath)
    found = plan(ROUND, FLAT, KITCHEN, Goal(4.2, 2.5, 0.7, 0.15))
    assert isinstance(found, Path)
    assert found.is_substitute
    end = found.in_map()[-1]
    assert math.hypot(end[0] - 4.2, end[1] - 2.5) <= 0.15
    assert found.goal.heading_rad == pytest.approx(0.7)


def test_a_robot_that_stands_too_near_to_a_wall_finds_its_way_out() -> None:
    """0.15 m from a wall, where its radius is 0.18 m: the path leads away from it."""
    found = plan(ROUND, FLAT, Pose2D(4.14, 2.6), Goal(2.0, 2.4))
    assert isinstance(found, Path)
    assert found.points_m[4, 0] < 4.0


def test_a_robot_in_a_zone_to_be_kept_out_of_is_told_so_and_nothing_is_offered() -> None:
    """Somebody drew it over the robot: a place that it cannot get to is no offer, and goals by themselves are free."""
    rug = Zones.model_validate(
        {"keep_out": [{"corners_m": [[1.4, 1.8], [2.6, 1.8], [2.6, 3.0], [1.4, 3.0]]}]}
    )
    costs = costmap(ROUND, rasterised(furnished_flat(), 10.4, 8.1), 0.3, rug)
    for goal in (Goal(9.2, 5.6), Goal(4.3, 0.5)):
        found = plan(ROUND, costs, KITCHEN, goal)
        assert isinstance(found, NoPath)
        assert "the robot itself is in an obstacle or a keep-out zone, at (2.00, 2.40)" in found.reason
        assert found.nearest is None


def test_what_is_offered_is_on_the_robots_side_of_a_wall() -> None:
    """A robot 0.15 m from a wall, whose nearest free cell may be beyond it: the offer has a path."""
    room = rasterised(np.vstack([box(0, 0, 6, 6), wall((3.0, 0.0), (3.0, 6.0))]), 6, 6)
    costs = costmap(ROUND, room, 0.3)
    for x_m in (2.9, 3.1):
        start = Pose2D(x_m, 2.0, 0.4)
        found = plan(ROUND, costs, start, Goal(3.0, 2.1))
        assert isinstance(found, NoPath)
        assert found.nearest is not None
        assert (found.nearest.x_m > 3.0) is (x_m > 3.0)


def test_a_map_whose_origin_is_turned_gives_the_same_path() -> None:
    """Turned by 0.6 rad and shifted, the path lies where it lay, in the map's frame turned along."""
    grid, origin = rasterised(furnished_flat(), 10.4, 8.1), Pose2D(-3.0, 2.0, 0.6)
    turned = costmap(ROUND, OccupancyGrid(0.05, origin, grid.percent), 0.3)
    start, goal = Pose2D(2.0, 2.4, 0.3), Pose2D(9.2, 5.6, 0.0)
    plain = plan(ROUND, FLAT, start, Goal(goal.x_m, goal.y_m))
    there = origin.compose(goal)
    found = plan(ROUND, turned, origin.compose(start), Goal(there.x_m, there.y_m))
    assert isinstance(found, Path)
    assert isinstance(plain, Path)
    assert found.length_m == pytest.approx(plain.length_m, rel=1e-3)
    expected = [origin.compose(Pose2D(x, y)) for x, y in plain.in_map()]
    assert found.in_map() == pytest.approx(np.array([(p.x_m, p.y_m) for p in expected]), abs=0.05)
