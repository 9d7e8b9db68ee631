"""The growing map put together, the robot in it between two scans, and the way from point to point."""

import base64
import math
import zlib

import numpy as np
import pytest

from chefbotd.cli.maps.against_truth import wall_errors
from chefbotd.cli.maps.demo import ROOMS
from chefbotd.cli.maps.live import LiveMap, MapTracker
from chefbotd.cli.maps.route import (
    CRUISE_M_S,
    DECELERATION_M_S2,
    TURN_RAD_S,
    is_reached,
    length_m,
    seen_from,
    velocity_to,
)
from chefbotd.client.errors import ProtocolError
from chefbotd.client.models import MapData, MapPoseData, OdometryData
from chefbotd.core.geometry import Pose2D
from chefbotd.mapping.occupancy_grid import OccupancyGrid
from chefbotd.sim.scene import of_solids
from chefbotd.sim.worlds.building import SLICE_M
from chefbotd.sim.worlds.flat import FLAT


def part(
    revision: int,
    cells: list[list[int]],
    /,
    *,
    whole: bool = False,
    at: tuple[int, int] = (0, 0),
    **changed: object,
) -> MapData:
    """What the topic tells of a grid of 3 by 4 cells."""
    array = np.array(cells, np.int8)
    fields: dict[str, object] = {
        "revision": revision,
        "resolution_m": 0.05,
        "x_m": -1.0,
        "y_m": 2.0,
        "heading_rad": 0.0,
        "columns": 4,
        "rows": 3,
        "row": at[0],
        "column": at[1],
        "part_rows": array.shape[0],
        "part_columns": array.shape[1],
        "whole": whole,
        "cells": base64.b64encode(zlib.compress(array.tobytes())).decode(),
    }
    return MapData.model_validate(fields | changed)


FIRST = part(5, [[-1, -1, -1, -1], [-1, 0, 0, -1], [-1, 100, 100, -1]], whole=True)


def test_parts_are_put_where_they_belong() -> None:
    """A whole one, then two changed cells in the third row from below."""
    live = LiveMap()
    assert not live.take_part(part(4, [[7]], at=(1, 1))), "nothing is known yet"
    assert live.take_part(FIRST)
    assert live.take_part(part(6, [[55, 66]], at=(2, 2)))
    assert live.grid is not None
    assert live.grid.percent.tolist() == [[-1, -1, -1, -1], [-1, 0, 0, -1], [-1, 100, 55, 66]]
    assert live.grid.map_from_grid == Pose2D(-1.0, 2.0, 0.0)


def test_after_a_gap_a_whole_one_is_waited_for() -> None:
    """A part that does not follow the last is left out, also the ones behind it."""
    live = LiveMap()
    live.take_part(FIRST)
    assert not live.take_part(part(7, [[1]]))
    assert not live.take_part(part(8, [[1]]))
    assert live.take_part(part(9, [[2, 2], [2, 2]], whole=True, rows=2, columns=2))
    assert live.take_part(part(10, [[3]], at=(1, 0)))
    assert live.grid is not None
    assert live.grid.percent.tolist() == [[2, 2], [3, 2]]


@pytest.mark.parametrize(
    "wrong",
    [{"cells": "!"}, {"cells": "AAAA"}, {"part_rows": 2}, {"part_columns": 40_000, "part_rows": 40_000}],
)
def test_a_part_that_is_not_what_it_says_is_an_error(wrong: dict[str, object]) -> None:
    """Text that cannot be unpacked, or other cells than were told."""
    with pytest.raises(ProtocolError):
        LiveMap().take_part(part(1, [[1, 2, 3]], whole=True, **wrong))


def test_a_part_beyond_the_map_is_an_error() -> None:
    """It would be drawn nowhere."""
    live = LiveMap()
    live.take_part(FIRST)
    with pytest.raises(ProtocolError, match="outside"):
        live.take_part(part(6, [[1, 2]], at=(2, 3)))


def odometry(x_m: float, y_m: float, heading_rad: float) -> OdometryData:
    """Where it is by its wheels."""
    return OdometryData(
        x_m=x_m, y_m=y_m, heading_rad=heading_rad, linear_m_s=0.0, angular_rad_s=0.0, covariance=(0.0,) * 9
    )


def test_between_scans_odometry_moves_the_robot_on() -> None:
    """A scan at 1.0 s found it at (3, 2, 90 deg); half a metre ahead by odometry it is at (3, 2.5)."""
    tracker = MapTracker()
    assert tracker.pose is None
    tracker.take_odometry(0.9, odometry(0.0, 0.0, 0.0))
    tracker.take_odometry(1.0, odometry(1.0, 0.0, 0.0))
    tracker.take_odometry(1.2, odometry(1.2, 0.0, 0.0))
    found = MapPoseData(
        x_m=3.0, y_m=2.0, heading_rad=math.pi / 2, covariance=(0.0,) * 9, fit=1.0, state="mapping"
    )
    tracker.take_map_pose(1.0, found)
    tracker.take_odometry(1.5, odometry(1.5, 0.0, 0.0))
    assert tracker.pose is not None
    assert (tracker.pose.x_m, tracker.pose.y_m) == pytest.approx((3.0, 2.5))


def test_the_way_to_a_point() -> None:
    """Straight ahead at full speed; beside it, turning first; backwards, turning on the spot, the shorter way."""
    ahead = velocity_to(Pose2D(), (2.0, 0.0), (4.0, 0.0))
    assert (ahead.linear_m_s, ahead.angular_rad_s) == (CRUISE_M_S, 0.0)
    beside = velocity_to(Pose2D(heading_rad=0.1), (0.0, -1.0), None)
    assert (beside.linear_m_s, beside.angular_rad_s) == (0.0, -TURN_RAD_S)
    behind = velocity_to(Pose2D(1.0, 1.0, 3.0), (2.0, 1.1), None)
    assert (behind.linear_m_s, behind.angular_rad_s) == (0.0, -TURN_RAD_S)
    gentle = velocity_to(Pose2D(), (1.0, 0.1), None)
    assert 0 < gentle.angular_rad_s < TURN_RAD_S
    assert gentle.linear_m_s > 0.9 * CRUISE_M_S


def test_it_slows_down_for_a_corner_and_not_for_a_straight() -> None:
    """0.1 m before a point with a right angle behind it: no more than brakes within that way."""
    corner = velocity_to(Pose2D(), (0.1, 0.0), (0.1, 3.0))
    assert corner.linear_m_s == pytest.approx(math.sqrt(2 * DECELERATION_M_S2 * 0.1))
    assert velocity_to(Pose2D(), (0.1, 0.0), (3.0, 0.0)).linear_m_s == CRUISE_M_S


def test_a_route_in_the_map_of_a_robot_that_began_somewhere() -> None:
    """From (2, 1) looking left, the point (1, 3) is 2 m ahead and 1 m to the left; lengths stay what they are."""
    (point,) = seen_from(Pose2D(2.0, 1.0, math.pi / 2), [(1.0, 3.0)])
    assert point == pytest.approx((2.0, 1.0))
    assert length_m(Pose2D(), [(3.0, 4.0), (3.0, 5.0)]) == 6.0
    assert is_reached(Pose2D(0.05, 0.05), (0.0, 0.0))
    assert not is_reached(Pose2D(0.2, 0.0), (0.0, 0.0))


def test_the_demos_way_is_free_and_visits_four_rooms() -> None:
    """No wall and no furniture is nearer to it than the robot's radius; both loops of the plan are in it."""
    edges = of_solids(FLAT.solids).slice(SLICE_M)[0]
    start, nearest = (FLAT.start.x_m, FLAT.start.y_m), math.inf
    for a, b in zip([start, *ROOMS], ROOMS, strict=False):
        for share in np.linspace(0.0, 1.0, 40):
            x, y = a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share
            along = edges[:, 2:] - edges[:, :2]
            part_ = np.clip(
                ((np.array([x, y]) - edges[:, :2]) * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1
            )
            off = np.array([x, y]) - edges[:, :2] - part_[:, None] * along
            nearest = min(nearest, float(np.hypot(off[:, 0], off[:, 1]).min()))
    assert nearest > 0.2
    visited = {
        name for name, spot in FLAT.rooms.items() if min(math.dist(spot, point) for point in ROOMS) < 1.0
    }
    assert len(visited) >= 5


def test_walls_are_held_against_the_truth() -> None:
    """Three cells of a wall at x = 1.025, seen by a robot that began at (1, 0, 90 deg), against a wall at y = 1.05."""
    percent = np.full((4, 30), -1, np.int8)
    percent[0:3, 20] = 100
    grid = OccupancyGrid(0.05, Pose2D(0.0, -0.1, 0.0), percent)
    found = wall_errors(grid, Pose2D(1.0, 0.0, math.pi / 2), np.array([[-5.0, 1.05, 5.0, 1.05]]))
    assert found.cells == 3
    assert found.median_m == pytest.approx(0.025)
    with pytest.raises(ValueError, match="no cell"):
        wall_errors(OccupancyGrid(0.05, Pose2D(), np.zeros((3, 3), np.int8)), Pose2D(), np.ones((1, 4)))
