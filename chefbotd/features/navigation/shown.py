"""Costs and obstacles for viewers. The worker makes them only while somebody subscribes."""

from chefbotd.bus import Bus
from chefbotd.core.events.navigation import CostmapChanged, ObstaclesSeen
from chefbotd.features.maps.grid_part import grid_event
from chefbotd.worker.process import Worker
from chefbotd.worker.skills.navigation_messages import SKILL, CostsShown, ObstaclesShown, Show


class ShownOnDemand:
    """Asks the worker for them, a new worker too, and publishes what it tells."""

    def __init__(self, bus: Bus, worker: Worker) -> None:
        self._bus, self._worker = bus, worker
        self._shows = Show(costmap=False, obstacles=False)
        worker.add_on_ready(self._ask)

    def show_costmap(self, wanted: bool) -> None:
        """Somebody looks at the costs, or nobody does any more."""
        self._shows = Show(wanted, self._shows.obstacles)
        self._ask()

    def show_obstacles(self, wanted: bool) -> None:
        """The same for the obstacles."""
        self._shows = Show(self._shows.costmap, wanted)
        self._ask()

    def _ask(self) -> None:
        self._worker.tell(SKILL, self._shows)

    def publish(self, told: CostsShown | ObstaclesShown) -> None:
        """A part of the costs, or all obstacles."""
        if isinstance(told, CostsShown):
            self._bus.publish(grid_event(CostmapChanged, told))
        else:
            self._bus.publish(ObstaclesSeen(told.stamp_s, told.x_m, told.y_m, told.omitted, told.movers))
