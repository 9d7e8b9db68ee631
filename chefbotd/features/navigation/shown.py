"""Costs and obstacles for viewers. The worker makes them only while somebody subscribes."""

from chefbotd.bus import Bus
from chefbotd.core.events.navigation import CostmapChanged, ObstaclesSeen
from chefbotd.worker.process import Worker
from chefbotd.worker.skills.navigation_requests import SKILL, Show


class ShownOnDemand:
    """Asks the worker for them, a new worker too, and publishes what it tells."""

    def __init__(self, bus: Bus, worker: Worker) -> None:
        self._worker = worker
        self._shows = Show(costmap=False, obstacles=False)
        worker.add_on_ready(self._ask)
        worker.add_listener(SKILL, CostmapChanged, bus.publish)
        worker.add_listener(SKILL, ObstaclesSeen, bus.publish)

    def state(self) -> Show:
        """What somebody looks at."""
        return self._shows

    def restore(self, state: Show) -> None:
        """Go on from there."""
        self._shows = state

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
