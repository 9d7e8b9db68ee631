"""Who moves, and how fast, from scan to scan; what people cost a path."""

import math

import numpy as np
import pytest

from chefbotd.components.navigation.algorithms.costmap import Costmap
from chefbotd.components.navigation.algorithms.interface import Seen
from chefbotd.components.navigation.algorithms.movers import displace_movers, track
from chefbotd.components.navigation.algorithms.path import Goal, Path
from chefbotd.components.navigation.algorithms.planner import plan
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.components.zones.zone_file import NO_ZONES
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box, wall
from tests.chefbotd.components.navigation.algorithms.drives import ROUND
from tests.chefbotd.components.navigation.algorithms.grids import rasterised, segment_distance_m

ARC = np.stack([0.2 * np.cos(np.linspace(2, 4, 12)), 0.2 * np.sin(np.linspace(2, 4, 12))], axis=1)
CHAIR = np.array([[3.0, 1.0], [3.1, 1.05], [3.2, 1.1]])
NOISE = np.random.default_rng(3)


def walked(vx: float, vy: float, scans: int, *, noise_m: float = 0.01) -> np.ndarray:
    """The velocities of the last of some scans, ten a second: somebody who walks, then a chair."""
    movers: tuple[object, ...] = ()
    velocities = np.zeros((0, 2))
    for k in range(scans):
        person = ARC + np.array([1.0 + 0.1 * k * vx, -1.0 + 0.1 * k * vy])
        points = np.vstack([person, CHAIR])
        done = track(movers, 5.0 + 0.1 * k, points + NOISE.normal(0, noise_m, points.shape))
        movers, velocities = done.movers, done.velocity_m_s
    return velocities


def test_somebody_who_walks_has_his_velocity_and_a_chair_has_none() -> None:
    """0.5 m/s to the left and a little back, within 0.1 m/s, in spite of a centimetre of noise; the chair stands."""
    velocities = walked(-0.2, 0.46, 8)
    assert velocities[: len(ARC)] == pytest.approx(np.tile([-0.2, 0.46], (len(ARC), 1)), abs=0.1)
    assert not velocities[len(ARC) :].any()


@pytest.mark.parametrize("begins", [0, 3, 6, 9])
def test_who_walks_where_a_turn_begins_and_ends_is_one_person(begins: int) -> None:
    """Some of his points are the turn's first ones, the others its last: at each scan he has the velocity of before."""
    movers: tuple[object, ...] = ()
    for k in range(16):
        person = ARC + np.array([1.0 + 0.05 * k, -1.0])
        first = begins if k >= 10 else 0
        done = track(movers, 0.1 * k, np.vstack([person[first:], CHAIR, person[:first]]))
        movers = done.movers
        if k >= 10:
            velocity = np.delete(done.velocity_m_s, np.s_[len(ARC) - first : len(ARC) - first + 3], axis=0)
            assert velocity == pytest.approx(np.tile([0.5, 0.0], (len(ARC), 1)), abs=0.01)


def test_a_moment_is_not_enough_to_say_that_somebody_walks() -> None:
    """Three scans are 0.2 s: nothing yet; after five there is."""
    assert not walked(0.5, 0.0, 3).any()
    assert walked(0.5, 0.0, 5)[: len(ARC)].any()


@pytest.mark.parametrize("radius_m", [0.15, 0.25])
def test_the_velocity_of_somebody_who_walks_past_does_not_turn_towards_the_sensor(radius_m: float) -> None:
    """Of a round person a lidar at the origin sees the near half, and each time another one: he walks straight on."""
    movers: tuple[object, ...] = ()
    for k in range(24):
        x_m, y_m = -1.4 + 0.1 * k, 0.55
        middle, away_m = math.atan2(y_m, x_m), math.hypot(x_m, y_m)
        half = math.acos(radius_m / away_m)  # from the nearest point to where the outer beams touch him
        around = middle + math.pi + np.linspace(-half, half, 25)
        seen = np.array([x_m, y_m]) + radius_m * np.stack([np.cos(around), np.sin(around)], axis=1)
        done = track(movers, 0.1 * k, seen, np.zeros_like(seen))
        movers = done.movers
        if k >= 12:
            assert done.velocity_m_s == pytest.approx(np.tile([1.0, 0.0], (25, 1)), abs=0.01)


def test_who_stands_for_half_a_second_has_stopped() -> None:
    """His velocity is that of the last half second, not of all his way."""
    movers: tuple[object, ...] = ()
    for k in range(16):
        along_m = 0.06 * min(k, 8)
        done = track(movers, 0.1 * k, ARC + np.array([1.0 + along_m, 0.0]))
        movers = done.movers
    assert not done.velocity_m_s.any()


def test_no_points_are_nobody_and_what_is_wide_does_not_walk() -> None:
    """A wall's middle moves with what is seen of it."""
    assert track((), 1.0, np.zeros((0, 2))).velocity_m_s.shape == (0, 2)
    movers: tuple[object, ...] = ()
    for k in range(8):
        wall = np.stack([np.linspace(0.2 * k, 2.0 + 0.2 * k, 30), np.full(30, 2.0)], axis=1)
        done = track(movers, 0.1 * k, wall)
        movers = done.movers
    assert math.isclose(float(np.abs(done.velocity_m_s).max()), 0.0)


def test_who_went_half_a_metre_is_a_walker_for_ten_seconds_after_his_last_step() -> None:
    """At 0.5 m/s that is after 1.1 s; he stands from 2 s on. What is seen of a chair shifts by 0.3 m, and is none."""
    movers: tuple[object, ...] = ()
    seen = {}
    for k in range(140):
        person = ARC + np.array([1.0 + 0.05 * min(k, 20), 0.0])
        chair = CHAIR + np.array([0.0, 0.04 * min(k, 7)])
        done = track(movers, 0.1 * k, np.vstack([person, chair]))
        movers, seen[k] = done.movers, done.is_walker
    assert not seen[9].any()
    assert seen[12][: len(ARC)].all()
    assert seen[110][: len(ARC)].all()
    assert not seen[130].any()
    assert not any(flags[len(ARC) :].any() for flags in seen.values())


@pytest.mark.parametrize("gap_s", [0.5, 1.0, 1.4])
def test_who_was_not_seen_for_a_moment_walks_on(gap_s: float) -> None:
    """A walker at -0.4 m/s and 0.3 m/s that no scan shows for a while has his velocity at the first scan after it."""
    movers: tuple[object, ...] = ()
    times = [0.1 * k for k in range(20)] + [1.9 + gap_s]
    for now_s in times:
        done = track(movers, now_s, ARC + np.array([1.0 - 0.4 * now_s, 0.3 * now_s]))
        movers = done.movers
    assert done.velocity_m_s == pytest.approx(np.tile([-0.4, 0.3], (len(ARC), 1)), abs=0.02)
    assert done.is_walker.all()


def test_a_pose_that_jumps_gives_nobody_another_velocity() -> None:
    """All that is seen jumps by 0.2 m: he walks on as before, and the chair stands."""
    movers: tuple[object, ...] = ()
    for k in range(26):
        if k == 20:
            movers = displace_movers(movers)
        jump = np.array([0.2, 0.05]) if k >= 20 else 0.0
        person = ARC + np.array([1.0 + 0.03 * k, -1.0])
        done = track(movers, 0.1 * k, np.vstack([person, CHAIR]) + jump)
        movers = done.movers
        if k >= 10:
            velocity = done.velocity_m_s
            assert velocity[: len(ARC)] == pytest.approx(np.tile([0.3, 0.0], (len(ARC), 1)), abs=0.01)
            assert not velocity[len(ARC) :].any()


PERSON = np.stack([0.2 * np.cos(np.linspace(2, 4, 12)), 0.2 * np.sin(np.linspace(2, 4, 12))], axis=1)
HERE = Pose2D(1.0, 3.0, 0.2)


HALL = box(0, 0, 8.0, 6.0)


def costs_after(
    walked_s: float, stood_s: float, vx: float, vy: float, x_m: float, y_m: float, walls: Floats = HALL
) -> Costmap:
    """The costs for a robot at (1, 3) in a hall of 8 by 6 m, after somebody walked and stood there."""
    world = WorldModel(ROUND, rasterised(walls, 8.0, 6.0), NO_ZONES)
    scans = round((walked_s + stood_s) * 10)
    for k in range(scans + 1):
        along_s = min(0.1 * k, walked_s) - walked_s
        points = PERSON + np.array([x_m + vx * along_s, y_m + vy * along_s])
        world.add_scan(Seen(0.1 * k, Pose2D(), np.array([1.0, 3.0]), points))
    return world.costs(0.1 * scans, HERE)


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
    world = WorldModel(ROUND, rasterised(HALL, 8.0, 6.0), NO_ZONES)
    chair = np.array([(2.6, y) for y in np.arange(2.8, 3.2, 0.04)])
    for k in range(180):
        person = PERSON + np.array([2.9, 3.2 + 0.4 * max(14.0 - 0.1 * k, 0.0)])
        world.add_scan(Seen(0.1 * k, Pose2D(), np.array([1.0, 3.0]), np.vstack([chair, person])))
    assert cost(world.costs(17.9, HERE), 2.62, 2.9) == float("inf")


@pytest.mark.parametrize(("vy", "y_m"), [(0.1, 3.1), (-0.1, 3.0), (0.0, 3.2)])
def test_nobody_in_a_doorway_moves_the_path_to_its_post(vy: float, y_m: float) -> None:
    """A door of 0.91 m leaves 0.27 m on either side of the robot: there are 0.10 m also while somebody comes through."""
    walls = np.vstack([HALL, wall((1.8, 0.0), (1.8, 2.62)), wall((1.8, 3.53), (1.8, 6.0))])
    path = plan(ROUND.outline, costs_after(3.0, 0.0, -0.4, vy, 2.6, y_m, walls), HERE, Goal(4.0, 2.2))
    assert isinstance(path, Path)
    assert min(segment_distance_m(walls, *point) for point in path.points_m.tolist()) - 0.18 >= 0.10
