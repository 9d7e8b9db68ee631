"""The manager's process, on a broker that is only a list of messages."""

import asyncio
import sqlite3
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiomqtt
import msgspec
import pytest
import structlog
from chefbot_fleet.fleet import Fleet
from chefbot_fleet.manager import TICK_S, VERSION, Manager
from chefbot_fleet.records import MOST_NAMES, FleetParameters
from chefbot_fleet.routes import Pace
from chefbot_fleet.store import Store
from chefbot_fleet.web import FleetPage
from chefbot_vda5050.broker import BrokerParameters
from chefbot_vda5050.messages import Connection, ConnectionState, InstantActions, Order, State, decode, encode
from chefbot_vda5050.topics import Headers, Kind, RobotName
from fleet_robots import StandardRobot
from fleet_world import HOMES, small_roadmap

from chefbotd.clock import run_virtual

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


class FullDisk(Store):
    """A store whose first writes find no room."""

    left = 3

    def _write(self, *words: Any) -> None:
        if self.left:
            self.left -= 1
            raise sqlite3.OperationalError("database or disk is full")
        super()._write(*words)


def test_a_full_disk_ends_nothing_and_what_it_did_not_take_is_written_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot is taken into the fleet with the first of its states for which there is room on the disk."""
    roadmap = small_roadmap()
    robot = StandardRobot("r0", roadmap, HOMES[0])

    async def scenario() -> None:
        says = ("uagv/v2/standard/r0/state", encode(robot.state()))
        listed = ListedMessages([says] * (FullDisk.left + 1))  # a robot says it again and again
        monkeypatch.setattr("chefbot_fleet.manager.aiomqtt.Client", listed)
        store = FullDisk(tmp_path / "fleet.db")
        fleet = Fleet(roadmap, HOMES, store, Pace(0.5, 0.0), FleetParameters("map"), 0.0)
        page = FleetPage(fleet, "a token for tests", lambda: 0.0)
        manager = Manager(fleet, BrokerParameters(), lambda: 0.0)
        running = asyncio.create_task(manager.run(page, "127.0.0.1", 0))
        await listed.is_through.wait()
        assert set(fleet.vehicles) == {"standard/r0"}
        await asyncio.sleep(10 * TICK_S)
        assert not running.done()
        assert [vehicle.name for vehicle in store.vehicles()] == ["standard/r0"]
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    run_virtual(scenario())


def test_a_state_of_46000_nodes_and_names_without_end_cost_little(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The one is not gone through, and of the others the newest 256 are kept; the robot after them is taken."""
    roadmap = small_roadmap()
    robot = StandardRobot("r0", roadmap, HOMES[0])
    state = encode(robot.state())
    huge = msgspec.json.decode(state)
    huge["nodeStates"] = [{"nodeId": f"n{k}", "sequenceId": 2 * k, "released": True} for k in range(46_000)]

    async def scenario() -> None:
        names = [(f"uagv/v2/standard/x{k}/state", b"{}") for k in range(2000)]
        end = ("uagv/v2/standard/r0/state", state)
        listed = ListedMessages([("uagv/v2/standard/big/state", msgspec.json.encode(huge)), *names, end])
        monkeypatch.setattr("chefbot_fleet.manager.aiomqtt.Client", listed)
        store = Store(tmp_path / "fleet.db")
        fleet = Fleet(roadmap, HOMES, store, Pace(0.5, 0.0), FleetParameters("map"), 0.0)
        await until_through(fleet, listed)
        assert len(fleet.ignored) == MOST_NAMES
        assert not fleet.strangers.robots
        assert set(fleet.vehicles) == {"standard/r0"}

    asyncio.run(scenario())


def test_an_empty_message_clears_what_is_said_of_its_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So a retained message is deleted."""

    async def scenario() -> None:
        topic = "uagv/v2/standard/r9/connection"
        listed = ListedMessages([(topic, b"{"), (topic, b"")])
        monkeypatch.setattr("chefbot_fleet.manager.aiomqtt.Client", listed)
        store = Store(tmp_path / "fleet.db")
        fleet = Fleet(small_roadmap(), HOMES, store, Pace(0.5, 0.0), FleetParameters("map"), 0.0)
        await until_through(fleet, listed)
        assert fleet.ignored == {}

    asyncio.run(scenario())
