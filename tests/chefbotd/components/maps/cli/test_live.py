"""The growing map put together, and the robot in it between two scans."""

import base64
import math
import zlib

import numpy as np
import pytest
from msgspec import convert

from chefbotd.client.errors import ProtocolError
from chefbotd.client.models import MapData, MapPoseData, OdometryData
from chefbotd.components.maps.cli.live_view import MapTracker, ReceivedMap
from chefbotd.core.geometry import Pose2D


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
    return convert(fields | changed, MapData)


FIRST = part(5, [[-1, -1, -1, -1], [-1, 0, 0, -1], [-1, 100, 100, -1]], whole=True)


def test_parts_are_put_where_they_belong() -> None:
    """A whole one, then two changed cells in the third row from below."""
    live = ReceivedMap()
    assert not live.take_part(part(4, [[7]], at=(1, 1))), "nothing is known yet"
    assert live.take_part(FIRST)
    assert live.take_part(part(6, [[55, 66]], at=(2, 2)))
    assert live.grid is not None
    assert live.grid.percent.tolist() == [[-1, -1, -1, -1], [-1, 0, 0, -1], [-1, 100, 55, 66]]
    assert live.grid.map_from_grid == Pose2D(-1.0, 2.0, 0.0)


def test_after_a_gap_a_whole_one_is_waited_for() -> None:
    """A part that does not follow the last is left out, also the ones behind it."""
    live = ReceivedMap()
    live.take_part(FIRST)
    assert not live.take_part(part(7, [[1]]))
    assert not live.take_part(part(8, [[1]]))
    assert live.take_part(part(9, [[2, 2], [2, 2]], whole=True, rows=2, columns=2))
    assert live.take_part(part(10, [[3]], at=(1, 0), rows=2, columns=2))
    assert live.grid is not None
    assert live.grid.percent.tolist() == [[2, 2], [3, 2]]


@pytest.mark.parametrize(
    "wrong",
    [{"cells": "!"}, {"cells": "AAAA"}, {"part_rows": 2}, {"part_columns": 40_000, "part_rows": 40_000}],
)
def test_a_part_that_is_not_what_it_says_is_an_error(wrong: dict[str, object]) -> None:
    """Text that cannot be unpacked, or other cells than were told."""
    with pytest.raises(ProtocolError):
        ReceivedMap().take_part(part(1, [[1, 2, 3]], whole=True, **wrong))


def test_a_part_beyond_the_map_is_an_error() -> None:
    """It would be drawn nowhere."""
    live = ReceivedMap()
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
