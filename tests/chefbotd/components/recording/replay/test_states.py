"""A part that remembers something and offers no state of it is noticed: its attribute is another after a restore."""

import asyncio
import contextlib
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any, get_origin

import numpy as np
import pytest
from msgspec import inspect
from msgspec.structs import replace
from pydantic import BaseModel

from chefbotd.client import GoalCancelled
from chefbotd.clock import run_virtual
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.recording.replay.build import replayed_daemon
from chefbotd.components.recording.replay.entries import ReplayEntries
from chefbotd.components.recording.replay.pipeline import Pipeline
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.components.worker.spawn import Spawn
from chefbotd.core.events.inputs import StateRecorded
from chefbotd.core.record import MutableState, Stateful, StatefulPart
from chefbotd.driving.service import DriveService, DriveServiceState
from chefbotd.event_classes import decode, encode
from chefbotd.inputs import ResumableTimer, StatefulEvent
from chefbotd.settings import Settings, load, packaged
from chefbotd.snapshot import DaemonState, encode_state, state_class
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from chefbotd.testing.worker import no_worker, worker_in_process
from tests.chefbotd.components.recording.replay.attributes import attributes, changed_attributes
from tests.chefbotd.components.recording.replay.test_replay import drive

Script = Callable[[SimulatedRobot], Awaitable[None]]
Moment = tuple[StateRecorded, dict[str, Any]]

START = {"sim.world.start_x_m": 2.45, "sim.world.start_y_m": 2.6, "sim.world.start_heading_rad": 2.1}
EVERY_S = 0.37
ODD: Any = object()

NO_STATE = {
    "ObstacleGuard._weighed_without": "as its weights",
    "ObstacleGuard._weights": "computed again from the excluded wheels",
    "WheelController.is_held_back": "of the step under way",
    "BoardSession._closed": "who opens the port waits for it, and a replay opens none",
    "BoardSession.is_open": "the port is opened again before",
    "BoardWriter._port": "the port",
    "LidarSession._transport": "the port",
    "Decoder._shapes": "a table, learnt from what comes",
    "FirmwareCodec._packed": "what is written often",
    "FirmwareCodec._readers": "a table",
    "FirmwareCodec.regained": "for the rest of a read",
    "LineCodec._packed": "what is written often",
    "LineCodec._readers": "a table",
    "CalibrationService._action": "of a step, which is not continued",
    "CalibrationService._report": "nobody hears of the progress",
    "CalibrationService._scans": "a turn of the lidar later there is another one",
    "CalibrationService._step": "of a step, which is not continued",
    "CalibrationService._state": "of a step, which is not continued",
    "LocalizationService._reports": "nobody hears of the progress",
    "MapsService.in_use": "places are answers from the disk, which are recorded",
    "MapsService._end_reason": "of the disk's map, which a replay does not load",
    "MapsService._is_made_ready": "as before",
    "MapsService._version_in_use": "as before",
    "ProcedureRunner._answer": "of a step, which is not continued",
    "ProcedureRunner._asked": "of a step, which is not continued",
    "ProcedureRunner._timer": "of a step, which is not continued",
    "PendingRequests._progress": "nobody hears of the progress",
    "Reporting._timer": "who waits is told again, and nobody is there",
    "Reporting._waiting": "who waits begins again",
    "Requests._last_unreplayed": "a replay makes none of these requests",
    "Requests._pending": "a request under way is told of as left out",
    "RplidarDecoder._at": "what was read of its data is not kept",
    "RplidarDecoder._data": "as before",
    "SafetySupervisor._reading_error": "is raised in the next step",
    "Setpoints._settled": "computed again",
    "WheelLoop._parameters": "of the configuration and the gains, which set them",
    "WheelLoop._targets_rad_s": "of the configuration",
    "WheelLoop.is_wanted": "of the configuration",
    "Worker._channel": "the worker's process",
    "Worker._dropped": "the worker's process",
    "Worker._ended": "the worker's process",
    "Worker._failures": "starts the worker's process again",
    "Worker._references": "where the skills of components are",
    "Worker._skills": "the worker's parameters",
    "Worker._vitals": "the worker's process",
    "_Waiting._goal": "nobody hears of the progress",
    "_Waiting._left_m": "nobody hears of the progress",
    "_Waiting._path_m": "nobody hears of the progress",
}
"""Attributes from which nothing follows that a replay computes, and why."""


async def moments(robot: SimulatedRobot, script: Script) -> list[Moment]:
    """The state, and every attribute of every part, at odd moments of a script; only where nothing is left out."""
    taken: list[Moment] = []
    state = robot.daemon.state
    ends = asyncio.ensure_future(script(robot))
    while not ends.done():
        await asyncio.sleep(EVERY_S)
        recorded = state.record()
        if not recorded.left_out:
            taken.append((decode(StateRecorded, encode(recorded)), attributes(state.parts)))
    await ends
    return taken


def forgotten(script: Script, settings: Settings, spawn_worker: Spawn = no_worker) -> tuple[int, set[str]]:
    """How many moments there were, and the attributes that were others after a restore of the state then."""

    async def run() -> list[Moment]:
        async with simulated_robot(settings, spawn_worker=spawn_worker) as robot:
            return await moments(robot, script)

    async def compare(taken: list[Moment]) -> set[str]:
        different: set[str] = set()
        for recorded, before in taken:
            entries = ReplayEntries()
            entries.set_time(recorded.stamp_s)
            daemon = replayed_daemon(settings, None, entries)
            pipeline = Pipeline(daemon, entries)
            assert await pipeline.begin_late(recorded, keeps_parameters=False) == []
            after = attributes(daemon.state.parts)
            paths = before.keys() | after.keys()
            different |= {path for path in paths if before.get(path, "?") != after.get(path, "?")}
            pipeline.close()
        return different

    taken = run_virtual(run())
    return len(taken), {path.rpartition("/")[2].partition("[")[0] for path in asyncio.run(compare(taken))}


async def eventful(robot: SimulatedRobot) -> None:
    """Drives, gains, faults, an e-stop, odometry set anew, a restarted board, a lost link."""
    client = robot.client
    await client.set_client_name("pilot")
    await asyncio.sleep(1.2)
    await client.set_pid("all", kp=31.7)
    await drive(robot, 0.21, 0.37, 1.13)
    await asyncio.sleep(0.9)
    await drive(robot, -0.13, 0.55, 0.7)
    await client.estop("a test")
    await asyncio.sleep(0.4)
    await client.arm()
    await drive(robot, 0.11, -0.2, 0.6)
    await client.reset_odometry(1.1, -0.3, 0.7)
    await client.reset_board()
    await asyncio.sleep(4.0)
    await client.arm()
    await drive(robot, 0.2, 0.1, 0.5)
    robot.device.unplug()
    await asyncio.sleep(0.7)
    robot.device.plug()
    await asyncio.sleep(2.0)
    await client.arm()
    await drive(robot, 0.3, 0.1, 0.5)


async def on_the_way(robot: SimulatedRobot) -> None:
    """A map is used, a search with a turn, goals that wait for each other, a pause, a map that is begun."""
    client = robot.client
    await asyncio.sleep(1.5)
    await client.load_map("flat")
    search = asyncio.create_task(client.localize(turn=True))
    await asyncio.sleep(5.0)
    await client.stop()
    await search
    async with asyncio.timeout(15.0), client.subscribe("localization") as events:
        async for event in events:
            if event.data.state == "localized":
                break
    await asyncio.sleep(1.1)
    goals = [asyncio.create_task(client.navigate_to(x_m=2.6, y_m=4.0, heading_rad=0.4))]
    await asyncio.sleep(1.3)
    goals.append(asyncio.create_task(client.navigate_to(x_m=2.5, y_m=3.2, queue=True)))
    await asyncio.sleep(1.3)
    await client.pause_navigation()
    await asyncio.sleep(1.1)
    await client.resume_navigation()
    await asyncio.sleep(0.9)
    await client.cancel_navigation()
    for goal in goals:
        with contextlib.suppress(GoalCancelled):
            await goal
    await client.start_mapping()
    await asyncio.sleep(1.3)
    await client.discard_mapping()
    await asyncio.sleep(0.5)


ROBOTS: dict[str, tuple[str, dict[str, object]]] = {
    "two wheels": ("chefbot", {}),
    "wheels and IMU": ("chefbot", {"odometry.source": "wheels_imu"}),
    "four wheels, edges and infrared": (
        "khan",
        {"robot.wire": "khan_edges", "sim.world.start_x_m": 1.2, "sim.world.start_y_m": 0.8},
    ),
    "our own firmware": (
        "chefbot",
        {"sim.board.sketch": "chefbot", "encoders.counted_by": "firmware"},
    ),
    "a lidar": ("chefbot_lidar", {}),
    "a lidar that is asked": (
        "chefbot_lidar",
        {"lidar": [{"name": "lidar", "model": "rplidar_a1", "device": "/dev/ttyUSB0"}]},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_every_attribute_of_a_driven_robot_is_in_its_state(robot: str) -> None:
    """All that hangs on the parts is the same after a restore, at some thirty moments of an eventful drive."""
    name, keys = ROBOTS[robot]
    count, different = forgotten(eventful, load(packaged(name), overrides=keys))
    assert count > 25
    assert different <= NO_STATE.keys(), different - NO_STATE.keys()


@pytest.mark.slow
def test_every_attribute_of_a_robot_on_its_way_is_in_its_state(tmp_path: Path) -> None:
    """The same with a worker: localization, a turn, goals, mapping."""
    save(MapStore(tmp_path, 3), "flat", FLAT.grid())
    settings = load(packaged("chefbot_lidar"), overrides={"maps.folder": str(tmp_path), **START})
    count, different = forgotten(on_the_way, settings, worker_in_process)
    assert count > 20
    assert different <= NO_STATE.keys(), different - NO_STATE.keys()


def test_a_part_that_forgets_something_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tests above would see it: a state without the time of the last step, and a counter that no state has."""

    def forgetful(self: DriveService, state: DriveServiceState) -> None:
        restore(self, replace(state, acted_s=1.0, watch_timer=replace(state.watch_timer, due_s=None)))

    async def script(robot: SimulatedRobot) -> None:
        await asyncio.sleep(1.2)
        robot.daemon.leases.told = 3  # type: ignore[attr-defined]
        await drive(robot, 0.2, 0.1, 0.5)

    restore = DriveService.restore
    monkeypatch.setattr(DriveService, "restore", forgetful)
    _, different = forgotten(script, load())
    forgotten_ones = {
        "DriveServiceState.acted_s",
        "WatchTimer._timer",
        "WatchTimerState.due_s",
        "ControlLeases.told",
    }
    assert different - NO_STATE.keys() == forgotten_ones


@pytest.mark.parametrize("robot", ROBOTS)
def test_whatever_a_method_of_a_part_changes_is_restored(robot: str) -> None:
    """Also what the drives above do not come to: each such attribute is something odd until the state is put back."""
    name, keys = ROBOTS[robot]

    async def run() -> set[str]:
        daemon = replayed_daemon(load(packaged(name), overrides=keys), None, ReplayEntries())
        return not_restored(daemon.state)

    assert asyncio.run(run()) == set()


def not_restored(state: DaemonState) -> set[str]:
    """The attributes that stay odd. One that is changed in place is missed by the part, which says so."""
    recorded, odd = state.record().parts, set[str]()
    for owner, attribute in list(changed_attributes(state.parts)):
        label, before = f"{type(owner).__name__}.{attribute}", getattr(owner, attribute)
        if label in NO_STATE or isinstance(before, asyncio.Event):
            continue
        setattr(owner, attribute, ODD)
        problems = state.restore(recorded)
        if not problems and any(getattr(*each) is ODD for each in changed_attributes(state.parts)):
            odd.add(label)
        if getattr(owner, attribute) is ODD:
            setattr(owner, attribute, before)
    return odd


class Forgetful:
    """A part that adds up, and offers one of its sums."""

    def __init__(self) -> None:
        self.metres, self.turns, self.names = 0.0, 0, list[str]()
        self.limit = 3.0

    def add(self, metres: float) -> None:
        """So much more."""
        self.metres += min(metres, self.limit)
        self.turns += 1
        self.names.append("a")

    def state(self) -> float:
        """The metres alone."""
        return self.metres

    def restore(self, state: float) -> None:
        """Go on from there."""
        self.metres = state


class Trip(MutableState):
    """A part that is its own state."""

    metres: float = 0.0
    _turns: list[int] = []


def test_a_part_that_is_its_own_state_is_restored_in_place() -> None:
    """Whoever has it sees what was restored, and a state of something else is refused."""
    trip = Trip()
    state = DaemonState(ReplayEntries(), {"trip": trip}, tuple, ())
    assert not_restored(state) == set()
    assert state.restore({"trip": encode_state(Trip(metres=2.5, _turns=[3]))}) == []
    assert (trip.metres, trip._turns) == (2.5, [3])
    (problem,) = state.restore({"trip": encode_state(Trip(metres=2.5, _turns=["left"]))})  # type: ignore[list-item]
    assert "Expected `int`, got `str` - at `$._turns[0]`" in problem
    assert trip.metres == 2.5


class JourneyState(MutableState):
    """A trip, when it ends, whether it has ended, and who travels."""

    trip: Trip
    due_s: float | None = None
    has_ended: bool = False
    name: str = "nobody"


class Journey(StatefulPart[JourneyState]):
    """A part with parts of its own: a trip, a timer and an event."""

    def __init__(self, entries: ReplayEntries) -> None:
        self.trip, self.ended = Trip(), StatefulEvent()
        self.timer = ResumableTimer(entries, self.ended.set, "journey")
        self.memory = JourneyState(self.trip)
        self.parts = {"trip": self.trip, "due_s": self.timer, "has_ended": self.ended}


def test_a_part_of_parts_offers_and_restores_each_of_them() -> None:
    """What is recorded is how the parts stand then; after a restore the timer waits until the same time."""
    entries = ReplayEntries()
    entries.set_time(10.0)
    before, after = Journey(entries), Journey(entries)
    before.trip.metres, before.memory.name = 2.5, "somebody"
    before.timer.start(3.0)
    before.ended.set()
    text = encode_state(before.state())
    after.timer.start(99.0)
    assert DaemonState(entries, {"it": after}, tuple, ()).restore({"it": text}) == []
    assert (after.trip.metres, after.timer.due_s, after.ended.is_set()) == (2.5, 13.0, True)
    assert after.memory.name == "somebody"
    assert after.memory.trip is after.trip
    assert encode_state(after.state()) == text
    before.timer.cancel()
    after.restore(JourneyState(Trip()))
    assert (after.timer.due_s, after.ended.is_set(), before.timer.due_s) == (None, False, None)


@pytest.mark.parametrize("odd", [2**70, object(), {1: object()}])
def test_a_part_that_fails_to_offer_its_state_is_left_out_and_told(odd: Any) -> None:
    """The recorder goes on, or the robot would stop for it; the other parts are in the state."""
    bad, good = Forgetful(), Trip(metres=2.5)
    bad.metres = odd
    recorded = DaemonState(ReplayEntries(), {"sum": bad, "trip": good}, tuple, ()).record()
    assert recorded.parts == {"trip": encode_state(good)}
    (told,) = recorded.left_out
    assert told.startswith("sum: ")


def test_what_a_part_never_offers_is_named() -> None:
    """Counters and lists that a method changes; neither what the state has nor what is never changed."""
    state = DaemonState(ReplayEntries(), {"sum": Forgetful()}, tuple, ())
    assert not_restored(state) == {"Forgetful.turns", "Forgetful.names"}


@pytest.mark.parametrize("robot", ["chefbot", "khan", "chefbot_lidar"])
def test_a_state_holds_plain_values_of_the_types_that_its_class_declares(robot: str) -> None:
    """Nowhere in the class of any part's state does a field take whatever comes, or what only code can make."""

    async def parts() -> list[type[Stateful]]:
        return [
            type(part)
            for part in replayed_daemon(load(packaged(robot)), None, ReplayEntries()).state.parts.values()
        ]

    for part in asyncio.run(parts()):
        assert not set(odd_types(inspect.type_info(state_class(part)))), part


def odd_types(info: Any) -> Iterator[str]:
    """The types in this one that are no plain values, records of them, parameters or arrays."""
    if isinstance(info, inspect.CustomType):
        kind = get_origin(info.cls) or info.cls
        if not issubclass(kind, BaseModel | np.ndarray) and kind is not Counter:
            yield str(kind)
    elif isinstance(info, ODD):
        yield str(info)
    for name in info.__struct_fields__:
        value = getattr(info, name)
        for each in value if isinstance(value, tuple) else (value,):
            if isinstance(each, inspect.Type | inspect.Field):
                yield from odd_types(each)


ODD = (inspect.AnyType, inspect.RawType, inspect.ExtType, inspect.MemoryViewType)
