"""Orders that still have to go to the skill, in sequence and bounded. An order that a later one voids is dropped."""

import asyncio

from chefbotd.core.record import Record
from chefbotd.entries import set_event
from chefbotd.worker.skills.navigation_requests import KeepGoals, NavigateTo, NavigationRequest, Pause, Resume

MADE_VOID: dict[type[NavigationRequest], tuple[type[NavigationRequest], ...]] = {
    NavigateTo: (NavigateTo, KeepGoals, Pause, Resume),
    KeepGoals: (KeepGoals,),
    Pause: (Pause, Resume),
    Resume: (Pause, Resume),
}
"""By its kind, which earlier orders an order makes void. Goals that are told again are all that are left."""


class OrdersState(Record, frozen=True):
    """What waits; ``told``: nothing waits, and nothing is being told."""

    waiting: list[NavigationRequest]
    arrived: bool
    told: bool


class Orders:
    """Waits for whoever tells them; at most one of each kind."""

    def __init__(self) -> None:
        self._waiting: list[NavigationRequest] = []
        self._arrived, self._told = asyncio.Event(), asyncio.Event()
        self._told.set()

    def __len__(self) -> int:
        return len(self._waiting)

    def state(self) -> OrdersState:
        """What it remembers."""
        return OrdersState(self._waiting, self._arrived.is_set(), self._told.is_set())

    def restore(self, state: OrdersState) -> None:
        """Go on from there."""
        self._waiting = state.waiting
        set_event(self._arrived, state.arrived)
        set_event(self._told, state.told)

    def put(self, order: NavigationRequest) -> None:
        """To be told after all that wait, but for those that it makes void."""
        void = MADE_VOID.get(type(order), ())
        self._waiting = [each for each in self._waiting if not isinstance(each, void)]
        self._waiting.append(order)
        self._arrived.set()
        self._told.clear()

    async def next(self) -> NavigationRequest:
        """The next one; those before it were told."""
        if not self._waiting:
            self._told.set()
        while not self._waiting:
            self._arrived.clear()
            await self._arrived.wait()
        return self._waiting.pop(0)

    async def all_told(self) -> None:
        """Until none waits, and none is being told."""
        await self._told.wait()
