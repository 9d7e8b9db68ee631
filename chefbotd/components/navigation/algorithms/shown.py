"""The costs as small patches, and the obstacles that are not on the map, for people to look at."""

from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.navigation.algorithms.grid import Floats, Singles
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.core.record import Record

Cells: TypeAlias = NDArray[np.int8]

BLOCKED_CELL, MOST_CELL = 100, 99
STEPS_A_COST: Final = 20
"""The value of a cell for each 1 that it costs more than a free one."""

SIDE: Final = 80
"""A patch has at most so many rows and columns: 6400 bytes before they are compressed."""

MOST_PATCHES: Final = 8
"""At most so many are sent at a time; other changes wait for the next time."""

IN_TURN: Final = 4
"""So many unchanged ones are sent again for new viewers: a flat of 35 patches (2 cm cells) within five seconds."""

MOST_POINTS: Final = 1000


def cells_of(costs: Singles) -> Cells:
    """Costs as bytes: 0 is free, 100 is blocked, in between ``STEPS_A_COST`` times what a cell costs more."""
    steps = np.clip(np.rint(STEPS_A_COST * (np.minimum(costs, 1e3) - 1.0)), 0, MOST_CELL)
    return np.where(np.isfinite(costs), steps, BLOCKED_CELL).astype(np.int8)


class ShownCosts:
    """The patches that were sent last: changed ones are sent again at once, the others in turn.

    ``revision`` changes with each map: then all patches that were sent before are void.
    """

    def __init__(self) -> None:
        self.revision = 0
        self._of: WorldModel | None = None
        self._shown: dict[tuple[int, int], Cells] = {}
        self._again = 0

    def show_all(self) -> None:
        """Send all patches again, to a new viewer."""
        self._of = None

    def changes(self, world: WorldModel, now_s: float) -> list[tuple[int, int, Cells]]:
        """The patches (row, column, cells) that have changed; if they are few, some others in turn."""
        if world is not self._of:
            self._of, self._shown, self._again = world, {}, 0
            self.revision += 1
        cells = cells_of(world.costs(now_s).costs)
        corners = [(r, c) for r in range(0, cells.shape[0], SIDE) for c in range(0, cells.shape[1], SIDE)]
        now = {(r, c): cells[r : r + SIDE, c : c + SIDE] for r, c in corners}
        shown = self._shown
        is_new = [at not in shown or not np.array_equal(now[at], shown[at]) for at in corners]
        chosen = [at for at, new in zip(corners, is_new, strict=True) if new][:MOST_PATCHES]
        for _ in range(min(IN_TURN, MOST_PATCHES - len(chosen), len(corners))):
            again = corners[self._again % len(corners)]
            self._again += 1
            chosen += [again] if again not in chosen else []
        self._shown |= {at: now[at] for at in chosen}
        return [(*at, now[at]) for at in chosen]


class ShownObstacles(Record, frozen=True):
    """Points (n, 2) in the map, how many were omitted, and movers (m, 4): x, y and the velocity in the map."""

    points_m: Floats
    omitted: int
    movers: Floats


def shown_obstacles(world: WorldModel, now_s: float) -> ShownObstacles:
    """Obstacles that are not on the map; of too many points an even selection."""
    points = world.frame.to_map(world.obstacles(now_s))
    movers = world.movers_in_map(now_s)
    if len(points) <= MOST_POINTS:
        return ShownObstacles(points, 0, movers)
    chosen = np.linspace(0, len(points) - 1, MOST_POINTS).astype(np.int64)
    return ShownObstacles(points[chosen], len(points) - MOST_POINTS, movers)
