"""Where a robot came near to something though there was room, and where it had to.

There was room where a way that keeps ``ROOM_M`` from everything leads from the last place before to the first one after,
and is at most ``LONGER_M`` longer; everything is walls, furniture, and people where they were meanwhile. What begins
or ends a drive is not judged: there the goal is near to something.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from chefbotd.components.navigation.algorithms.grid import Singles
from chefbotd.components.navigation.algorithms.search import search
from chefbotd.components.navigation.algorithms.smooth import straighten_path
from tests.chefbotd.components.navigation.algorithms.drives import Clearance, Person

ROOM_M, LONGER_M, PERSON_M = 0.10, 0.3, Person.radius_m


def least_with_room_m(passed: Sequence[Clearance], room_m: Singles, cell_m: float, radius_m: float) -> float:
    """The least clearance from walls and furniture where there was room; infinite where it was always in gaps.

    ``room_m`` is the distance of each cell's middle from the nearest obstacle's.
    """
    free = np.where(room_m > radius_m + ROOM_M, 1, np.inf).astype(np.float32)
    least_m = min((each.walls_m for each in passed if each.walls_m >= ROOM_M), default=math.inf)
    for near in _near(passed):
        if _has_room(near, _without_people(free, near, cell_m, radius_m + ROOM_M), cell_m):
            least_m = min(least_m, *(each.walls_m for each in near[1:-1]))
    return least_m


def _near(passed: Sequence[Clearance]) -> Iterator[Sequence[Clearance]]:
    """Each stretch that is nearer than ``ROOM_M``, with what is before and after it; not the first and the last one."""
    begin = next((k for k, each in enumerate(passed) if each.walls_m >= ROOM_M), len(passed))
    for k in range(begin, len(passed)):
        if passed[k].walls_m < ROOM_M:
            continue
        if k > begin + 1:
            yield passed[begin : k + 1]
        begin = k


def _without_people(free: Singles, near: Sequence[Clearance], cell_m: float, apart_m: float) -> Singles:
    """The same, blocked where a robot would have been too near to somebody."""
    rows, columns = np.indices(free.shape)
    left = free.copy()
    for x_m, y_m in {place for each in near for place in each.people}:
        away_m = np.hypot((columns + 0.5) * cell_m - x_m, (rows + 0.5) * cell_m - y_m)
        left[away_m < apart_m + PERSON_M] = np.inf
    return left


def _has_room(near: Sequence[Clearance], free: Singles, cell_m: float) -> bool:
    ends = [_nearest_free(each, free, cell_m) for each in (near[0], near[-1])]
    if ends[0] is None or ends[1] is None:
        return False
    found = search(free, ends[0], ends[1])
    if found is None:
        return False
    length_m = float(np.hypot(*np.diff(straighten_path(found.cells, free, cell_m), axis=0).T).sum())
    driven_m = sum(math.dist((a.x_m, a.y_m), (b.x_m, b.y_m)) for a, b in pairwise(near))
    return length_m <= driven_m + LONGER_M


def _nearest_free(at: Clearance, free: Singles, cell_m: float) -> tuple[int, int] | None:
    """The free cell nearest to a place, no more than three cells from it."""
    row, column = int(at.y_m / cell_m), int(at.x_m / cell_m)
    top, left = max(row - 3, 0), max(column - 3, 0)
    cells = np.argwhere(np.isfinite(free[top : row + 4, left : column + 4])) + np.array([top, left])
    if not len(cells):
        return None
    nearest = cells[int(np.argmin(np.hypot(cells[:, 0] - row, cells[:, 1] - column)))]
    return int(nearest[0]), int(nearest[1])
