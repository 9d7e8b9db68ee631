"""A daemon in memory, as its client sees it: accepting a goal takes its time, and goals end as the real ones do."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from types import SimpleNamespace
from typing import Any

from chefbotd.client import CallError, GoalCancelled, GoalUnreachable
from chefbotd.client.models import LocalizationData, MapPoseData, OdometryData

STEP_S = 0.05
ACCEPTING_S = 0.2


class FakeDaemon:
    """Its robot drives straight along x at ``speed_m_s`` while there is a goal.

    ``refusals`` and ``ends`` are for the next goals, ``answers`` for the next questions.
    """

    def __init__(self, speed_m_s: float = 0.5) -> None:
        self.speed_m_s, self.x_m = speed_m_s, 0.0
        self.calls: list[str] = []
        self.refusals: list[str] = []
        self.ends: list[str] = []
        self.answers: list[str | Exception] = []
        self.planned, self.closed = 0, ""
        self._goal: tuple[float, asyncio.Future[str]] | None = None
        self._topics: dict[str, asyncio.Queue[Any]] = {}

    def is_moving(self) -> bool:
        """Whether its robot drives now."""
        return self._goal is not None

    async def run(self) -> None:
        """Move the robot, and tell where it is, until cancelled."""
        while True:
            await asyncio.sleep(STEP_S)
            speed_m_s = self.speed_m_s if self._goal else 0.0
            if self._goal is not None:
                to_m, end = self._goal
                self.x_m = min(to_m, self.x_m + speed_m_s * STEP_S)
                if self.x_m >= to_m:
                    end.set_result("reached")
                    self._goal = None
            self._tell("localization", LocalizationData(state="localized", map="flat"))
            pose = (self.x_m, 0.0, 0.0)
            self._tell("map_pose", MapPoseData(*pose, covariance=(), fit=1.0, state="localized"))
            self._tell("odometry", OdometryData(*pose, speed_m_s, 0.0, covariance=()))

    def _tell(self, topic: str, data: Any) -> None:
        if topic in self._topics:
            self._topics[topic].put_nowait(SimpleNamespace(data=data))

    @contextlib.asynccontextmanager
    async def connect(self) -> AsyncIterator[Any]:
        """Be the client."""
        yield self

    async def register_agent(self, name: str, version: str) -> None:
        """Known from now on."""

    async def add_button(self, label: str) -> SimpleNamespace:
        """One button."""
        return SimpleNamespace(button_id=1)

    @contextlib.asynccontextmanager
    async def subscribe(self, topics: Any, **options: Any) -> AsyncIterator[AsyncIterator[Any]]:
        """What is told from now on."""
        events: asyncio.Queue[Any] = asyncio.Queue()
        self._topics |= dict.fromkeys([topics] if isinstance(topics, str) else topics, events)

        async def told() -> AsyncIterator[Any]:
            while True:
                yield await events.get()

        yield told()

    async def plan_to(self, *pose: Any, **options: Any) -> SimpleNamespace:
        """There is a path, unless it is ``closed``; "a passer-by" is not on the map."""
        self.planned += 1
        return SimpleNamespace(
            possible=not self.closed, reason=self.closed, only_for_now=self.closed == "a passer-by"
        )

    async def ask(self, question: str, choices: list[str], timeout_s: float) -> SimpleNamespace:
        """A question's answer, or how the connection ended meanwhile."""
        self.calls.append(f"ask {question}")
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return SimpleNamespace(choice=answer)

    async def navigate_to(self, x_m: float, *pose: Any, **options: Any) -> str:
        """Accepted after 0.2 s, it replaces the goal before it; cancelled earlier, that one goes on."""
        self.calls.append(f"navigate_to {x_m:g}")
        await asyncio.sleep(ACCEPTING_S)
        if self.refusals:
            raise CallError(-1, self.refusals.pop(0), "refused")
        if self.ends:
            raise GoalUnreachable(1, "there is no path", self.ends.pop(0))
        if self._goal is not None:
            self._goal[1].set_exception(
                GoalCancelled(1, "cancelled: a new goal replaced it", "cancelled", "replaced")
            )
        mine = self._goal = (x_m, asyncio.get_running_loop().create_future())
        try:
            return await mine[1]
        except asyncio.CancelledError:
            if self._goal is mine:
                self._goal = None
            raise
