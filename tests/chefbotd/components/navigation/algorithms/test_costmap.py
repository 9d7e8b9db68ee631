"""Distances, inflation, zones and unknown space."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chefbotd.components.navigation.algorithms.costmap import between_cells, costmap, with_obstacles
from chefbotd.components.navigation.algorithms.grid import distances_m
from chefbotd.components.navigation.algorithms.outline import Footprint, clearance_m
from chefbotd.components.navigation.algorithms.states import UnknownSpace
from chefbotd.components.zones.zone_file import Zones, parse_zones
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.navigation.algorithms.grids import drawn

ROUND = Footprint(radius_m=0.18)
EMPTY = drawn(*["." * 30] * 20)


def test_a_distance_is_that_between_the_middles_of_cells() -> None:
    """Three cells aside and four up are five cells, of 0.05 m each."""
    obstacles = np.zeros((9, 11), np.bool_)
    obstacles[2, 7] = True
    assert distances_m(obstacles, 0.05)[6, 4] == pytest.approx(0.25)


def test_without_obstacles_every_distance_is_infinite() -> None:
    """There is nothing that could be near."""
    assert np.isinf(distances_m(np.zeros((4, 3), np.bool_), 0.05)).all()


@given(st.integers(0, 10_000), st.integers(1, 17), st.integers(1, 23))
def test_distances_are_exact(seed: int, rows: int, columns: int) -> None:
    """On any small grid they are those to the nearest of all obstacles, one by one."""
    obstacles = np.random.default_rng(seed).random((rows, columns)) < 0.1
    found = distances_m(obstacles, 0.1)
    there = np.argwhere(obstacles)
    for row, column in np.ndindex(rows, columns):
        apart = np.hypot(*(there - [row, column]).T)
        nearest = 0.1 * apart.min() if len(there) else math.inf
        assert found[row, column] == pytest.approx(nearest, abs=1e-6)


def test_the_cost_falls_with_the_square_of_the_room() -> None:
    """Half way between the inner radius 0.2 and the comfort 0.4 beyond it: 1 + 4 x (1/2)^2 = 2; with no room 3 more."""
    wall = drawn("#" + "." * 30)
    costs = costmap(Footprint(radius_m=0.2), wall, 0.3, comfort_m=0.4).costs[0]
    assert math.isinf(costs[3])  # 0.15 m
    assert costs[4] == pytest.approx(8.0)  # 0.20 m
    assert costs[5] == pytest.approx(1 + 4 * 0.875**2 + 3 * (7 / 12) ** 2)  # 0.25 m
    assert costs[8] == pytest.approx(2.0)  # 0.40 m
    assert costs[12] == 1.0  # 0.60 m
    assert costs[30] == 1.0


@pytest.mark.parametrize(
    ("unknown", "cost"),
    [(UnknownSpace.BLOCKED, math.inf), (UnknownSpace.AVOIDED, 6.0), (UnknownSpace.FREE, 1.0)],
)
def test_unknown_space_is_worth_what_was_configured(unknown: UnknownSpace, cost: float) -> None:
    """Blocked, dearer by 5, or like free space."""
    assert costmap(ROUND, drawn("..??.."), 0.3, unknown_space=unknown).costs[0, 2] == cost


def test_a_keep_out_zone_is_an_obstacle_with_the_robots_radius_about_it() -> None:
    """In a map that is turned by 90 degrees, the triangle lies where its corners are in the map, not in the grid."""
    turned = drawn(*["." * 40] * 20, origin=Pose2D(2.0, 1.0, math.pi / 2))
    zones = Zones.model_validate(
        {"keep_out": [{"name": "stairs", "corners_m": [[1.0, 2.5], [1.5, 2.5], [1.5, 3.0]]}]}
    )
    made = costmap(ROUND, turned, 0.3, zones)
    inside, outside = made.frame.to_grid(np.array([[1.4, 2.6], [1.1, 2.9]]))
    assert made.distance_m[made.frame.cell(*inside)] == 0.0
    assert made.distance_m[made.frame.cell(*outside)] > 0.1
    beside = made.frame.to_grid(np.array([[1.6, 2.6]]))[0]
    assert math.isinf(made.costs[made.frame.cell(*beside)])  # 0.1 m from it


def test_a_slow_zone_costs_the_time_that_it_takes() -> None:
    """At 0.1 instead of 0.3 m/s a cell takes three times as long; beside the zone nothing changes."""
    zones = Zones.model_validate(
        {"slow": [{"corners_m": [[0.5, 0.2], [1.0, 0.2], [1.0, 0.7], [0.5, 0.7]], "max_speed_m_s": 0.1}]}
    )
    made = costmap(ROUND, EMPTY, 0.3, zones)
    assert made.costs[made.frame.cell(0.6, 0.5)] == pytest.approx(3.0)
    assert made.speed_limit_m_s[made.frame.cell(0.6, 0.5)] == 0.1
    assert made.costs[made.frame.cell(0.4, 0.5)] == 1.0


def test_what_was_seen_is_kept_away_from_as_an_obstacle_of_the_map_with_a_margin() -> None:
    """A point in the middle of a cell: costs as of an obstacle, but blocked to 0.22 m instead of 0.1675 m."""
    rows = ["." * 40] * 30
    rows[11] = "." * 13 + "#" + "." * 26
    ground = costmap(ROUND, drawn(*["." * 40] * 30), 0.3)
    live = with_obstacles(ground, np.array([[0.675, 0.925]]))
    on_map = costmap(ROUND, drawn(*rows), 0.3)
    near = on_map.distance_m < 0.45
    assert live.distance_m[near] == pytest.approx(on_map.distance_m[near], abs=1e-6)
    free = np.isfinite(live.costs)
    assert np.allclose(live.costs[free], on_map.costs[free], rtol=1e-5)
    assert on_map.distance_m[~free].max() < 0.22 <= on_map.distance_m[free].min() + 1e-6
    assert np.isfinite(ground.costs).all()


def test_a_point_is_not_rounded_to_its_cell() -> None:
    """At the edge of a cell, 0.02 m from its middle: the next cells are 0.03 and 0.07 m away."""
    live = with_obstacles(costmap(ROUND, EMPTY, 0.3), np.array([[0.545, 0.525]]))
    assert live.distance_m[10, 10] == 0.0
    assert (live.distance_m[10, 11], live.distance_m[10, 9]) == pytest.approx((0.03, 0.07))


def test_between_the_middles_of_cells_values_are_linear() -> None:
    """A quarter of a cell from one middle to the next is a quarter of the way between their values."""
    values = np.array([[1.0, 3.0], [5.0, 7.0]], np.float32)
    assert between_cells(values, 0.1, 0.075, 0.05) == pytest.approx(1.5)
    assert between_cells(values, 0.1, 0.075, 0.075) == pytest.approx(2.5)
    assert between_cells(values, 0.1, 9.0, 9.0) == 7.0


def test_the_clearance_from_an_oblique_polygon() -> None:
    """A trapezium, longer in front than behind: beside, off a corner, inside."""
    outline = Footprint(corners_m=((0.3, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.3, -0.1)))
    assert clearance_m(outline.hull, outline.pad_m, 0.1, 0.25) == pytest.approx(0.15)
    assert clearance_m(outline.hull, outline.pad_m, 0.33, 0.14) == pytest.approx(0.05)
    assert clearance_m(outline.hull, outline.pad_m, 0.02, 0.03) == pytest.approx(-0.07)
    assert (outline.inner_radius_m, outline.outer_radius_m) == pytest.approx((0.1, math.hypot(0.3, 0.1)))


def test_a_circle_has_one_radius() -> None:
    """The inner and the outer one."""
    assert (ROUND.inner_radius_m, ROUND.outer_radius_m) == pytest.approx((0.18, 0.18))


@pytest.mark.parametrize(
    "wrong",
    [
        {},
        {"radius_m": 0.2, "corners_m": ((0.3, 0.1), (-0.1, 0.1), (-0.1, -0.1))},
        {"corners_m": ((0.3, 0.1), (-0.1, 0.1))},
        {"corners_m": ((0.3, 0.1), (0.1, 0.1), (0.1, -0.1))},
    ],
)
def test_an_outline_is_one_shape_about_the_origin(wrong: dict[str, object]) -> None:
    """None, two, a line, and a shape beside the origin are refused."""
    with pytest.raises(ValueError, match=r"radius_m|corners_m"):
        Footprint(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "text", ["keep_out: [", "keep_out: 3", "slow: [{corners_m: [[0, 0], [1, 0], [1, 1]]}]"]
)
def test_a_file_of_zones_that_is_wrong_is_named(text: str) -> None:
    """Its name is in the message."""
    with pytest.raises(ValueError, match=r"zones\.yaml"):
        parse_zones(text, "zones.yaml")


def test_an_empty_file_holds_no_zones() -> None:
    """So a map without zones needs no special file."""
    assert parse_zones("", "zones.yaml") == Zones()
