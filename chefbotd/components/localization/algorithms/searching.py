"""A search of the whole map and its result: places are followed until one is certain, or none is left."""

import math
from typing import Final

import numpy as np

from chefbotd.components.localization.algorithms import global_search
from chefbotd.components.localization.algorithms.branch_and_bound import Pyramid, pyramid
from chefbotd.components.localization.algorithms.global_search import GlobalSearch
from chefbotd.components.localization.algorithms.hypotheses import (
    Hypothesis,
    confront_with_scan,
    hypotheses,
    is_look,
    merge_hypotheses,
    move_hypotheses,
)
from chefbotd.components.localization.algorithms.surface_map import SurfaceMap, surface_map
from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.poses import Floats, between
from chefbotd.core.record import Record, replace

AGAIN_AFTER_S: Final = 2.0
AGAIN_AFTER_M: Final = 0.3
AGAIN_AFTER_RAD: Final = 0.6
"""A search that did not leave exactly one place begins again after so long, or after such a motion."""


class LocalizationMap(Record, frozen=True):
    """A map made ready: its surfaces, and the levels for a search."""

    surfaces: SurfaceMap
    pyramid: Pyramid


def localization_map(grid: OccupancyGrid) -> LocalizationMap:
    """Make a map ready; that takes some tenths of a second for a large one.

    Raises:
        ValueError: it has no wall beside free space.
    """
    surfaces = surface_map(grid)
    return LocalizationMap(surfaces, pyramid(surfaces))


class Searching(Record, frozen=True):
    """For which scan the whole map is searched, where the odometry was then (``began_at``), and when.

    ``search`` is None once it is done. ``candidates`` are where the robot may be now, the best first; ``is_complete``
    is false if there were too many places to follow all.
    """

    search: GlobalSearch | None
    scan: Scan
    began_at: Floats
    began_s: float
    candidates: tuple[Hypothesis, ...]
    is_complete: bool
    looked_at: Floats

    @property
    def share_done(self) -> float:
        """About how much of the search is done, from 0 to 1."""
        return 1.0 if self.search is None else self.search.share_done


def start_search(
    map_: LocalizationMap,
    scan: Scan,
    odometry: Floats,
    stamp_s: float,
    candidates: tuple[Hypothesis, ...] = (),
) -> Searching:
    """A search for this scan; nothing is computed yet."""
    search = global_search.start_search(map_.pyramid, scan.points)
    return Searching(search, scan, odometry, stamp_s, candidates, is_complete=False, looked_at=odometry)


def advance_search(map_: LocalizationMap, searching: Searching, odometry: Floats) -> Searching:
    """The search a bounded bit further; ``odometry`` is where the robot is now."""
    if searching.search is None:
        return searching
    search = global_search.advance_global_search(searching.search)
    if not search.is_done:
        return replace(searching, search=search)
    places, is_complete = global_search.places(search)
    matching = hypotheses(map_.surfaces.grids, places, searching.scan)
    now = move_hypotheses(matching, between(searching.began_at, odometry), None)
    candidates = merge_hypotheses(searching.candidates, now)
    return replace(searching, search=None, candidates=candidates, is_complete=is_complete)


def add_scan(map_: LocalizationMap, searching: Searching, odometry: Floats, scan: Scan) -> Searching:
    """The candidates after a scan."""
    new_look = is_look(between(searching.looked_at, odometry))
    left = confront_with_scan(
        map_.surfaces.grids,
        searching.candidates,
        scan,
        is_look=new_look,
    )
    return replace(searching, candidates=left, looked_at=odometry if new_look else searching.looked_at)


def is_due(last: Searching, odometry: Floats, stamp_s: float) -> bool:
    """Whether it is time to search again after one that found nothing."""
    return stamp_s - last.began_s >= AGAIN_AFTER_S or has_moved_on(last, odometry)


def has_moved_on(last: Searching, odometry: Floats) -> bool:
    """Whether another search would begin from somewhere else."""
    motion = between(last.began_at, odometry)
    far = math.hypot(motion[0], motion[1]) >= AGAIN_AFTER_M
    return far or bool(np.abs(motion[2]) >= AGAIN_AFTER_RAD)
