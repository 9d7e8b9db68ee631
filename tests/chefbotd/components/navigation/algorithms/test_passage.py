"""What is 6 cm wider than the robot is passed; what is narrower is measured by the lidar, and ends a goal."""

import math
import re

import numpy as np
import pytest

from benchmarks.situations import squeezed
from chefbotd.components.navigation.algorithms.grid import Floats, GridFrame
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.passage import (
    LEAST_CENTRED,
    LEAST_MEASURED,
    Passages,
    measured_passages,
    place_to_close,
)
from chefbotd.components.navigation.algorithms.path import Goal, Path
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import replace

ROUND = Footprint(radius_m=0.18)


def sides(width_m: float, noise_m: float = 0.008, seed: int = 1) -> Floats:
    """A corridor from x = 2.2 m on, its middle at y = 2.01, its walls seen with noise."""
    chance = np.random.default_rng(seed)
    x = np.arange(2.2, 2.9, 0.01)
    points = np.vstack([np.stack([x, np.full_like(x, 2.01 + side * width_m / 2)], 1) for side in (-1, 1)])
    points[:, 1] += chance.normal(0, noise_m, len(points))
    return points


AHEAD = Path(
    GridFrame(0.05, Pose2D(), 100, 100),
    np.stack([np.linspace(2.0, 3.0, 21), np.full(21, 2.01)], axis=1),
    np.zeros(21),
    Goal(3.0, 2.01),
)


def scanned(width_m: float, count: int) -> Passages:
    """What is known of the corridor after so many scans."""
    passages = Passages()
    for seed in range(count):
        passages.add_scan(ROUND, sides(width_m, seed=seed), AHEAD, 0.1 * seed)
    return passages


@pytest.mark.parametrize("width_m", [0.38, 0.40, 0.41])
def test_a_passage_that_is_too_narrow_is_measured_within_three_millimetres(width_m: float) -> None:
    """The robot is 0.36 m wide and needs 6 cm more; one point has a noise of 8 mm, and scans are averaged."""
    passage = scanned(width_m, LEAST_MEASURED).too_narrow(AHEAD)
    assert passage is not None
    assert passage.width_m == pytest.approx(width_m, abs=0.003)
    assert passage.middle.y_m == pytest.approx(2.01, abs=0.005)
    assert passage.needed_m == pytest.approx(0.42)


@pytest.mark.parametrize("width_m", [0.42, 0.43, 0.5])
def test_what_is_six_centimetres_wider_than_the_robot_is_wide_enough(width_m: float) -> None:
    """However often it is measured."""
    assert scanned(width_m, 60).too_narrow(AHEAD) is None


def test_a_passage_is_not_known_before_enough_scans_have_measured_it() -> None:
    """One scan may be off by a centimetre; and the same scan, looked at again, is still one."""
    few = LEAST_MEASURED // 2 - 1  # two neighbouring steps may be of one place
    assert scanned(0.40, few).too_narrow(AHEAD) is None
    passages = Passages()
    for _ in range(2 * LEAST_MEASURED):
        passages.add_scan(ROUND, sides(0.40), AHEAD, 1.0)
    assert passages.too_narrow(AHEAD) is None


def test_the_path_is_moved_to_the_middle_of_a_tight_passage_and_no_other() -> None:
    """The middle is at y = 2.01; the path of the map leads past it, 2 cm to the right."""
    beside = replace(AHEAD, points_m=AHEAD.points_m - [0.0, 0.02])
    tight, wide = Passages(), Passages()
    for seed in range(LEAST_CENTRED):
        tight.add_scan(ROUND, sides(0.43, seed=seed), beside, 0.1 * seed)
        wide.add_scan(ROUND, sides(0.6, seed=seed), beside, 0.1 * seed)
    points = tight.centred(beside)
    assert points is not None
    assert points[:, 1] == pytest.approx(2.01, abs=0.003)
    assert points[:, 0] == pytest.approx(beside.points_m[:, 0])
    assert wide.centred(beside) is None


def test_what_is_closed_of_a_passage_is_so_far_from_the_robot_that_it_does_not_stand_in_it() -> None:
    """The path begins at x = 2.0; a passage 0.8 m ahead is closed where it is, a nearer one 0.5 m ahead."""
    assert place_to_close(AHEAD, Pose2D(2.8, 2.0), 0.5).tolist() == pytest.approx([2.8, 2.01])
    assert place_to_close(AHEAD, Pose2D(2.1, 2.0), 0.48).tolist() == pytest.approx([2.5, 2.01])
    assert place_to_close(AHEAD, Pose2D(2.1, 2.0), 3.0).tolist() == pytest.approx([3.0, 2.01])


def test_a_wall_on_one_side_is_no_passage() -> None:
    """The other side is open."""
    walls = sides(0.4)
    assert measured_passages(ROUND, walls[walls[:, 1] > 2.0], Pose2D(2.25, 2.0)) == []


def test_a_wall_ahead_is_no_passage() -> None:
    """0.2 m ahead, from left to right."""
    y = np.arange(-0.4, 0.4, 0.01)
    assert measured_passages(ROUND, np.stack([np.full_like(y, 0.2), y], 1), Pose2D()) == []


ANGLES_DEG = (0, 15, 30, 45)
PLACES = ("corridor", "door")


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_what_is_six_centimetres_wider_than_the_robot_is_passed_steadily(place: str, angle_deg: int) -> None:
    """With 1.5 cm to the walls or more, without turning about: 4 m in 40 s, and no more than 2 radians of turning."""
    run = squeezed(1, 0.06, is_door=place == "door", turned_rad=math.radians(angle_deg))
    assert run.end is End.REACHED, run.reason
    assert run.time_s < 40.0
    assert run.turned_rad < 2.0
    assert run.least_m > 0.015


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2, 4])
def test_a_goal_in_a_corridor_six_centimetres_wider_is_reached_without_turning_about(seed: int) -> None:
    """The walls beside it are the trouble: it does not turn round to back in; 2 m in 40 s."""
    run = squeezed(seed, 0.06)
    assert run.end is End.REACHED, run.reason
    assert run.time_s < 40.0
    assert run.turned_rad < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_what_is_five_centimetres_wider_ends_the_goal_with_its_width(place: str, angle_deg: int) -> None:
    """The map's cells of 5 cm do not show it: it is measured on the way, and the robot does not enter it."""
    run = squeezed(1, 0.05, is_door=place == "door", turned_rad=math.radians(angle_deg))
    assert run.end in {End.BLOCKED, End.UNREACHABLE}, run.reason
    assert run.time_s < 30.0
    if run.end is End.BLOCKED:
        told = re.search(r"the passage at \(.*\) is (.*) m wide, and the robot needs 0.42 m", run.reason)
        assert told, run.reason
        assert float(told[1]) == pytest.approx(0.41, abs=0.01)


def test_a_goal_in_a_corridor_seven_centimetres_wider_is_no_goal_too_near_to_a_wall() -> None:
    """Its walls are beside the robot, and not ahead of it."""
    for seed in (0, 2, 4):  # the walls lie elsewhere in the map's cells
        assert squeezed(seed, 0.07, within_s=0.2).end is None
