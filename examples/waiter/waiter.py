"""Takes orders by a button for each table, serves them in turn, and goes home when there is nothing to do.

It talks to people on the page, waits at a table until somebody has taken the food, and refuses what is open when the
battery is low. When it, or the daemon, is killed, it goes on where it was: goals have ids, and orders are in a file.
"""

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from typing import Final

import structlog

from chefbotd.client import CallError, ChefbotError, Client, GoalNotReached
from chefbotd.client.models import AgentEventData, BatteryData
from chefbotd.client.subscription import Subscription
from examples.waiter.notebook import Notebook, Order

log = structlog.get_logger("waiter")
Connect = Callable[[], AbstractAsyncContextManager[Client]]
TAKEN: Final = "Taken, thank you"
TAKE_S, AGAIN_S, MOST_TRIES = 60.0, 2.0, 3
FOR_A_WHILE: Final = {
    "disarmed",
    "estopped",
    "link_down",
    "worker_unavailable",
    "pose_unknown",
    "stopped",
} | {*("overtaken", "too_old", "no_map_loaded", "rate_limited")}
"""Refusals after which the same is asked again."""

BY_ACCIDENT: Final = {"not_armed", "worker_lost", "client_left", "request_cancelled"}
"""Causes of a goal's end after which it is tried again."""


class Waiter:
    """``speak`` says a sentence aloud."""

    def __init__(self, notebook: Notebook, speak: Callable[[str], None] = lambda text: None) -> None:
        self._notebook, self._speak = notebook, speak
        self._has_order, self._is_low = asyncio.Event(), False

    async def run(self, connect: Connect) -> None:
        """Serve until cancelled; a lost connection is opened again."""
        while True:
            try:
                async with connect() as robot:
                    await self._work(robot)
            except* (ChefbotError, TimeoutError) as problems:
                log.warning("the waiter begins again", why=[str(problem) for problem in problems.exceptions])
            await asyncio.sleep(AGAIN_S)

    async def _work(self, robot: Client) -> None:
        await robot.register_agent("waiter", "1.0")
        async with robot.subscribe("agent_events", policy="ordered") as events, asyncio.TaskGroup() as tasks:
            places = (await robot.list_places()).places
            tables = {
                (await robot.add_button(f"Order to {place.name}"[:40])).button_id: place.name
                for place in places
                if place.kind == "table"
            }
            tasks.create_task(self._take_orders(robot, events, tables))
            tasks.create_task(self._watch_battery(robot))
            await self._serve_all(robot, next(place.name for place in places if place.kind == "home"))

    async def _take_orders(
        self, robot: Client, events: Subscription[AgentEventData], tables: dict[int, str]
    ) -> None:
        async for event in events:
            table = tables.get(event.data.button_id or 0)
            if event.data.agent != "waiter" or table is None:
                continue
            order = None if self._is_low else self._notebook.take(table)
            if self._is_low:
                await self._say(robot, f"I cannot come to {table}: my battery is low")
            elif order is None:
                await self._say(robot, f"I know already that {table} has ordered")
            else:
                self._has_order.set()

    async def _watch_battery(self, robot: Client) -> None:
        async with robot.subscribe("battery", max_rate_hz=1.0) as events:
            async for event in events:
                self._is_low = isinstance(event.data, BatteryData) and event.data.status != "ok"
                self._has_order.set()

    async def _serve_all(self, robot: Client, home: str) -> None:
        is_home = False
        while True:
            order = self._notebook.next()
            if order is not None and self._is_low and order.state == "waiting":
                await self._refuse(robot, order, "my battery is low")
            elif order is not None:
                is_home = False
                await self._serve(robot, order)
            elif not is_home:
                is_home = await self._go_home(robot, home)
            else:
                self._has_order.clear()
                await self._has_order.wait()

    async def _serve(self, robot: Client, order: Order) -> None:
        """Drive there and wait until the food is taken; each step is noted before the next."""
        if order.state != "arrived":
            self._notebook.note(order, "driving")
            await self._say(robot, f"I am coming to {order.table}")
            goal_id = f"waiter-{self._notebook.page.name}-{order.number}-{order.tries}"
            try:
                await self._drive(robot, order.table, goal_id)
            except GoalNotReached as ended:
                if ended.cause in BY_ACCIDENT and order.tries < MOST_TRIES:
                    order.tries += 1
                    self._notebook.save()
                else:
                    await self._refuse(robot, order, ended.reason)
                return
            self._notebook.note(order, "arrived")
        answer = await robot.ask(f"I am at {order.table}. Please take your food", [TAKEN], TAKE_S)
        if answer.choice is None:
            await self._refuse(robot, order, "nobody took the food")
        else:
            self._notebook.note(order, "served")
            await self._say(robot, f"Enjoy your meal at {order.table}")

    async def _go_home(self, robot: Client, home: str) -> bool:
        """Whether it is at home; else the next one tries again, unless there is an order."""
        page = self._notebook.page
        why = ""
        try:
            await self._drive(robot, home, f"waiter-{page.name}-home-{page.ways_home}")
        except GoalNotReached as ended:
            why = ended.reason
        page.ways_home += 1
        self._notebook.save()
        if why:
            await self._say(robot, f"I cannot go home: {why}")
            await asyncio.sleep(AGAIN_S)
        return not why

    async def _drive(self, robot: Client, place: str, goal_id: str) -> None:
        """Drive to a place, or go on waiting for that goal; where the robot cannot move now, ask again."""
        while True:
            try:
                await robot.navigate_to(place=place, goal_id=goal_id, on_client_left="keep")
                return
            except CallError as refused:
                if refused.kind not in FOR_A_WHILE:
                    raise GoalNotReached(0, refused.message, "refused") from refused
                await self._say(robot, f"I have to wait: {refused.message}")
                await asyncio.sleep(AGAIN_S)

    async def _refuse(self, robot: Client, order: Order, reason: str) -> None:
        self._notebook.note(order, "refused", reason)
        await self._say(robot, f"I cannot serve {order.table}: {reason}")

    async def _say(self, robot: Client, text: str) -> None:
        text = text if len(text) <= 200 else f"{text[:199]}…"
        self._speak(text)
        try:
            await robot.say(text)
        except CallError as refused:
            if refused.kind != "rate_limited":  # who speaks too often has still done what it said
                raise
