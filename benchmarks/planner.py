"""The global planner: optimal on Moving AI's maps, its time to an A* in C++, and that of plans in a room and a hotel.

Times are processor time of this process; compiling is done before. A plan is all of it: search, smoothing, check.
"""

import ctypes
import importlib
import math
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from benchmarks.astar import SEARCHES, CompiledSearches, built_library, missing_packages
from benchmarks.figures import Figure, Outcome, percentile
from benchmarks.movingai import Scenario, scenarios
from chefbotd.components.maps.algorithms.map_server import parse_description, parse_image
from chefbotd.components.navigation.algorithms.costmap import Costmap, costmap
from chefbotd.components.navigation.algorithms.grid import Singles
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.path import Goal, NoPath
from chefbotd.components.navigation.algorithms.planner import plan
from chefbotd.components.navigation.algorithms.search import prepare_costs, search
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from tests.chefbotd.components.mapping.algorithms.slam.flat import furnished_flat
from tests.chefbotd.components.navigation.algorithms.grids import rasterised

FOLDER = Path(__file__).parents[2] / "shared" / "data" / "movingai"
ROOM_MS, HOTEL_MS, SIX_DIGITS = 2.0, 5.0, 6e-6
CLASSIC = {"room": "NavFn 1.4 to 2.2, pyastar2d 0.13", "hotel1": "pyastar2d 0.45"}
PLANS, QUICK_PLANS, QUICK_PROBLEMS, ROUNDS = 200, 30, 10, 3
RANDOM_CELLS, BLOCKED_SHARE, SEED = 512, 0.35, 1
OPEN_RATIO, BLOCKED_RATIO = 0.6, 0.9
OUTLINE = Footprint(radius_m=0.18)


def run(*, quick: bool = False, folder: Path = FOLDER) -> Outcome:
    """A flat's plans, those on maps in the folder beside (``maps``), and every scenario of the folder."""
    plans = QUICK_PLANS if quick else PLANS
    figures = list(_plans("room", rasterised(furnished_flat(), 10.4, 8.1), plans, ROOM_MS))
    remarks, faults = list[str](), list[str]()
    for path in sorted((folder.parent / "maps").glob("*.yaml")):
        figures += _plans(path.stem, _map(path), plans, HOTEL_MS if path.stem == "hotel1" else None)
    found = list(scenarios(folder)) if folder.is_dir() else []
    reference, told = _reference()
    remarks.append(told)
    for scenario in found:
        figures += _scenario(scenario, reference, faults, quick=quick)
    if not found:
        remarks.append(f"skipped Moving AI's maps: none in {folder}")
    if (missing := missing_packages()) is not None:
        remarks.append(f"no ratio to an A* in C++: apt-get install {missing}")
    else:
        with built_library() as library:
            for name, (costs, target) in random_maps().items():
                figures += _random_map(name, costs, target, library, faults, quick=quick)
    return Outcome(tuple(figures), tuple(remarks), tuple(faults))


def _map(path: Path) -> OccupancyGrid:
    description = parse_description(path.read_text(encoding="utf-8"), path.name)
    return parse_image((path.parent / description.image).read_bytes(), description)


def _plans(name: str, grid: OccupancyGrid, count: int, target_ms: float | None) -> Iterable[Figure]:
    """Plans between random cells of the largest part of a map."""
    costs = costmap(OUTLINE, grid, 0.3)
    parts, _ = ndimage.label(np.isfinite(costs.costs))
    cells = np.argwhere(parts == np.argmax(np.bincount(parts.ravel())[1:]) + 1)
    chance, seconds, missed = np.random.default_rng(1), list[float](), 0
    for _ in range(count):
        first, last = (_center(costs, cell) for cell in cells[chance.integers(len(cells), size=2)])
        goal = Goal(last.x_m, last.y_m)
        spent_s, found = _timed(lambda a=first, b=goal: plan(OUTLINE, costs, a, b))
        seconds.append(spent_s)
        missed += isinstance(found, NoPath)
    unit, classic = "ms", CLASSIC.get(name, "")
    yield Figure(f"{name}, a plan, median", 1e3 * percentile(seconds, 50), unit, target_ms, classic)
    yield Figure(f"{name}, a plan, p95", 1e3 * percentile(seconds, 95), unit)
    yield Figure(f"{name}, not solved of {count}", missed, "", 0)


def _center(costs: Costmap, cell: Any) -> Pose2D:
    return costs.frame.pose_to_map(Pose2D(*costs.frame.center(int(cell[0]), int(cell[1]))))


Reference = Callable[[Any, tuple[int, int], tuple[int, int]], Any]


def _reference() -> tuple[Reference | None, str]:
    """What is compared with, where it is installed; it is no dependency."""
    try:
        library = importlib.import_module("pyastar2d")
    except ImportError:
        return None, "no ratio to pyastar2d: it is not installed"
    return (
        lambda weights, start, goal: library.astar_path(weights, start, goal, allow_diagonal=True),
        "pyastar2d cuts corners, which our rules forbid: it expands somewhat fewer cells",
    )


def _scenario(
    scenario: Scenario, reference: Reference | None, faults: list[str], *, quick: bool
) -> Iterable[Figure]:
    """Every problem of a map: solved, and as long as it is published to be."""
    costs = np.where(scenario.free, 1, np.inf).astype(np.float32)
    problems = scenario.problems[:: max(len(scenario.problems) // QUICK_PROBLEMS, 1) if quick else 1]
    ours, theirs = list[float](), list[float]()
    for problem in problems:
        spent_s, found = _timed(lambda p=problem: search(costs, p.start, p.goal))
        ours.append(spent_s)
        expected = problem.length if problem.length > 0 or problem.start == problem.goal else math.inf
        length = math.inf if found is None else found.cost
        if length != expected and not abs(length - expected) <= SIX_DIGITS * max(expected, 1.0):
            faults.append(f"{scenario.name}: {problem.start} to {problem.goal} is {length}, not {expected}")
        if reference is not None:
            theirs.append(_timed(lambda p=problem: reference(costs, p.start, p.goal))[0])
    name = f"{scenario.name}, {len(problems)} optimal paths"
    yield Figure(f"{name}, median", 1e3 * percentile(ours, 50), "ms")
    if theirs:
        yield Figure(f"{scenario.name}, time to pyastar2d's, all", sum(ours) / sum(theirs), "x")


def random_maps() -> dict[str, tuple[Singles, float]]:
    """Costs by seed, and the most that ours may take of a C++ A*'s time: open and a third blocked, even and uneven."""
    chance, size = np.random.default_rng(SEED), (RANDOM_CELLS, RANDOM_CELLS)
    costs = {"costs of 1": np.ones(size), "costs of 1 to 9": chance.uniform(1.0, 9.0, size)}
    blocked = chance.random(size) < BLOCKED_SHARE
    return {
        f"{kind}, {name}": (np.where(closed, np.inf, values).astype(np.float32), target)
        for kind, closed, target in (("open", False, OPEN_RATIO), ("35 % obstacles", blocked, BLOCKED_RATIO))
        for name, values in costs.items()
    }


def _random_map(
    name: str, costs: Singles, target: float, library: ctypes.CDLL, faults: list[str], *, quick: bool
) -> Iterable[Figure]:
    """Paths between random places of the largest part, by each search in turn; all must be as long."""
    grid, others = prepare_costs(costs), CompiledSearches(library, costs)
    parts, _ = ndimage.label(np.isfinite(costs))
    cells = np.argwhere(parts == np.argmax(np.bincount(parts.ravel())[1:]) + 1)
    chance, count = np.random.default_rng(SEED), QUICK_PLANS if quick else PLANS
    ours, theirs = list[float](), {search_name: list[float]() for search_name in SEARCHES}
    for _ in range(count):
        start, goal = (tuple(int(i) for i in cells[k]) for k in chance.integers(len(cells), size=2))
        spent_s, path = _timed(lambda a=start, b=goal: grid.find_path(a, b))
        ours.append(spent_s)
        for search_name, spent in theirs.items():
            spent_s, cost = _timed(lambda n=search_name, a=start, b=goal: others.cost(n, a, b))
            spent.append(spent_s)
            if path is None or abs(path.cost - cost) > SIX_DIGITS * max(cost, 1.0):
                faults.append(f"{name}: {start} to {goal} is {path and path.cost}, by {search_name} {cost}")
    others.close()
    yield Figure(f"{name}, {count} paths, median", 1e3 * percentile(ours, 50), "ms")
    for search_name, spent in theirs.items():
        yield Figure(f"{name}, time to {search_name}, all", sum(ours) / sum(spent), "x", target)


def _timed(action: Callable[[], Any]) -> tuple[float, Any]:
    """The least processor time of a few rounds, and the result."""
    best, result = math.inf, action()
    for _ in range(ROUNDS):
        began_s = time.process_time()
        result = action()
        best = min(best, time.process_time() - began_s)
    return best, result
