"""The manager's process, on a broker that is only a list of messages."""

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiomqtt
import pytest
from chefbot_fleet.fleet import Fleet
from chefbot_fleet.manager import Manager
from chefbot_fleet.records import FleetParameters
from chefbot_fleet.routes import Pace
from chefbot_fleet.store import Store
from chefbot_fleet.web import FleetPage
from chefbot_vda5050.broker import BrokerParameters
from chefbot_vda5050.messages import State, encode
from fleet_robots import StandardRobot
from fleet_world import HOMES, small_roadmap

PATIENCE_S = 100.0


class ListedMessages:
    """A client of a broker that has these messages, and then no more. ``connections`` counts how often it was made."""

    def __init__(self, messages: list[tuple[str, bytes]]) -> None:
        self._listed, self.connections = messages, 0
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

    async def publish(self, *words: Any, **options: Any) -> None:
        """Nobody is there."""

    @property
    async def messages(self) -> AsyncIterator[aiomqtt.Message]:
        """Each of them, not retained."""
        for topic, data in self._listed:
            yield aiomqtt.Message(topic, data, 0, False, 1, None)
        self.is_through.set()
        await asyncio.Event().wait()


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
        page = FleetPage(fleet, "a token for tests", lambda: 0.0)
        running = asyncio.create_task(
            Manager(fleet, BrokerParameters(), lambda: 0.0).run(page, "127.0.0.1", 0)
        )
        through = asyncio.create_task(listed.is_through.wait())
        async with asyncio.timeout(PATIENCE_S):
            await asyncio.wait({running, through}, return_when=asyncio.FIRST_COMPLETED)
        assert not running.done(), running.exception()
        assert set(fleet.vehicles) == {"standard/r0"}
        assert listed.connections == 1
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    asyncio.run(scenario())
