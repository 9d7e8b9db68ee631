"""The costs and obstacles of the skill ``navigation``, sent a few times a second while a client subscribes."""

from collections.abc import Iterator
from typing import Final

from chefbotd.components.navigation.algorithms.shown import ShownCosts, shown_obstacles
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.components.navigation.events import CostmapChanged, ObstaclesSeen
from chefbotd.components.navigation.skill_requests import Show
from chefbotd.core.grid_patch import patch_of

COSTS_EVERY_S: Final = 0.5
OBSTACLES_EVERY_S: Final = 0.25


class LayerPublisher:
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

    def due(self, now_s: float, name: str, world: WorldModel) -> Iterator[CostmapChanged | ObstaclesSeen]:
        """What is to be published now of the map of this name."""
        if self._asked.costmap and now_s >= self._costs_at_s:
            self._costs_at_s = now_s + COSTS_EVERY_S
            frame = world.frame
            for row, column, cells in self._costs.changes(world, now_s):
                yield patch_of(
                    CostmapChanged,
                    cells,
                    row,
                    column,
                    stamp_s=now_s,
                    map=name,
                    revision=self._costs.revision,
                    resolution_m=frame.resolution_m,
                    map_from_grid=frame.map_from_grid,
                    columns=frame.columns,
                    rows=frame.rows,
                )
        if self._asked.obstacles and now_s >= self._obstacles_at_s:
            self._obstacles_at_s = now_s + OBSTACLES_EVERY_S
            yield _obstacles_seen(now_s, world)


def _obstacles_seen(now_s: float, world: WorldModel) -> ObstaclesSeen:
    seen = shown_obstacles(world, now_s)
    points = seen.points_m.round(3)
    movers = tuple((x, y, vx, vy) for x, y, vx, vy in seen.movers.round(3).tolist())
    return ObstaclesSeen(
        now_s, tuple(points[:, 0].tolist()), tuple(points[:, 1].tolist()), seen.omitted, movers
    )
