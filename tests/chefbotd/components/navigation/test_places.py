"""``go_home`` and ``dock``: the robot's own places, by the names that its configuration gives them."""

import asyncio
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from chefbotd.client import CallError, Client
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.maps.models import PlaceData, PlaceList
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.parameters import MapsParameters
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.navigation.commands import NavigationCommands
from chefbotd.components.navigation.goals import Destinations
from chefbotd.components.navigation.models import GoalParams, Waypoint
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.inputs import inputs_of
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.settings import load
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from tests.chefbotd.components.maps.storage.test_store import grid
from tests.fakes.api import serving
from tests.fakes.robot import FakeNavigation, FakeRobot
from tests.fakes.worker import Nursery, healthy


def test_each_is_a_goal_at_its_place() -> None:
    """Queued and waited for as ``navigate_to`` is."""
    robot = FakeRobot()
    section = NavigationSection(home_place="counter", dock_place="charger by the door")
    commands = NavigationCommands(FakeNavigation(robot, section))  # type: ignore[arg-type]

    caller: Any = SimpleNamespace(session=SimpleNamespace(number=1))

    async def ask() -> None:
        home = await commands.go_home(caller, GoalParams(queue=True), None)  # type: ignore[arg-type]
        assert (home.goal, home.end) == (1, None)
        docked = await commands.dock(caller, GoalParams(wait=True), None)  # type: ignore[arg-type]
        assert (docked.goal, docked.end) == (2, "reached")

    asyncio.run(ask())
    assert robot.calls == [
        ("navigate_to", [{"place": "counter"}], True),
        ("navigate_to", [{"place": "charger by the door"}], False),
    ]


def test_the_client_waits_for_their_ends() -> None:
    """Without other words the places are home and dock."""

    async def ask() -> None:
        async with serving() as served, Client.connect(served.host, served.port) as client:
            assert "reached" in await client.go_home()
            assert "reached" in await client.dock()
            told = [call for call in served.robot.calls if call[0] == "navigate_to"]
            assert [call[1] for call in told] == [[{"place": "home"}], [{"place": "dock"}]]

    run_virtual(ask())


def test_a_patrol_reads_the_places_once() -> None:
    """Three waypoints by name, one by its pose: all are of one reading."""
    reads = 0

    class OnDisk:
        async def places(self, of_map: str | None) -> PlaceList:
            nonlocal reads
            reads += 1
            return PlaceList(
                "flat",
                tuple(
                    PlaceData(name=name, x_m=reads, y_m=2.0, heading_rad=0.5) for name in ("kitchen", "door")
                ),
            )

    async def ask() -> None:
        waypoints = [
            Waypoint(place="kitchen"),
            Waypoint(x_m=9.0, y_m=0.0),
            Waypoint(place="door"),
            Waypoint(place="kitchen"),
        ]
        goals = await Destinations(OnDisk(), inputs_of(LoopClock())).goals([1, 2, 3, 4], waypoints)
        assert [(goal.number, goal.x_m) for goal in goals] == [(1, 1.0), (2, 9.0), (3, 1.0), (4, 1.0)]

    asyncio.run(ask())
    assert reads == 1


def test_without_such_a_place_it_is_said_which_there_are(tmp_path: Path) -> None:
    """The map in use has a kitchen only: nothing moves, and the answer names both."""
    save(MapStore(tmp_path), "flat", grid(1))
    lidar = LidarParameters(name="top", model="ld19", device="/dev/absent")  # type: ignore[arg-type]
    settings = load().model_copy(update={"lidar": (lidar,), "maps": MapsParameters(folder=tmp_path)})

    async def ask() -> None:
        spawn = Nursery(healthy).spawn
        async with running_daemon(FakeSerialDevice(), settings, spawn_worker=spawn) as client:
            await client.load_map("flat")
            await client.save_place("kitchen", 1.0, 2.0, 0.5)
            with pytest.raises(CallError, match="has no place 'dock'; there are: kitchen") as refused:
                await client.dock()
            assert refused.value.kind == "unknown_place"

    run_virtual(ask())
