"""An application that is an agent on the socket: what every one of them needs beside the client.

async def work(agent: Agent) -> None:
    async for table in agent.presses({"Order to table 1": "table 1"}):
        await agent.drive_to(table, goal_id=...)
        await agent.say(f"I am at {table}")

await run_agent(partial(Client.connect, name="waiter"), "waiter", "1.0", work)
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Any, Final, Protocol, TypeVar, cast

import structlog

from chefbotd.client.client import Client
from chefbotd.client.errors import CallError, ChefbotError, GoalNotReached

log = structlog.get_logger(__name__)


class SendsGoals(Protocol):
    """What an agent that drives needs of the client: a robot without navigation has no such method."""

    async def navigate_to(self, *, place: str, goal_id: str, on_client_left: str, **condition: Any) -> object:
        """Drive to a place; ends when the robot is there."""
        ...


T = TypeVar("T")
AGAIN_S: Final = 2.0
LONGEST_TEXT, LONGEST_LABEL = 200, 40

TEMPORARY: Final = frozenset(
    {
        *("link_down", "no_map_loaded", "pose_unknown"),
        *("rate_limited", "too_old", "worker_unavailable"),
    }
)
"""Kinds of refusals after which the same may be asked again: a person or the daemon puts it right."""

ACCIDENTS: Final = frozenset(("client_left", "request_cancelled", "worker_lost"))
"""Causes of a goal's end that nobody meant: it may be tried again, with another ``goal_id``."""

BY_PEOPLE: Final = frozenset(("asked", "control_lost", "not_armed", "replaced", "stopped"))
"""Causes of a goal's end after which no goal may be sent before a person agrees; arming alone is no agreement."""

CAUSES: Final = {
    "disarmed": "not_armed",
    "estopped": "not_armed",
    "overtaken": "stopped",
    "stopped": "stopped",
    "stopped_since": "stopped",
}
"""The causes that these kinds of refusals stand for: the robot was stopped, or had a fault, before the goal began."""


class Agent:
    """A registered agent; ``robot`` is its client.

    ``stop_number`` is that of the robot's last stop or fault; None: it is not known yet. ``pressed_number`` is what it
    was when the last button was pressed.
    """

    def __init__(self, robot: Client, name: str) -> None:
        self.robot, self.name = robot, name
        self.stop_number: int | None = None
        self.pressed_number: int | None = None

    async def say(self, text: str) -> None:
        """Say a sentence; a longer one is cut, and one too many within a second is not said."""
        cut = text if len(text) <= LONGEST_TEXT else f"{text[: LONGEST_TEXT - 1]}…"
        try:
            await self.robot.say(cut)
        except CallError as refused:
            if refused.kind != "rate_limited":
                raise

    async def presses(self, labels: Mapping[str, T]) -> AsyncIterator[T]:
        """Offer buttons, and yield what stands behind the label of each that is pressed."""
        async with self.robot.subscribe("agent_events", policy="ordered") as events:
            numbers = {
                (await self.robot.add_button(label[:LONGEST_LABEL])).button_id: value
                for label, value in labels.items()
            }
            async for event in events:
                if event.data.agent == self.name and event.data.button_id in numbers:
                    self.pressed_number = event.data.stop_number
                    yield numbers[event.data.button_id]

    async def watch_stops(self) -> None:
        """Keep ``stop_number`` true, until cancelled."""
        async with self.robot.subscribe("safety", policy="ordered") as events:
            async for event in events:
                self.stop_number = event.data.stop_number

    async def drive_to(self, place: str, goal_id: str, stop_number: int | None = None) -> None:
        """Drive to a place, or go on waiting for the goal of this id.

        Where the robot cannot move now, say so, and ask again after 2 s; but once it was stopped, nothing begins that
        was decided before. ``stop_number`` is that of the decision, if it was not made now. The goal outlives this
        program: sent again after its restart, it does nothing twice.

        Raises:
            GoalNotReached: it ended otherwise, or was refused for good (``end`` is ``refused``), or somebody stopped the
            robot (``cause`` is one of ``BY_PEOPLE``).
        """
        decided = self.stop_number if stop_number is None else stop_number
        condition: dict[str, Any] = {} if decided is None else {"if_stop_number": decided}
        while True:
            try:
                navigating = cast("SendsGoals", self.robot)
                await navigating.navigate_to(place=place, goal_id=goal_id, on_client_left="keep", **condition)
                return
            except CallError as refused:
                if refused.kind not in TEMPORARY:
                    cause = CAUSES.get(refused.kind, "")
                    raise GoalNotReached(0, refused.message, "refused", cause) from refused
                await self.say(f"I have to wait: {refused.message}")
                await asyncio.sleep(AGAIN_S)


async def run_agent(
    connect: Callable[[], AbstractAsyncContextManager[Client]],
    name: str,
    version: str,
    work: Callable[[Agent], Awaitable[None]],
) -> None:
    """Have an agent work until cancelled, or until ``work`` returns.

    Whatever of ``ChefbotError`` or ``TimeoutError`` it raises, such as a lost connection, is logged; after 2 s it begins
    again on a new connection.
    """
    while True:
        try:
            async with connect() as robot:
                await robot.register_agent(name, version)
                agent = Agent(robot, name)
                watching = asyncio.create_task(agent.watch_stops())
                try:
                    await work(agent)
                finally:  # a lost connection ends the work, too
                    watching.cancel()
                    await asyncio.gather(watching, return_exceptions=True)
                return
        except* (ChefbotError, TimeoutError) as problems:
            log.warning(
                "the agent begins again", agent=name, why=[str(problem) for problem in problems.exceptions]
            )
        await asyncio.sleep(AGAIN_S)
