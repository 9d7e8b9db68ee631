"""A robot of the demonstration without a daemon: its agent is the real one, its body a disc that drives straight."""

import asyncio
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from chefbot_fleet.roadmap import Point
from chefbot_vda5050.agent import VERSION, Agent
from chefbot_vda5050.broker import Broker, BrokerParameters
from chefbot_vda5050.factsheet import factsheet
from chefbot_vda5050.messages import NodePosition, Order, decode
from chefbot_vda5050.robot import DriveFailed
from chefbot_vda5050.topics import Headers, Kind, RobotName, seconds_of
from chefbot_vda5050.vehicle import Facts, Limits
from msgspec.structs import replace

from chefbotd.components.simulation.truth_file import Truth
from chefbotd.core.geometry import Pose2D

RADIUS_M, SPEED_M_S, STEP_S, WORK_S = 0.18, 4.0, 0.05, 0.1


class DiscRobot:
    """Drives at ``SPEED_M_S``; people load and unload it after ``WORK_S``. ``late``: orders that it drove too late.

    ``barred``: why it refuses every way; empty: it does not.
    """

    def __init__(self, serial: str, start: Point, folder: Path, broker_port: int) -> None:
        self.serial, self._port = serial, broker_port
        self.facts = Facts(connected=True, localized=True, map_id="office", x_m=start[0], y_m=start[1])
        self.worked: list[tuple[str, Point]] = []
        self._task: asyncio.Task[None] | None = None
        self._drive = 0
        self.barred = ""
        self.ages_s: dict[tuple[str, int], float] = {}
        self.late: set[tuple[str, int]] = set()
        self._agent: Agent | None = None
        self._changed: Callable[[], None] = lambda: None

    async def switch_on(self) -> None:
        """It knows where it is."""

    async def join(self) -> None:
        """Start its agent."""
        self._task = asyncio.create_task(self._run())

    async def switch_off(self) -> None:
        """Stop it at once, wherever it is."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    remove = switch_off

    def truth(self) -> Truth | None:
        """Where it is."""
        body = np.array([[self.facts.x_m, self.facts.y_m, RADIUS_M]])
        return Truth(time.monotonic(), Pose2D(self.facts.x_m, self.facts.y_m, 0.0), body)

    async def _run(self) -> None:
        name = RobotName("chefbot", self.serial)
        headers = Headers(name, VERSION)
        agent = Agent(
            name,
            self,
            lambda kind, data: broker.publish(kind, data),
            factsheet=partial(factsheet, None, carries_kg=2.0, seconds=0.0),
            limits=Limits(),
            visualization_s=0.0,
            headers=headers,
        )
        broker = Broker(
            BrokerParameters(port=self._port),
            name,
            headers,
            receive=lambda kind, data, retained: self._receive(agent, kind, data, retained=retained),
            online=agent.set_online,
        )
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(agent.run())
            tasks.create_task(broker.run())

    def _receive(self, agent: Agent, kind: Kind, data: bytes, *, retained: bool) -> None:
        """Note how old the orders are that come."""
        agent.receive(kind, data, retained=retained)
        if kind is Kind.ORDER:
            order = decode(data, Order)
            key, age_s = (order.order_id, order.order_update_id), time.time() - seconds_of(order.timestamp)
            self.ages_s[key] = min(age_s, self.ages_s.get(key, age_s))
            self._agent = agent

    def _note_if_late(self) -> None:
        """It drives by an order, or the latest update that it has taken, which was too old whenever it came."""
        if self._agent is not None:
            vehicle = self._agent.vehicle
            key = vehicle.order_id, vehicle.order_update_id
            if self.ages_s.get(key, 0.0) > Limits().order_max_age_s:
                self.late.add(key)

    # its body, as its agent sees it

    def listen(self, changed: Callable[[], None], go_on: Callable[[], None]) -> None:
        """Tell of every change."""
        self._changed = changed

    def _set(self, **changes: Any) -> None:
        self.facts = replace(self.facts, **changes)
        self._changed()

    async def drive_to(self, position: NodePosition, max_speed_m_s: float | None = None) -> None:
        """In steps, until it is there or another drive begins."""
        speed_m_s = min(SPEED_M_S, max_speed_m_s or SPEED_M_S)
        self._note_if_late()
        self._drive += 1
        drive = self._drive
        while (left_m := self.facts.distance_m(position)) > 1e-6:
            await asyncio.sleep(STEP_S)
            if drive != self._drive:
                raise DriveFailed("another drive began")
            step_m = min(speed_m_s * STEP_S, left_m)
            share = step_m / left_m
            x_m, y_m = self.facts.x_m, self.facts.y_m
            self._set(
                x_m=x_m + share * (position.x - x_m),
                y_m=y_m + share * (position.y - y_m),
                linear_m_s=speed_m_s,
            )
        self._set(linear_m_s=0.0)

    async def stop(self) -> None:
        """Stand."""
        self._drive += 1
        self._set(linear_m_s=0.0)

    async def resume(self) -> None:
        """Be ready again."""
        self._set(paused=False)

    async def unreachable(self, position: NodePosition) -> str:
        """Everything on the lanes can be reached, unless it is ``barred``."""
        return self.barred

    async def set_pose(self, position: NodePosition) -> None:
        """It knows where it is."""

    async def say(self, text: str) -> None:
        """Nobody listens."""

    async def ask(self, question: str, choices: list[str], timeout_s: float) -> str | None:
        """People do what they are asked for."""
        await asyncio.sleep(WORK_S)
        self.worked.append((question, (self.facts.x_m, self.facts.y_m)))
        return choices[0]
