"""Takes orders by a button for each table, serves them in turn, and goes home when there is nothing to do.

It talks to people on the page, waits at a table until somebody has taken the food, and refuses what is open when the
battery is low. When it, or the daemon, is killed, it goes on where it was: goals have ids, and orders are in a file.
"""

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from typing import Final

from chefbotd.client import Client, GoalNotReached
from chefbotd.client.agent import ACCIDENTS, AGAIN_S, Agent, run_agent
from chefbotd.client.models import BatteryData
from examples.waiter.notebook import Notebook, Order

Connect = Callable[[], AbstractAsyncContextManager[Client]]
TAKEN: Final = "Taken, thank you"
TAKE_S, MOST_TRIES = 60.0, 3


class Waiter:
    """``speak`` says a sentence aloud."""

    def __init__(self, notebook: Notebook, speak: Callable[[str], None] = lambda text: None) -> None:
        self._notebook, self._speak = notebook, speak
        self._has_order, self._is_low = asyncio.Event(), False

    async def run(self, connect: Connect) -> None:
        """Serve until cancelled; a lost connection is opened again."""
        await run_agent(connect, "waiter", "1.0", self._work)

    async def _work(self, agent: Agent) -> None:
        places = (await agent.robot.list_places()).places
        tables = [place.name for place in places if place.kind == "table"]
        home = next(place.name for place in places if place.kind == "home")
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._take_orders(agent, tables))
            tasks.create_task(self._watch_battery(agent.robot))
            tasks.create_task(self._serve_all(agent, home))

    async def _take_orders(self, agent: Agent, tables: list[str]) -> None:
        async for table in agent.presses({f"Order to {table}": table for table in tables}):
            if self._is_low:
                await self._say(agent, f"I cannot come to {table}: my battery is low")
            elif self._notebook.take(table) is None:
                await self._say(agent, f"I know already that {table} has ordered")
            else:
                self._has_order.set()

    async def _watch_battery(self, robot: Client) -> None:
        async with robot.subscribe("battery", max_rate_hz=1.0) as events:
            async for event in events:
                self._is_low = isinstance(event.data, BatteryData) and event.data.status != "ok"
                self._has_order.set()

    async def _serve_all(self, agent: Agent, home: str) -> None:
        is_home = False
        while True:
            order = self._notebook.next()
            if order is not None and self._is_low and order.state == "waiting":
                await self._refuse(agent, order, "my battery is low")
            elif order is not None:
                is_home = False
                await self._serve(agent, order)
            elif not is_home:
                is_home = await self._go_home(agent, home)
            else:
                self._has_order.clear()
                await self._has_order.wait()

    async def _serve(self, agent: Agent, order: Order) -> None:
        """Drive there and wait until the food is taken; each step is noted before the next."""
        if order.state != "arrived":
            self._notebook.note(order, "driving")
            await self._say(agent, f"I am coming to {order.table}")
            goal_id = f"waiter-{self._notebook.page.name}-{order.number}-{order.tries}"
            try:
                await agent.drive_to(order.table, goal_id)
            except GoalNotReached as ended:
                if ended.cause in ACCIDENTS and order.tries < MOST_TRIES:
                    order.tries += 1
                    self._notebook.save()
                else:
                    await self._refuse(agent, order, ended.reason)
                return
            self._notebook.note(order, "arrived")
        answer = await agent.robot.ask(f"I am at {order.table}. Please take your food", [TAKEN], TAKE_S)
        if answer.choice is None:
            await self._refuse(agent, order, "nobody took the food")
        else:
            self._notebook.note(order, "served")
            await self._say(agent, f"Enjoy your meal at {order.table}")

    async def _go_home(self, agent: Agent, home: str) -> bool:
        """Whether it is at home; else the next one tries again, unless there is an order."""
        page = self._notebook.page
        why = ""
        try:
            await agent.drive_to(home, f"waiter-{page.name}-home-{page.ways_home}")
        except GoalNotReached as ended:
            why = ended.reason
        page.ways_home += 1
        self._notebook.save()
        if why:
            await self._say(agent, f"I cannot go home: {why}")
            await asyncio.sleep(AGAIN_S)
        return not why

    async def _refuse(self, agent: Agent, order: Order, reason: str) -> None:
        self._notebook.note(order, "refused", reason)
        await self._say(agent, f"I cannot serve {order.table}: {reason}")

    async def _say(self, agent: Agent, text: str) -> None:
        self._speak(text)
        await agent.say(text)
