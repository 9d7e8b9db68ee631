"""What a leg was worth: by hand, in an empty room with a wall across it."""

import math

import numpy as np
import pytest

from chefbotd.components.simulation.world import World
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from examples.legs import Best, Truth, ended_leg

ORIGIN = Pose2D(-1.0, -2.0)


def room() -> OccupancyGrid:
    """6 by 4 m in cells of 5 cm from (-1, -2): a wall at x = 2 m from the bottom up to y = 1 m, 0.1 m thick."""
    percent = np.full((80, 120), FREE, np.int8)
    percent[0], percent[-1], percent[:, 0], percent[:, -1] = OCCUPIED, OCCUPIED, OCCUPIED, OCCUPIED
    percent[:60, 60:62] = OCCUPIED
    return OccupancyGrid(0.05, ORIGIN, percent)


def test_the_shortest_way_goes_round_the_wall_at_the_robots_radius() -> None:
    """From (0.5, 0) to (3.6, 0) the string goes over the wall's end, 0.2 m from it: two tangents and an arc.

    By hand: the corners lie at (2, 1) and (2.1, 1); tangents from (0.5, 0) and (3.6, 0), arcs of 0.2 m.
    """
    best = Best(room(), [], 0.2)
    tangent_m = math.sqrt(1.5**2 + 1.0 - 0.2**2)
    bearing = math.atan2(1.0, 1.5) + math.asin(0.2 / math.hypot(1.5, 1.0))
    by_hand_m = 2 * tangent_m + 0.1 + 2 * 0.2 * bearing
    assert best.length_m(Pose2D(0.5, 0.0), Pose2D(3.6, 0.0)) == pytest.approx(by_hand_m, rel=0.04)
    assert best.length_m(Pose2D(0.5, 0.0), Pose2D(1.1, 0.8)) == pytest.approx(1.0, abs=1e-3)


def test_a_thing_that_closes_the_way_leaves_none() -> None:
    """Between the wall's end at y = 1 m and the room's at 2 m there is a chair of 0.4 m."""
    best = Best(room(), [(2.05, 1.5, 0.4)], 0.2)
    assert best.length_m(Pose2D(0.5, 0.0), Pose2D(3.6, 0.0)) == math.inf


def test_a_leg_is_held_against_the_truth() -> None:
    """An oblique way of 0.5 + 0.6 m past somebody; 3 cm and 0.1 rad off at its end; 0.30 m/s, 1.2 rad/s at best."""
    truth = Truth(World([(3.0, -9.0, 3.0, 9.0)]), radius_m=0.18)
    truth.add_pose(Pose2D(9.0, 9.0), (), in_contact=True)
    start, goal = Pose2D(0.0, 0.0, 0.2), Pose2D(0.3, 1.03, 1.6)
    truth.add_pose(start, (), in_contact=False)
    truth.begin_leg()
    truth.add_pose(Pose2D(0.3, 0.4, 0.9), ((0.9, 0.4, 0.25),), in_contact=False)
    truth.add_pose(Pose2D(0.3, 1.0, 1.5), ((1.9, 0.4, 0.25),), in_contact=False)
    leg = ended_leg("table 1", start, goal, ("reached", "reached"), 6.0, truth, Best(room(), [], 0.18))
    assert leg.length_m == pytest.approx(1.1)
    assert leg.closest_m == pytest.approx(0.6 - 0.25 - 0.18)
    assert (leg.off_m, leg.off_rad) == (pytest.approx(0.03), pytest.approx(0.1))
    assert leg.shortest_m == pytest.approx(math.hypot(0.3, 1.03), rel=0.03)
    bearing = math.atan2(1.03, 0.3)
    turns_s = (bearing - 0.2 + 1.6 - bearing) / 1.2
    assert leg.ideal_s == pytest.approx(leg.shortest_m / 0.30 + turns_s)
    assert leg.failure is None


def test_a_leg_fails_that_was_not_reached_or_touched_something() -> None:
    """Each says why."""
    truth = Truth(World([(3.0, -9.0, 3.0, 9.0)]), radius_m=0.18)
    truth.add_pose(Pose2D(0.5, 0.0), (), in_contact=True)
    best, here = Best(room(), [], 0.18), Pose2D(0.5, 0.0)
    blocked = ended_leg("table 2", here, here, ("blocked", "blocked for 60 s"), 60.0, truth, best)
    assert blocked.failure == "table 2: blocked for 60 s"
    touched = ended_leg("table 2", here, here, ("reached", "reached"), 2.0, truth, best)
    assert touched.failure == "table 2: it touched something"


def test_who_walks_up_to_a_standing_robot_is_not_its_closest_approach_but_a_touch_counts() -> None:
    """0.3 m from the wall by its own motion; then somebody comes to 0.05 m, and the robot backs off towards the wall."""
    truth = Truth(World([(3.0, -9.0, 3.0, 9.0)]), radius_m=0.18)
    truth.add_pose(Pose2D(2.4, 0.1), (), in_contact=False)
    truth.add_pose(Pose2D(2.52, 0.1), ((1.5, 0.1, 0.25),), in_contact=False)
    truth.add_pose(Pose2D(2.52, 0.1), ((2.52 - 0.48, 0.1, 0.25),), in_contact=False)
    assert truth.closest_m == pytest.approx(0.3)
    assert truth.closest_of_all_m == pytest.approx(0.05)
    truth.add_pose(Pose2D(2.50, 0.1), ((2.52 - 0.48, 0.1, 0.25),), in_contact=False)
    assert truth.closest_m == pytest.approx(0.03)
    assert not truth.touched
    truth.add_pose(Pose2D(2.50, 0.1), ((2.52 - 0.48, 0.1, 0.25),), in_contact=True)
    assert truth.touched
