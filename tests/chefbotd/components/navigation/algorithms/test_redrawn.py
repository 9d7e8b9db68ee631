"""A map that is redrawn while it is navigated on: what was seen since is remembered."""

import numpy as np

from chefbotd.components.navigation.algorithms.interface import Seen
from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.components.navigation.algorithms.removed import carried_over, find_things
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.components.zones.zone_file import NO_ZONES
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import box
from tests.chefbotd.components.navigation.algorithms.drives import ROUND
from tests.chefbotd.components.navigation.algorithms.grids import rasterised
from tests.chefbotd.components.navigation.algorithms.guarded import Guarded

HALL = box(0, 0, 8.0, 4.0)
POSE = Pose2D(2.0, 2.0)
CHAIR = np.stack([np.full(20, 1.5), np.linspace(-0.2, 0.2, 20)], axis=1)
"""Something 1.5 m before the robot that is on no map."""


def test_what_was_seen_of_things_that_are_on_no_map_stays_when_the_map_is_redrawn() -> None:
    """A chair before the robot: a wall that is drawn elsewhere closes its cells, and the chair is where it was."""
    grid = rasterised(HALL, 8.0, 4.0)
    world = WorldModel(ROUND, grid, NO_ZONES)
    for k in range(10):
        world.add_scan(Seen(1.0 + 0.1 * k, POSE, np.zeros(2), CHAIR))
    before = world.obstacles(2.0)
    assert len(before)
    closed = np.zeros(grid.percent.shape, np.bool_)
    closed[:, 120] = True
    world.redraw(grid, NO_ZONES, closed)
    assert np.array_equal(world.obstacles(2.0), before)
    assert np.isinf(world.ground.costs[40, 120])
    assert not world.ground.walls[40, 120]
    world.redraw(grid, NO_ZONES, None)
    assert np.isfinite(world.ground.costs[40, 120])


def test_a_drawn_wall_that_the_lidar_sees_through_is_never_taken_for_gone() -> None:
    """It lies across the hall, and nothing is there: no goal behind it is reached, and none is looked after."""
    grid = rasterised(HALL, 8.0, 4.0)
    drive = Guarded(grid, HALL, Pose2D(1.5, 2.0), has_sonar=False)
    closed = np.zeros(grid.percent.shape, np.bool_)
    closed[:, 80] = True
    drive.navigator.redraw_map(grid, NO_ZONES, closed)
    drive.navigator.navigate_to((Goal(6.0, 2.0, 0.0),))
    drive.run(30.0)
    assert drive.ended[-1].end is End.UNREACHABLE
    assert drive.pose.x_m < 4.0


def test_what_was_seen_of_a_thing_is_carried_over_where_it_is_drawn_as_before() -> None:
    """One of two cupboards is gone; the other one is erased, and a third is new."""
    kept, erased, new = box(2.0, 1.7, 0.6, 0.6), box(4.0, 1.7, 0.6, 0.6), box(6.0, 1.7, 0.6, 0.6)
    before_grid = rasterised(np.vstack([HALL, kept, erased]), 8.0, 4.0)
    after_grid = rasterised(np.vstack([HALL, kept, new]), 8.0, 4.0)
    frame = WorldModel(ROUND, before_grid, NO_ZONES).frame
    before = find_things(before_grid.percent >= 65, frame)
    gone = before.centers_m[:, 0] < 3.0
    before.passes[:] = 7
    after, is_gone = carried_over(before, gone, find_things(after_grid.percent >= 65, frame))
    assert is_gone.tolist() == (after.centers_m[:, 0] < 3.0).tolist()
    assert is_gone.sum() == 1
    of_kept = is_gone[after.thing]
    assert (after.passes[of_kept] == 7).all()
    assert not after.passes[~of_kept].any()
