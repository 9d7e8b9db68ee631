"""What a depth camera sees in the costs: what a lidar's beams pass above or below stays there."""

import numpy as np

from chefbotd.components.navigation.algorithms.interface import Seen
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.components.zones.zone_file import NO_ZONES
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import box
from tests.chefbotd.components.navigation.algorithms.drives import ROUND
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

HERE = Pose2D(1.0, 3.0, 0.3)
EYE = np.array([0.12, 0.0])
EDGE = np.column_stack([np.full(9, 1.4), np.linspace(-0.2, 0.2, 9)])
"""The front edge of a table's top, 1.4 m ahead."""

WALL = np.column_stack([np.full(81, 3.1), np.linspace(-1.0, 1.0, 81)])


def after(*, images: int, points_m: np.ndarray = EDGE, scans: int = 0) -> WorldModel:
    """A robot at (1, 3) in a hall of 8 by 6 m, after so many images of the camera and scans of the wall by the lidar."""
    world = WorldModel(ROUND, rasterised(box(0, 0, 8.0, 6.0), 8.0, 6.0), NO_ZONES)
    for k in range(max(images, scans)):
        if k < images:
            world.take_low_scan(Seen(0.1 * k, HERE, EYE, points_m))
        if k < scans:
            world.add_scan(Seen(0.1 * k + 0.05, HERE, np.array([0.05, 0.0]), WALL))
    return world


def cost(world: WorldModel, now_s: float, ahead_m: float) -> float:
    """Of the cell so far ahead."""
    there = HERE.compose(Pose2D(ahead_m, 0.0))
    costs = world.costs(now_s)
    cell = costs.frame.cell(there.x_m, there.y_m)
    assert cell is not None
    return float(costs.costs[cell])


def test_a_tables_top_is_in_the_costs_though_the_lidar_sees_beneath_it() -> None:
    """Seen for 3 s while the lidar's beams passed below: blocked 1.4 m ahead, for four times as long; free behind."""
    world = after(images=30, scans=30)
    assert cost(world, 3.0, 1.4) == float("inf")
    assert cost(world, 14.0, 1.4) == float("inf")
    assert np.isfinite(cost(world, 15.0, 1.4))
    assert np.isfinite(cost(world, 3.0, 2.4))
    assert len(world.obstacles(3.0)) > 5


def test_the_cameras_own_beams_clear_what_it_saw() -> None:
    """The table was taken away, and the camera sees the sideboard behind it."""
    world, behind = after(images=30), np.column_stack([np.full(61, 2.6), np.linspace(-0.6, 0.6, 61)])
    assert cost(world, 3.0, 1.4) == float("inf")
    for k in range(30, 34):
        world.take_low_scan(Seen(0.1 * k, HERE, EYE, behind))
    assert np.isfinite(cost(world, 3.4, 1.4))


def test_it_is_driven_round_also_where_the_camera_does_not_look_any_more() -> None:
    """The robot has turned its back: the edge is among the points that it drives by."""
    world = after(images=30, scans=30)
    behind = world.surroundings(Pose2D(1.9, 3.2, 2.8), 3.1)
    edge = HERE.compose(Pose2D(1.4, 0.0))
    seen_from_there = Pose2D(1.9, 3.2, 2.8).inverse().compose(edge)
    apart_m = np.hypot(*(behind.points_m - [seen_from_there.x_m, seen_from_there.y_m]).T)
    assert apart_m.min() < 0.06
