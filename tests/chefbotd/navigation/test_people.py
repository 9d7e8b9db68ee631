"""What people cost a path."""

import numpy as np
import pytest

from chefbotd.core.geometry import Pose2D
from chefbotd.navigation.awareness import Awareness
from chefbotd.navigation.costmap import Costmap
from chefbotd.navigation.path import Goal, Path
from chefbotd.navigation.planner import plan
from chefbotd.navigation.reports import Seen
from chefbotd.navigation.zones import NO_ZONES
from tests.chefbotd.mapping.slam.flat import Floats, box, wall
from tests.chefbotd.navigation.drives import ROUND
from tests.chefbotd.navigation.grids import rasterised, segment_distance_m

ARC = np.stack([0.2 * np.cos(np.linspace(2, 4, 12)), 0.2 * np.sin(np.linspace(2, 4, 12))], axis=1)
HERE = Pose2D(1.0, 3.0, 0.2)


HALL = box(0, 0, 8.0, 6.0)


def costs_after(
    walked_s: float, stood_s: float, vx: float, vy: float, x_m: float, y_m: float, walls: Floats = HALL
) -> Costmap:
    """The costs for a robot at (1, 3) in a hall of 8 by 6 m, after somebody walked and stood there."""
    known = Awareness(ROUND, rasterised(walls, 8.0, 6.0), NO_ZONES)
    scans = round((walked_s + stood_s) * 10)
    for k in range(scans + 1):
        along_s = min(0.1 * k, walked_s) - walked_s
        points = ARC + np.array([x_m + vx * along_s, y_m + vy * along_s])
        known.take_scan(Seen(0.1 * k, Pose2D(), np.array([1.0, 3.0]), points))
    return known.costs(0.1 * scans, HERE)


def cost(costs: Costmap, x_m: float, y_m: float) -> float:
    """Of the cell at a place."""
    cell = costs.frame.cell(x_m, y_m)
    assert cell is not None
    return float(costs.costs[cell])


def test_a_path_is_dear_where_somebody_will_be_when_the_robot_comes_and_not_where_he_is_now() -> None:
    """He is at (4, 3.1), and walks at 0.5 m/s towards the robot: they meet after 3 m / 0.8 m/s, at x = 2.1 m."""
    costs = costs_after(5.0, 0.0, -0.5, 0.0, 4.0, 3.1)
    assert cost(costs, 2.1, 3.1) == pytest.approx(4.0, abs=0.1)
    assert cost(costs, 4.0, 3.1) == 1.0
    assert cost(costs, 2.1, 4.2) == 1.0
    assert np.isfinite(costs.costs[20:80, 20:100]).all()


def test_who_stands_for_a_moment_closes_no_way_and_who_stands_for_long_does() -> None:
    """1.2 m ahead; after 10 s he is furniture."""
    assert cost(costs_after(2.0, 3.0, 0.4, 0.1, 2.2, 3.1), 2.1, 3.1) == pytest.approx(4.0, abs=0.1)
    assert cost(costs_after(2.0, 11.0, 0.4, 0.1, 2.2, 3.1), 2.1, 3.1) == float("inf")


def test_nothing_is_remembered_of_who_walked_by() -> None:
    """Where he was a second ago is free at once, though no beam has passed it since."""
    costs = costs_after(5.0, 0.0, -0.5, 0.0, 5.0, 3.0)
    assert cost(costs, 5.6, 3.0) == 1.0


def test_a_chair_is_planned_round_also_while_somebody_stands_at_it() -> None:
    """Seen for 14 s, then he comes and stands beside it: together they look like one thing that walks."""
    known = Awareness(ROUND, rasterised(HALL, 8.0, 6.0), NO_ZONES)
    chair = np.array([(2.6, y) for y in np.arange(2.8, 3.2, 0.04)])
    for k in range(180):
        person = ARC + np.array([2.9, 3.2 + 0.4 * max(14.0 - 0.1 * k, 0.0)])
        known.take_scan(Seen(0.1 * k, Pose2D(), np.array([1.0, 3.0]), np.vstack([chair, person])))
    assert cost(known.costs(17.9, HERE), 2.62, 2.9) == float("inf")


@pytest.mark.parametrize(("vy", "y_m"), [(0.1, 3.1), (-0.1, 3.0), (0.0, 3.2)])
def test_nobody_in_a_doorway_moves_the_path_to_its_post(vy: float, y_m: float) -> None:
    """A door of 0.91 m leaves 0.27 m on either side of the robot: there are 0.10 m also while somebody comes through."""
    walls = np.vstack([HALL, wall((1.8, 0.0), (1.8, 2.62)), wall((1.8, 3.53), (1.8, 6.0))])
    path = plan(ROUND.outline, costs_after(3.0, 0.0, -0.4, vy, 2.6, y_m, walls), HERE, Goal(4.0, 2.2))
    assert isinstance(path, Path)
    assert min(segment_distance_m(walls, *point) for point in path.points_m.tolist()) - 0.18 >= 0.10
