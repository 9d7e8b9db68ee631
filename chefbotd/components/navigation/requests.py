"""Requests that wait for the skill, in sequence and bounded; what it is asked to show while a client subscribes.

A request that a later one supersedes is dropped.
"""

from msgspec import field

from chefbotd.bus import Bus
from chefbotd.components.navigation.events import CostmapChanged, ObstaclesSeen
from chefbotd.components.navigation.skill_requests import (
    SKILL,
    KeepGoals,
    NavigateTo,
    NavigationRequest,
    Pause,
    Resume,
    Show,
)
from chefbotd.components.worker.process import Worker
from chefbotd.core.record import MutableState, StatefulPart, StatefulValue
from chefbotd.inputs import StatefulEvent

SUPERSEDED: dict[type[NavigationRequest], tuple[type[NavigationRequest], ...]] = {
    NavigateTo: (NavigateTo, KeepGoals, Pause, Resume),
    KeepGoals: (KeepGoals,),
    Pause: (Pause, Resume),
    Resume: (Pause, Resume),
}
"""By its kind, which earlier requests a request supersedes. Goals that are sent again are all that are left."""


class RequestQueueState(MutableState):
    """What waits; ``all_sent``: nothing waits, and nothing is being sent."""

    waiting: list[NavigationRequest] = []
    arrived: bool = False
    all_sent: bool = field(default=True, name="told")


class RequestQueue(StatefulPart[RequestQueueState]):
    """At most one request of each kind waits."""

    def __init__(self) -> None:
        self._arrived, self._sent = StatefulEvent(), StatefulEvent()
        self._sent.set()
        self.memory, self.parts = RequestQueueState(), {"arrived": self._arrived, "all_sent": self._sent}

    def __len__(self) -> int:
        return len(self.memory.waiting)

    def put(self, request: NavigationRequest) -> None:
        """Add a request behind those that wait, and drop those that it supersedes."""
        superseded = SUPERSEDED.get(type(request), ())
        self.memory.waiting = [other for other in self.memory.waiting if not isinstance(other, superseded)]
        self.memory.waiting.append(request)
        self._arrived.set()
        self._sent.clear()

    async def next(self) -> NavigationRequest:
        """The next one; those before it were sent."""
        if not self.memory.waiting:
            self._sent.set()
        while not self.memory.waiting:
            self._arrived.clear()
            await self._arrived.wait()
        return self.memory.waiting.pop(0)

    async def all_sent(self) -> None:
        """Wait until none waits, and none is being sent."""
        await self._sent.wait()


NOTHING_SHOWN = Show(costmap=False, obstacles=False)


class ShownOnDemand(StatefulValue[Show]):
    """Asks the worker for costs and obstacles while a client subscribes, and publishes them.

    A new worker is asked, too.
    """

    def __init__(self, bus: Bus, worker: Worker) -> None:
        self._worker = worker
        self.memory = NOTHING_SHOWN
        worker.add_on_ready(self._ask)
        worker.add_listener(SKILL, CostmapChanged, bus.publish)
        worker.add_listener(SKILL, ObstaclesSeen, bus.publish)

    def show_costmap(self, is_shown: bool) -> None:
        """A client subscribes to the costs, or none does any more."""
        self.memory = Show(is_shown, self.memory.obstacles)
        self._ask()

    def show_obstacles(self, is_shown: bool) -> None:
        """The same for the obstacles."""
        self.memory = Show(self.memory.costmap, is_shown)
        self._ask()

    def _ask(self) -> None:
        self._worker.tell(SKILL, self.memory)
