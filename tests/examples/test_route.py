"""The way from point to point, and that of the demonstration of mapping."""

import math

import numpy as np
import pytest

from chefbotd.components.simulation.scene import of_solids
from chefbotd.components.simulation.worlds.building import SLICE_M
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.core.geometry import Pose2D
from examples.map_demo import ROOMS
from examples.route import (
    CRUISE_M_S,
    DECELERATION_M_S2,
    TURN_RAD_S,
    is_reached,
    length_m,
    seen_from,
    velocity_to,
)


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
