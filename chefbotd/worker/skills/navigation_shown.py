"""The costs and obstacles of the skill ``navigation``, sent a few times a second while somebody subscribes."""

import zlib
from collections.abc import Iterator
from typing import Final

import numpy as np

from chefbotd.navigation.awareness import Awareness
from chefbotd.navigation.shown import CostPatch, ShownCosts, shown_obstacles
from chefbotd.worker.skills.navigation_messages import CostsShown, ObstaclesShown, Show

COSTS_EVERY_S: Final = 0.5
OBSTACLES_EVERY_S: Final = 0.25


class Shown:
    """Who looks at what, and when that is due again."""

    def __init__(self) -> None:
        self._asked = Show(costmap=False, obstacles=False)
        self._costs = ShownCosts()
        self._costs_at_s = self._obstacles_at_s = float("-inf")

    def ask(self, asked: Show) -> None:
        """Somebody looks, or nobody does any more."""
        if asked.costmap and not self._asked.costmap:
            self._costs.show_all()
        self._asked = asked

    def due(self, now_s: float, name: str, known: Awareness) -> Iterator[CostsShown | ObstaclesShown]:
        """What is to be told now of the map of this name."""
        if self._asked.costmap and now_s >= self._costs_at_s:
            self._costs_at_s = now_s + COSTS_EVERY_S
            for patch in self._costs.changes(known, now_s):
                yield _costs_shown(now_s, name, self._costs.revision, known, patch)
        if self._asked.obstacles and now_s >= self._obstacles_at_s:
            self._obstacles_at_s = now_s + OBSTACLES_EVERY_S
            yield _obstacles_shown(now_s, known)


def _costs_shown(now_s: float, name: str, revision: int, known: Awareness, patch: CostPatch) -> CostsShown:
    frame, (part_rows, part_columns) = known.frame, patch.cells.shape
    origin = frame.map_from_grid
    return CostsShown(
        stamp_s=now_s,
        map=name,
        revision=revision,
        resolution_m=frame.resolution_m,
        origin=(origin.x_m, origin.y_m, origin.heading_rad),
        columns=frame.columns,
        rows=frame.rows,
        column=patch.column,
        row=patch.row,
        part_columns=part_columns,
        part_rows=part_rows,
        cells=zlib.compress(np.ascontiguousarray(patch.cells).tobytes(), 1),
    )


def _obstacles_shown(now_s: float, known: Awareness) -> ObstaclesShown:
    seen = shown_obstacles(known, now_s)
    points = seen.points_m.round(3)
    movers = tuple((x, y, vx, vy) for x, y, vx, vy in seen.movers.round(3).tolist())
    return ObstaclesShown(
        now_s, tuple(points[:, 0].tolist()), tuple(points[:, 1].tolist()), seen.omitted, movers
    )
