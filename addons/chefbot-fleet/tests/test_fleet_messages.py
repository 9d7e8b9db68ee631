"""The manager's process, on a broker that is only a list of messages."""

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiomqtt
import pytest
import structlog
from chefbot_fleet.fleet import Fleet
from chefbot_fleet.manager import VERSION, Manager
from chefbot_fleet.records import FleetParameters
from chefbot_fleet.routes import Pace
from chefbot_fleet.store import Store
from chefbot_fleet.web import FleetPage
from chefbot_vda5050.broker import BrokerParameters
from chefbot_vda5050.messages import Connection, ConnectionState, InstantActions, Order, State, decode, encode
from chefbot_vda5050.topics import Headers, Kind, RobotName
from fleet_robots import StandardRobot
from fleet_world import HOMES, small_roadmap

PATIENCE_S = 100.0


class ListedMessages:
    """A client of a broker that has these messages, and then no more. ``connections`` counts how often it was made."""

    def __init__(self, messages: list[tuple[str, bytes]]) -> None:
        self._listed, self.connections = messages, 0
        self.published: list[tuple[str, bytes]] = []
        self.is_through = asyncio.Event()

    def __call__(self, *words: object, **options: object) -> "ListedMessages":
        """In place of the class of clients."""
        self.connections += 1
        return self

    async def __aenter__(self) -> "ListedMessages":
        return self

    async def __aexit__(self, *problem: object) -> None:
        pass

    async def subscribe(self, topic: str, qos: int) -> None:
        """Everything comes anyway."""

    async def publish(self, topic: str, data: bytes, **options: Any) -> None:
        """Nobody is there; it is kept in ``published``."""
        self.published.append((topic, data))

    @property
    async def messages(self) -> AsyncIterator[aiomqtt.Message]:
        """Each of them, not retained."""
        for topic, data in self._listed:
            yield aiomqtt.Message(topic, data, 0, False, 1, None)
        self.is_through.set()
        await asyncio.Event().wait()


async def until_through(fleet: Fleet, listed: ListedMessages) -> None:
    """Run a manager until it has taken all messages."""
    page = FleetPage(fleet, "a token for tests", lambda: 0.0)
    running = asyncio.create_task(Manager(fleet, BrokerParameters(), lambda: 0.0).run(page, "127.0.0.1", 0))
    through = asyncio.create_task(listed.is_through.wait())
    async with asyncio.timeout(PATIENCE_S):
        await asyncio.wait({running, through}, return_when=asyncio.FIRST_COMPLETED)
    assert not running.done(), running.exception()
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)


class ContradictedFleet(Fleet):
    """What r1 says never fits."""

    def on_state(self, name: str, state: State, now_s: float) -> None:
        """Refuse r1's, take the others'."""
        if name == "standard/r1":
            raise ValueError("no work is due at node 4")
        super().on_state(name, state, now_s)


def test_odd_topics_and_what_does_not_fit_end_neither_the_manager_nor_its_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot that comes after them is taken; the connection is made once."""
    roadmap = small_roadmap()
    robots = [StandardRobot(f"r{k}", roadmap, HOMES[k]) for k in range(2)]
    states = [encode(robot.state()) for robot in robots]

    async def scenario() -> None:
        listed = ListedMessages(
            [
                ("uagv/v2//x/state", states[0]),
                ("uagv/v2/chefbot/r$1/connection", b"{}"),
                ("uagv/v2/standard/r1/state", states[1]),
                ("uagv/v2/standard/r0/state", states[0]),
            ]
        )
        monkeypatch.setattr("chefbot_fleet.manager.aiomqtt.Client", listed)
        fleet = ContradictedFleet(
            roadmap, HOMES, Store(tmp_path / "fleet.db"), Pace(0.5, 0.0), FleetParameters("map"), 0.0
        )
        await until_through(fleet, listed)
        assert set(fleet.vehicles) == {"standard/r0"}
        assert listed.connections == 1

    asyncio.run(scenario())


def test_a_robot_that_is_only_connected_is_asked_where_it_is_and_others_orders_are_heard(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its retained ``connection`` is all that was heard of it; then another manager sends an order to it."""
    header = Headers(RobotName("standard", "r7"), VERSION)
    online = Connection(**header.next(Kind.CONNECTION, 0.0), connection_state=ConnectionState.ONLINE)
    order = Order(**header.next(Kind.ORDER, 0.0), order_id="x1", order_update_id=0, nodes=(), edges=())
    messages = [
        ("uagv/v2/standard/r7/connection", encode(online)),
        ("uagv/v2/standard/r7/order", encode(order)),
    ]

    async def scenario() -> None:
        listed = ListedMessages(messages)
        monkeypatch.setattr("chefbot_fleet.manager.aiomqtt.Client", listed)
        store = Store(tmp_path / "fleet.db")
        fleet = Fleet(small_roadmap(), HOMES, store, Pace(0.5, 0.0), FleetParameters("map"), 0.0)
        with structlog.testing.capture_logs() as logged:
            await until_through(fleet, listed)
        ((topic, data),) = listed.published
        assert topic == "uagv/v2/standard/r7/instantActions"
        assert [one.action_type for one in decode(data, InstantActions).actions] == ["stateRequest"]
        assert fleet.strangers.managers["standard/r7"].order_id == "x1"
        assert "another manager sends orders to standard/r7: 'x1'" in [one["event"] for one in logged]

    asyncio.run(scenario())
