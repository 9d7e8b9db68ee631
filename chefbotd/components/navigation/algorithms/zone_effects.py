"""What zones and edits would do that may not be meant: to the robot, to places, and to the way from one to the other."""

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
from scipy import ndimage

from chefbotd.components.navigation.algorithms.costmap import Costmap
from chefbotd.core.sentence import Sentence

Point = tuple[float, float]
COVERED_BY_ZONES: Final = Sentence(
    "navigation.concern_zone", "the robot is in it, or too near to it to drive there"
)
COVERED_BY_EDITS: Final = Sentence("navigation.concern_edit", "the robot could not drive from where it is")
MOST_NAMED = 3
"""So many places are named at most; of the others it is said how many there are."""


def find_concerns(
    before: Costmap,
    after: Costmap,
    robot: Point | None,
    places: Mapping[str, Point],
    *,
    covers: str = COVERED_BY_ZONES,
) -> Iterator[str]:
    """A sentence for each: the robot or places that a zone covers, and places that it cuts off.

    ``before`` and ``after`` are the costs of one map without and with a change of it; points are in the map, and
    ``covers`` says what it is that covers the robot. With
    a robot whose place is not known, a place counts as cut off from the first one that is free.
    """
    cells = {name: _cell(before, point) for name, point in places.items()}
    robot_cell = None if robot is None else _cell(before, robot)
    if _is_covered(before, after, robot_cell):
        yield covers
    covered = [name for name, cell in cells.items() if _is_covered(before, after, cell)]
    if covered:
        yield Sentence(
            "navigation.concern_places", "the robot could not stand at {places}", places=_listed(covered)
        )
    free = {name: cell for name, cell in cells.items() if cell is not None and np.isfinite(after.costs[cell])}
    start = robot_cell if _is_free(after, robot_cell) else next(iter(free.values()), None)
    if start is None:
        return
    parts_before, parts_after = (_parts(costs) for costs in (before, after))
    cut_off = [
        name
        for name, cell in free.items()
        if parts_before[cell] == parts_before[start] and parts_after[cell] != parts_after[start]
    ]
    if cut_off:
        yield Sentence(
            "navigation.concern_cut_off", "there would be no way to {places}", places=_listed(cut_off)
        )


def _cell(costs: Costmap, point: Point) -> tuple[int, int] | None:
    ((x_m, y_m),) = costs.frame.to_grid(np.array([point]))
    return costs.frame.cell(float(x_m), float(y_m))


def _is_free(costs: Costmap, cell: tuple[int, int] | None) -> bool:
    return cell is not None and bool(np.isfinite(costs.costs[cell]))


def _is_covered(before: Costmap, after: Costmap, cell: tuple[int, int] | None) -> bool:
    return _is_free(before, cell) and not _is_free(after, cell)


def _parts(costs: Costmap) -> np.ndarray:
    """A number for each connected part of what is free; cells that only touch at a corner are apart."""
    return np.asarray(ndimage.label(np.isfinite(costs.costs))[0])


def _listed(names: list[str]) -> str:
    if len(names) <= MOST_NAMED:
        return ", ".join(names)
    return Sentence(
        "navigation.more_places",
        "{places} and {more} more places",
        places=", ".join(names[:MOST_NAMED]),
        more=len(names) - MOST_NAMED,
    )
