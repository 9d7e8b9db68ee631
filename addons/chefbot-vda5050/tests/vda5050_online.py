"""Robots on a real broker, and a master that listens: every message of everybody has to fit its schema."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable
from functools import partial
from typing import Any

import aiomqtt
from chefbot_vda5050.agent import Agent
from chefbot_vda5050.broker import NO_DELAY, Broker, BrokerParameters
from chefbot_vda5050.factsheet import factsheet
from chefbot_vda5050.messages import (
    Connection,
    ConnectionState,
    InstantActions,
    Message,
    Order,
    State,
    decode,
    encode,
)
from chefbot_vda5050.topics import Headers, Kind, RobotName, parse_topic, timestamp_of
from msgspec.structs import replace
from vda5050_fakes import NAME, FakeRobot, strict_problems
from vda5050_orders import HEADER, LIMITS, action


@contextlib.asynccontextmanager
async def robot_online(
    parameters: BrokerParameters,
    robot: FakeRobot,
    name: RobotName = NAME,
    version: str | None = None,
    **options: Any,
) -> AsyncIterator[Agent]:
    """A robot with its agent and its connection, at work."""
    headers = Headers(name, version or HEADER["version"])
    agent = Agent(
        name,
        robot,
        lambda kind, data: broker.publish(kind, data),
        factsheet=partial(factsheet, None, carries_kg=2.0, seconds=1.0),
        headers=headers,
        **({"limits": LIMITS} | options),
    )
    broker = Broker(
        parameters,
        name,
        headers,
        receive=lambda kind, data, retained: agent.receive(kind, data, retained=retained),
        online=lambda there: agent.set_online(there),
    )
    tasks = [asyncio.create_task(work) for work in (agent.run(), broker.run())]
    try:
        yield agent
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


class Master:
    """Listens to all robots of the broker, and connects again when it is gone. ``problems`` is what no schema allows."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.seen: list[tuple[RobotName, Kind, bytes, bool]] = []
        self.problems: list[str] = []
        self.client: aiomqtt.Client | None = None
        self._new = asyncio.Event()
        self._headers = 0

    async def run(self) -> None:
        """Listen until cancelled."""
        while True:
            with contextlib.suppress(aiomqtt.MqttError):
                async with aiomqtt.Client("127.0.0.1", self.port, socket_options=NO_DELAY) as client:
                    await client.subscribe("uagv/#", qos=1)
                    self.client = client
                    self._new.set()
                    async for message in client.messages:
                        self._take(message)
            self.client = None
            await asyncio.sleep(0.05)

    def _take(self, message: aiomqtt.Message) -> None:
        parsed = parse_topic(str(message.topic))
        if parsed is None or not isinstance(message.payload, bytes):
            self.problems.append(f"{message.topic}: no topic of the standard")
            return
        name, kind = parsed
        if kind not in (Kind.ORDER, Kind.INSTANT_ACTIONS):  # what robots publish
            self.problems += [f"{kind}: {one}" for one in strict_problems(kind, message.payload)]
        self.seen.append((name, kind, message.payload, message.retain))
        self._new.set()

    def latest(self, name: RobotName = NAME) -> State | None:
        """The latest state of a robot."""
        of = (data for seen, kind, data, _ in reversed(self.seen) if (seen, kind) == (name, Kind.STATE))
        data = next(of, None)
        return None if data is None else decode(data, State)

    def connections(self, name: RobotName = NAME) -> list[ConnectionState]:
        """What was told of a robot's connection."""
        return [
            decode(data, Connection).connection_state
            for seen, kind, data, _ in self.seen
            if (seen, kind) == (name, Kind.CONNECTION)
        ]

    async def until(self, condition: Callable[[], Any], within_s: float = 100.0) -> None:
        """Wait for something to be true of what was seen."""
        async with asyncio.timeout(within_s):
            while not condition():
                self._new.clear()
                await self._new.wait()

    async def until_state(self, condition: Callable[[State], Any], name: RobotName = NAME) -> State:
        """Wait for such a state."""
        await self.until(lambda: (state := self.latest(name)) is not None and condition(state))
        state = self.latest(name)
        assert state is not None
        return state

    async def send(self, kind: Kind, message: Message, name: RobotName = NAME, **changes: Any) -> None:
        """Publish to a robot, with a header of now."""
        header = {
            "header_id": self._headers,
            "timestamp": timestamp_of(time.time()),
            "manufacturer": name.manufacturer,
            "serial_number": name.serial_number,
        }
        self._headers += 1
        await self.until(lambda: self.client is not None)
        assert self.client is not None
        data = encode(replace(message, **(header | changes)))
        self.problems += [f"{kind}: {one}" for one in strict_problems(kind, data)]
        await self.client.publish(name.topic(kind), data)

    async def order(self, order: Order, name: RobotName = NAME, **changes: Any) -> None:
        """Send an order."""
        await self.send(Kind.ORDER, order, name, **changes)

    async def act(self, kind: str, number: str, name: RobotName = NAME) -> None:
        """Send an instant action."""
        actions = (action(kind, number, "NONE"),)
        await self.send(Kind.INSTANT_ACTIONS, InstantActions(**HEADER, actions=actions), name)


@contextlib.asynccontextmanager
async def master(port: int) -> AsyncIterator[Master]:
    """A master at work; at the end nothing that it has seen may break a schema."""
    now = Master(port)
    task = asyncio.create_task(now.run())
    try:
        await now.until(lambda: now.client is not None)
        yield now
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    assert not now.problems, now.problems
