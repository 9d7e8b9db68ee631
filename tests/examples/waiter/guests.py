"""A restaurant on the virtual clock: guests who order and take their food, and a worker that only says it drives."""

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from chefbotd.client import CallError, Client, ConnectionLost
from chefbotd.client.models import AgentsData
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.maps.events import MappingChanged
from chefbotd.components.navigation.events import GoalResult, NavigationData
from chefbotd.components.navigation.skill_requests import (
    REQUEST,
    SKILL,
    CheckMap,
    GoalAsked,
    KeepGoals,
    MapChecked,
    NavigateTo,
    Stepped,
)
from chefbotd.components.worker.messages import (
    Answer,
    Configure,
    Ready,
    SkillEvent,
    SkillRequest,
    ToWorker,
    pack_body,
)
from examples.waiter.notebook import Notebook, Order
from examples.waiter.waiter import MAY_I_GO_ON, Connect, Waiter
from tests.fakes.worker import FakeChild, live


class FakeDriving:
    """Reaches each goal ``drive_s`` after it was begun; ``driven`` are the goals that it began, by their numbers."""

    def __init__(self, child: FakeChild, drive_s: float) -> None:
        self._child, self._drive_s, self._goals = child, drive_s, list[GoalAsked]()
        self.driven: list[GoalAsked] = []
        self._timer: asyncio.TimerHandle | None = None
        child.answer = self._answer
        live(child)

    def die(self) -> None:
        """As by SIGKILL."""
        if self._timer is not None:
            self._timer.cancel()
        self._child.die("it was killed by SIGKILL")

    def _answer(self, message: ToWorker) -> None:
        if isinstance(message, Configure):
            self._child.say(Ready())
        elif isinstance(message, SkillRequest):
            self._child.say(Answer(message.id, pack_body(self._answer_of(message))))

    def _answer_of(self, message: SkillRequest) -> Any:
        now_s = asyncio.get_running_loop().time()
        if message.skill == "mapping":
            return MappingChanged(stamp_s=now_s)
        if message.skill == "localization":
            return LocalizationChanged(now_s, "localized", "flat", 1.0, (), 1.0, 0, "")
        request = REQUEST.decode(message.body)
        self._take(request)
        return MapChecked("") if isinstance(request, CheckMap) else None

    def _take(self, request: Any) -> None:
        if isinstance(request, NavigateTo):
            self._goals = [*(self._goals if request.queue else []), *request.goals]
        elif isinstance(request, KeepGoals):
            self._goals = [goal for goal in self._goals if goal.number in request.numbers]
        else:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._begin()

    def _begin(self) -> None:
        if self._goals:
            if self._goals[0] not in self.driven:
                self.driven.append(self._goals[0])
            self._say(NavigationData("driving", self._goals[0].number, "drives"))
            self._timer = asyncio.get_running_loop().call_later(self._drive_s, self._arrive)

    def _arrive(self) -> None:
        ended = GoalResult(self._goals.pop(0).number, "reached", "reached: as the test says")
        self._say(NavigationData("idle"), ended)
        self._begin()

    def _say(self, now: NavigationData, *ended: GoalResult) -> None:
        stepped = Stepped(asyncio.get_running_loop().time(), None, now, ended, None)
        self._child.say(SkillEvent(SKILL, pack_body(stepped), "Stepped"))


async def agents_of(client: Client) -> AgentsData:
    """The agents, their buttons and questions, as they are now."""
    event = (await client.get_state()).topics.get("agents")
    return AgentsData() if event is None else event.data


class Guests:
    """They press and answer at random; ``taken`` counts the questions that one of them has answered."""

    def __init__(self, client: Callable[[], Client], chance: random.Random) -> None:
        self._client, self._chance = client, chance
        self.taken = 0

    async def order(self, presses: int) -> None:
        """Press buttons, now and then one whose table has ordered already, or while there is no waiter."""
        for _ in range(presses):
            await asyncio.sleep(self._chance.uniform(1.0, 30.0))
            with contextlib.suppress(
                CallError, ConnectionLost
            ):  # the waiter or the daemon was killed just now
                buttons = (await agents_of(self._client())).buttons
                if buttons:
                    await self._client().press_button(self._chance.choice(buttons).button_id)

    async def take(self) -> None:
        """Take the food after a while; one in twelve never does."""
        while True:
            with contextlib.suppress(ConnectionLost):  # the daemon was killed
                await self._take_of(self._client())
            await asyncio.sleep(0.5)

    async def _take_of(self, client: Client) -> None:
        async with client.subscribe("agents") as events:
            async for event in events:
                for question in event.data.questions:
                    may_go_on = (
                        question.question == MAY_I_GO_ON
                    )  # after a daemon that began again: somebody agrees
                    if not may_go_on and self._chance.random() < 1 / 12:
                        continue
                    await asyncio.sleep(self._chance.uniform(0.2, 6.0))
                    with contextlib.suppress(CallError):  # the waiter was killed meanwhile
                        await client.answer_agent(question.question_id, question.choices[0])
                        self.taken += not may_go_on


class KillableWaiter:
    """The application, killed and started again; all that outlives it is its file."""

    def __init__(self, path: Path, connect: Connect) -> None:
        self._path, self._connect = path, connect
        self._task: asyncio.Task[None] | None = None

    @contextlib.asynccontextmanager
    async def working(self) -> AsyncIterator[None]:
        """It works while the block runs."""
        self.start()
        try:
            yield
        finally:
            await self.kill()

    def start(self) -> None:
        """Start it."""
        self._task = asyncio.create_task(Waiter(Notebook(self._path)).run(self._connect))

    async def kill(self) -> None:
        """End it, whatever it is doing."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait([self._task])
            assert self._task.cancelled(), self._task.exception()
            self._task = None

    def orders(self) -> list[Order]:
        """What is in its file."""
        return Notebook(self._path).page.orders if self._path.exists() else []

    async def until_done(self, within_s: float) -> None:
        """Wait until no order is open."""
        async with asyncio.timeout(within_s):
            while any(order.state not in ("served", "refused") for order in self.orders()):  # noqa: ASYNC110 - a file
                await asyncio.sleep(1.0)
