"""Making a map over the socket: the whole daemon, the real skill in the same process, scans of a simulated flat."""

import asyncio
import contextlib
from base64 import b64decode
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import decompress

import numpy as np
import pytest
from structlog.testing import capture_logs

from chefbotd.bus import Bus
from chefbotd.client import Client
from chefbotd.client.errors import CallError
from chefbotd.clock import Clock, run_virtual
from chefbotd.components.maps.storage.parameters import MapsParameters
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.spawn import Child, Spawn
from chefbotd.core.events import OdometryReset, OdometryUpdated
from chefbotd.core.events.robot import MapPoseUpdated
from chefbotd.core.geometry import CERTAIN, ORIGIN, STANDING, Pose2D
from chefbotd.core.record import replace
from chefbotd.features.feature import Feature
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.settings import Settings, load
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from chefbotd.testing.worker import worker_in_process
from tests.chefbotd.components.worker.skills.drives import measured


def settings(folder: Path, **changed: Any) -> Settings:
    """The ChefBot with a lidar, and a folder for its maps."""
    lidar = LidarParameters(name="top", model="ld19", device="/dev/absent")  # type: ignore[arg-type]
    return load().model_copy(update={"lidar": (lidar,), "maps": MapsParameters(folder=folder), **changed})


class Workers:
    """Workers in this process, of which the present one can be killed."""

    def __init__(self) -> None:
        self.children: list[Child] = []

    async def spawn(self, theirs: Any, parameters: WorkerParameters) -> Child:
        """Start one."""
        child = await worker_in_process(theirs, parameters)
        self.children.append(child)
        return child


@dataclass
class Scene:
    """A daemon that gets scans and odometry as if it had driven through the flat; its board is silent."""

    client: Client
    bus: Bus
    poses: list[MapPoseUpdated]

    async def drive(self, first: int, last: int, odom: Pose2D = ORIGIN) -> None:
        """A part of the tour, ten scans a second; ``odom`` is where the odometry's frame lies meanwhile."""
        begin_s = asyncio.get_running_loop().time() - 0.1 * first + 0.05
        for message in measured(first, last, begin_s=begin_s):
            await asyncio.sleep(max(message.stamp_s - asyncio.get_running_loop().time(), 0.0))
            if isinstance(message, OdometryUpdated):
                pose = odom.inverse().compose(message.odom_from_base)
                message = replace(message, odom_from_base=pose, twist=STANDING)
            self.bus.publish(message)
        await asyncio.sleep(0.2)

    async def data(self, topic: str) -> Any:
        """A topic's latest data."""
        return (await self.client.get_state()).topics[topic].data


@contextlib.asynccontextmanager
async def scene(
    folder: Path, spawn_worker: Spawn = worker_in_process, **changed: Any
) -> AsyncIterator[Scene]:
    """The daemon with a worker that has had a moment."""
    buses: list[Bus] = []

    def probe(bus: Bus, clock: Clock) -> Feature:
        buses.append(bus)
        return Feature("probe")

    device, poses = FakeSerialDevice(), list[MapPoseUpdated]()
    async with running_daemon(
        device, settings(folder, **changed), [probe], spawn_worker=spawn_worker
    ) as client:
        buses[0].add_handler(poses.append, MapPoseUpdated)
        await asyncio.sleep(1.0)
        yield Scene(client, buses[0], poses)


def test_a_map_is_made_and_saved(tmp_path: Path) -> None:
    """start_mapping, a drive, finish_mapping: poses and patches on the way, progress at the end, and files."""

    async def play() -> None:
        async with scene(tmp_path) as s:
            assert (await s.client.call("start_mapping"))["state"] == "mapping"
            await s.drive(0, 60)
            pose, patch = await s.data("map_pose"), await s.data("map")
            assert pose.state == "mapping"
            assert pose.fit > 0.95
            assert len(pose.covariance) == 9
            cells = np.frombuffer(decompress(b64decode(patch.cells)), np.int8)
            assert cells.size == patch.part_rows * patch.part_columns
            assert (await s.data("mapping")).keyframes > 20
            growing = await s.client.get_map()
            assert growing.version == patch.revision
            assert (growing.rows, growing.columns) == (patch.rows, patch.columns)
            assert (np.frombuffer(growing.cells, np.int8) >= 65).sum() > 100
            told: list[float] = []
            saved = await s.client.call(
                "finish_mapping",
                name="our flat",
                on_progress=lambda done, total, text: told.append(done / total),
            )
            assert (saved["name"], saved["version"]) == ("our flat", 1)
            assert told
            assert told[-1] == pytest.approx(0.95)
            assert (await s.data("mapping")).state == "idle"
        assert MapStore(tmp_path).names() == ["our flat"]
        assert (tmp_path / "our flat.pgm").is_file()
        assert MapStore(tmp_path).read_autosave() is None

    run_virtual(play())


@pytest.mark.slow
def test_a_killed_worker_goes_on_by_itself(tmp_path: Path) -> None:
    """Killed in mid-drive it is back after half a second, in the same map, where the robot is."""
    workers = Workers()

    async def play() -> None:
        async with scene(tmp_path, workers.spawn) as s:
            await s.client.call("start_mapping")
            await s.drive(0, 105)
            kept = (await s.data("mapping")).keyframes
            workers.children[0].kill()
            await asyncio.sleep(0.1)
            assert (await s.data("worker")).state == "restarting"
            with pytest.raises(CallError, match="SIGKILL"):
                await s.client.call("pause_mapping")
            await asyncio.sleep(2.0)
            worker = await s.data("worker")
            assert (worker.state, worker.restarts) == ("ready", 1)
            before = len(s.poses)
            await s.drive(105, 130)
            assert len(s.poses) - before >= 24
            assert {pose.state for pose in s.poses[before + 2 :]} == {"mapping"}
            assert (await s.data("mapping")).keyframes > kept
            grown = await s.client.get_map()
            assert (grown.name, grown.saved_at_s) == (None, None)
            assert np.any(grown.grid().percent == 100)
            saved = await s.client.call("finish_mapping", name="flat")
            assert (await s.client.list_maps()).in_use == "flat"
            assert saved["keyframes"] > kept

    run_virtual(play())


@pytest.mark.slow
def test_a_paused_map_stays_paused_in_the_next_worker(tmp_path: Path) -> None:
    """What the person asked for outlives the worker."""
    workers = Workers()

    async def play() -> None:
        async with scene(tmp_path, workers.spawn) as s:
            await s.client.call("start_mapping")
            await s.drive(0, 20)
            await s.client.call("pause_mapping")
            workers.children[0].kill()
            await asyncio.sleep(2.0)
            assert (await s.data("mapping")).state == "paused"
            assert (await s.client.call("start_mapping"))["state"] == "mapping"

    run_virtual(play())


def test_a_map_that_is_paused_before_its_first_scan_stays_paused_in_the_next_worker(tmp_path: Path) -> None:
    """There is nothing to go on with yet, and still no scan is taken in until start_mapping is sent."""
    workers = Workers()

    async def play() -> None:
        async with scene(tmp_path, workers.spawn) as s:
            await s.client.call("start_mapping")
            await s.client.call("pause_mapping")
            workers.children[0].kill()
            await asyncio.sleep(2.0)
            await s.drive(0, 5)
            status = await s.data("mapping")
            assert (status.state, status.keyframes) == ("paused", 0)
            assert (await s.client.call("start_mapping"))["state"] == "mapping"

    run_virtual(play())


@pytest.mark.slow
def test_a_daemon_that_ended_in_mid_mapping_keeps_the_map(tmp_path: Path) -> None:
    """The next daemon says that a map was never finished, and goes on with it when told to."""

    async def play() -> None:
        async with scene(tmp_path) as s:
            await s.client.call("start_mapping")
            await s.drive(0, 40)
            kept = (await s.data("mapping")).keyframes
        async with scene(tmp_path) as s:
            assert (await s.data("mapping")).unfinished, "told without having been asked"
            with pytest.raises(CallError, match="unfinished map"):
                await s.client.call("start_mapping")
            with pytest.raises(CallError, match=r"params: expected name or unfinished, not both"):
                await s.client.call("start_mapping", name="flat", unfinished=True)
            started = await s.client.call("start_mapping", unfinished=True)
            assert started["keyframes"] >= kept
            assert (await s.client.call("discard_mapping"))["state"] == "idle"
            assert (await s.client.call("start_mapping"))["keyframes"] == 0

    run_virtual(play())


@pytest.mark.slow
def test_a_map_of_which_every_autosave_is_damaged_is_never_replaced_in_silence(tmp_path: Path) -> None:
    """Half of each file is lost with the daemon: the topic, the log, a refusal and the new map's answer all say so."""
    lost = "there was an unfinished map, and nothing of it can be read (version "

    async def play() -> None:
        async with scene(tmp_path) as s:
            await s.client.call("start_mapping")
            await s.drive(0, 20)
        for graph in (tmp_path / ".autosave.map").glob("v*/slam.npz"):
            graph.write_bytes(graph.read_bytes()[: graph.stat().st_size // 2])
        async with scene(tmp_path) as s:
            before = await s.data("mapping")
            assert (before.unfinished, before.warning[: len(lost)]) == (False, lost)
            with pytest.raises(CallError, match="nothing of it can be read") as refused:
                await s.client.call("start_mapping", unfinished=True)
            assert refused.value.kind == "map_unreadable"
            assert (await s.client.start_mapping()).warning == before.warning
            assert (await s.data("mapping")).warning == before.warning

    with capture_logs() as log:
        run_virtual(play())
    assert "the unfinished map is damaged" in [entry["event"] for entry in log]


def test_a_lidar_that_falls_silent_is_said_while_a_map_is_made(tmp_path: Path) -> None:
    """Odometry goes on: ``mapping.reason`` and the log say that nothing is added, and for how long."""

    async def play() -> None:
        async with scene(tmp_path) as s:
            await s.client.call("start_mapping")
            await s.drive(0, 10)
            assert (await s.data("mapping")).reason == ""
            for _ in range(35):
                now_s = asyncio.get_running_loop().time()
                s.bus.publish(OdometryUpdated(now_s, now_s, Pose2D(0.3), STANDING, CERTAIN))
                await asyncio.sleep(0.1)
            assert (await s.data("mapping")).reason == "no scan of the lidar 'top' for 3 s"

    with capture_logs() as log:
        run_virtual(play())
    assert "the unfinished map has a problem" in [entry["event"] for entry in log]


def test_a_reset_of_the_odometry_is_no_motion_of_the_map(tmp_path: Path) -> None:
    """Somebody declares another pose in odom in mid-drive: the robot is where it was in the map, and not lost."""
    elsewhere = Pose2D(5.0, -7.0, 2.0)

    async def play() -> None:
        async with scene(tmp_path) as s:
            await s.client.call("start_mapping")
            await s.drive(0, 40)
            before = s.poses[-1]
            s.bus.publish(OdometryReset(asyncio.get_running_loop().time(), elsewhere, ORIGIN))
            await s.drive(40, 60, odom=elsewhere)
            assert {pose.state for pose in s.poses} == {"mapping"}
            moved = before.map_from_base.inverse().compose(s.poses[-1].map_from_base)
            assert abs(moved.x_m) + abs(moved.y_m) < 2.5
            after = s.poses[-1]
            there = after.map_from_odom.compose(after.map_from_odom.inverse().compose(after.map_from_base))
            assert there.x_m == pytest.approx(after.map_from_base.x_m)
            shift = before.map_from_odom.compose(elsewhere)
            assert (after.map_from_odom.x_m, after.map_from_odom.y_m) == pytest.approx(
                (shift.x_m, shift.y_m), abs=0.3
            )

    run_virtual(play())


def test_a_robot_without_a_lidar_has_no_mapping(tmp_path: Path) -> None:
    """No method and no topic, and no worker."""

    async def play() -> None:
        async with running_daemon(FakeSerialDevice()) as client:
            description = await client.describe()
            assert "start_mapping" not in description.methods
            assert not {"map", "map_pose", "mapping", "worker"} & description.topics.keys()

    run_virtual(play())


def test_a_worker_can_be_switched_off(tmp_path: Path) -> None:
    """[worker] enabled = false: the lidar guards, and nothing is mapped."""

    async def play() -> None:
        changed = {"worker": WorkerParameters(enabled=False)}
        async with running_daemon(FakeSerialDevice(), settings(tmp_path, **changed)) as client:
            assert "start_mapping" not in (await client.describe()).methods

    run_virtual(play())
