"""Takes orders by a button for each table, serves them in turn, and goes home when there is nothing to do.

It talks to people on the page, waits at a table until somebody has taken the food, and refuses what is open when the
battery is low. Stopped by a person, it drives nowhere before one agrees. When it, or the daemon, is killed, it goes on
where it was: goals have ids, and orders are in a file.
"""

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from typing import Final

from chefbotd.client import CallError, Client, GoalNotReached
from chefbotd.client.models import BatteryData
from chefbotd.components.agents.agent import ACCIDENTS, AGAIN_S, BY_PEOPLE, Agent, run_agent
from examples.waiter.notebook import CannotNote, Notebook, Order

Connect = Callable[[], AbstractAsyncContextManager[Client]]
TAKEN: Final = "Taken, thank you"
MAY_I_GO_ON: Final = "I was stopped. Shall I go on?"
GO_ON: Final = "Go on"
TAKE_S, ASK_AGAIN_S, MOST_TRIES = 60.0, 300.0, 3


class Waiter:
    """``speak`` says a sentence aloud."""

    def __init__(self, notebook: Notebook, speak: Callable[[str], None] = lambda text: None) -> None:
        self._notebook, self._speak = notebook, speak
        self._has_order, self._is_low, self._is_home = asyncio.Event(), False, False

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
            else:
                await self._take(agent, table)

    async def _take(self, agent: Agent, table: str) -> None:
        try:
            order = self._notebook.take(table, agent.pressed_number)
        except CannotNote as problem:
            await self._say(agent, f"Nobody comes to {table}. {problem}")
            return
        if order is None:
            await self._say(agent, f"I know already that {table} has ordered")
        self._has_order.set()

    async def _watch_battery(self, robot: Client) -> None:
        async with robot.subscribe("battery", max_rate_hz=1.0) as events:
            async for event in events:
                self._is_low = isinstance(event.data, BatteryData) and event.data.status != "ok"
                self._has_order.set()

    async def _serve_all(self, agent: Agent, home: str) -> None:
        """What cannot be noted is done again: goals have ids, so the robot drives no way twice."""
        self._is_home, looks_back = False, True
        while True:
            try:
                if looks_back:
                    await self._look_back(agent.robot)
                looks_back = False
                await self._do_next(agent, home)
            except CannotNote as problem:
                await self._say(agent, str(problem))
                await asyncio.sleep(AGAIN_S)

    async def _do_next(self, agent: Agent, home: str) -> None:
        order = self._notebook.next()
        if self._notebook.page.is_stopped:
            self._is_home = False
            await self._ask_to_go_on(agent)
        elif order is not None and self._is_low and order.state == "waiting":
            await self._refuse(agent, order, "my battery is low")
        elif order is not None:
            self._is_home = False
            await self._serve(agent, order)
        elif not self._is_home:
            self._is_home = await self._go_home(agent, home)
        else:
            self._has_order.clear()
            await self._has_order.wait()

    async def _look_back(self, robot: Client) -> None:
        """Whether somebody stopped it on its way home while this program was not there."""
        try:
            goal = await robot.get_goal(goal_id=self._home_id())
        except CallError as refused:
            if refused.kind != "unknown_goal":
                raise
        else:
            if goal.cause in BY_PEOPLE:
                self._notebook.note_way_home(is_stopped=True)

    def _home_id(self) -> str:
        return f"waiter-{self._notebook.page.name}-home-{self._notebook.page.ways_home}"

    async def _ask_to_go_on(self, agent: Agent) -> None:
        answer = await agent.robot.ask(MAY_I_GO_ON, [GO_ON], ASK_AGAIN_S)
        if answer.choice is not None:
            self._notebook.note_agreed(answer.stop_number)

    async def _serve(self, agent: Agent, order: Order) -> None:
        """Drive there and wait until the food is taken; each step is noted before the next."""
        if order.state != "arrived":
            if order.state == "waiting":  # its goal replaces one at home that nobody waits for any more
                self._notebook.note_way_home(is_stopped=False)
            self._notebook.note(order, "driving")
            await self._say(agent, f"I am coming to {order.table}")
            goal_id = f"waiter-{self._notebook.page.name}-{order.number}-{order.tries}"
            try:
                await agent.drive_to(order.table, goal_id, order.stop_number)
            except GoalNotReached as ended:
                if ended.cause in BY_PEOPLE or (ended.cause in ACCIDENTS and order.tries < MOST_TRIES):
                    self._notebook.note_try(order, is_stopped=ended.cause in BY_PEOPLE)
                else:
                    await self._refuse(agent, order, ended.reason)
                return
            self._notebook.note(order, "arrived")
        answer = await agent.robot.ask(f"I am at {order.table}. Please take your food", [TAKEN], TAKE_S)
        if answer.choice is None:
            await self._refuse(agent, order, "nobody took the food")
        else:
            self._notebook.note_served(order, answer.stop_number)
            await self._say(agent, f"Enjoy your meal at {order.table}")

    async def _go_home(self, agent: Agent, home: str) -> bool:
        """Whether it is at home; else the next one tries again, unless there is an order or somebody stopped it."""
        why, is_stopped = "", False
        try:
            await agent.drive_to(home, self._home_id(), self._notebook.page.stop_number)
        except GoalNotReached as ended:
            why, is_stopped = ended.reason, ended.cause in BY_PEOPLE
        self._notebook.note_way_home(is_stopped=is_stopped)
        if why and not is_stopped:
            await self._say(agent, f"I cannot go home: {why}")
            await asyncio.sleep(AGAIN_S)
        return not why

    async def _refuse(self, agent: Agent, order: Order, reason: str) -> None:
        self._notebook.note(order, "refused", reason)
        await self._say(agent, f"I cannot serve {order.table}: {reason}")

    async def _say(self, agent: Agent, text: str) -> None:
        self._speak(text)
        await agent.say(text)
