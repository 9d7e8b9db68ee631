"""What every planner promises, and that of docs/adding_a_planner.md drives a robot although nothing knows it."""

import functools
import re
import types
from pathlib import Path

import numpy as np
import pytest

from chefbotd.components.navigation.algorithms import path as paths
from chefbotd.components.navigation.algorithms.costmap import Costmap
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.path import SPACING_M, Goal, NoPath, Planner
from chefbotd.components.navigation.algorithms.planner import plan
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.core.geometry import Pose2D
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box
from tests.chefbotd.components.navigation.algorithms.drives import Drive
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

HALL = box(0, 0, 7.0, 3.0)
GRID = rasterised(HALL, 7.0, 3.0)
START, GOAL = Pose2D(0.8, 1.0, 0.3), Goal(6.0, 1.0)
VIA_M = (3.4, 2.2)


PAGE = Path(__file__).parents[5] / "docs" / "adding_a_planner.md"


@functools.cache
def page() -> str:
    """Its text."""
    if not PAGE.exists():
        pytest.skip("the documentation is not part of an installed package")
    return PAGE.read_text(encoding="utf-8")


@functools.cache
def shown() -> Planner:
    """The planner of the page, which nothing in the package knows."""
    (code,) = re.findall(r"```python\n(.*?)```", page(), re.DOTALL)
    module = types.ModuleType("page")
    exec(compile(code, str(PAGE), "exec"), vars(module))
    return module.plan  # type: ignore[no-any-return]


def plan_by_the_window(outline: Footprint, costs: Costmap, start: Pose2D, goal: Goal) -> paths.Path | NoPath:
    """The page's planner, looked up when it is first called."""
    return shown()(outline, costs, start, goal)


def away_m(points: Floats, place: tuple[float, float]) -> float:
    """How near any of the points comes to a place."""
    return float(np.hypot(*(points - np.array(place)).T).min())


@pytest.mark.parametrize("planner", [plan, plan_by_the_window])
def test_a_path_begins_at_the_pose_and_ends_at_the_goal(planner: Planner) -> None:
    """Its points are 5 cm apart, measured along it."""
    drive = Drive(GRID, HALL, START, planner=planner)
    path = drive.navigator.plan_path(START, GOAL, 0.0)
    assert isinstance(path, paths.Path)
    points = path.in_map()
    assert points[0] == pytest.approx([0.8, 1.0])
    assert points[-1] == pytest.approx([6.0, 1.0])
    steps_m = np.hypot(*np.diff(points, axis=0).T)
    assert steps_m.max() <= SPACING_M + 1e-6
    assert (
        steps_m.min() >= 0.9 * SPACING_M
    )  # a bend of 50 degrees cuts its corner: 0.05 cos(25 degrees) is 0.0454
    assert len(path.heading_rad) == len(points)


def test_the_robot_drives_where_its_planner_leads() -> None:
    """By the window, 1.2 m beside the straight line; by the usual planner it never comes within 0.8 m of that place."""
    nearest_m = []
    for planner in (plan, plan_by_the_window):
        drive = Drive(GRID, HALL, START, planner=planner)
        drive.navigator.navigate_to((GOAL,))
        drive.run(60.0)
        assert [ended.end for ended in drive.ended] == [End.REACHED]
        nearest_m.append(away_m(np.array([(at.x_m, at.y_m) for at in drive.passed]), VIA_M))
    assert nearest_m[0] > 0.8
    assert nearest_m[1] < 0.25


def test_what_a_planner_says_ends_the_goal() -> None:
    """A pillar on the map beside the window: the goal ends with that planner's reason."""
    walls = np.vstack([HALL, box(3.2, 2.0, 3.6, 2.4)])
    drive = Drive(rasterised(walls, 7.0, 3.0), walls, START, planner=plan_by_the_window)
    drive.navigator.navigate_to((GOAL,))
    drive.run(5.0)
    assert [(ended.end, ended.reason) for ended in drive.ended] == [
        (End.UNREACHABLE, "unreachable: the way by the window is blocked")
    ]


def test_the_page_names_four_files_at_most() -> None:
    """All are there but those that are to be written."""
    named = re.findall(r"^\| `((?:chefbotd|tests)/[^`]+)` \|", page(), re.MULTILINE)
    assert 0 < len(named) <= 4
    there = [name for name in named if "your_planner" not in name]
    assert [name for name in there if not (PAGE.parents[1] / name).is_file()] == []
