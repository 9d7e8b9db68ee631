"""The daemon with a depth camera in the flat: what a lidar does not see becomes a scan."""

import asyncio
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.depth_camera.simulated.spawn import SimulatedDepthChild
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.core.events.lidars import DepthCameraChanged, ScanMeasured
from chefbotd.rpc.encoding import plain
from chefbotd.settings import SettingsError, load, packaged
from chefbotd.settings.model import Settings
from chefbotd.testing.daemon import simulated_robot
from chefbotd.testing.worker import worker_in_process
from tests.budget import sample

EYE: Mapping[str, object] = {
    "name": "eye",
    "width": 160,
    "height": 120,
    "focal_x_px": 146.0,
    "focal_y_px": 146.0,
    "center_x_px": 80.0,
    "center_y_px": 60.0,
    "beams": 80,
    "mount_x_m": 0.1,
    "mount_height_m": 0.6,
    "mount_pitch_rad": 0.15,
    "rate_hz": 5.0,
}
BEFORE_THE_TABLE = {"map_path": "flat", "start_x_m": 2.2, "start_y_m": 1.5, "start_heading_rad": 0.0}


def settings(robot: str = "chefbot_lidar", **overrides: object) -> Settings:
    """A robot with the camera, a metre before the dining table."""
    told = {"depth_camera": [dict(EYE)], "sim.world": dict(BEFORE_THE_TABLE), **overrides}
    return load(packaged(robot), overrides=told)


def test_a_table_is_in_the_cameras_scan_and_not_in_the_lidars() -> None:
    """Both publish: the camera's nearest ahead is the table's edge at 1.0 m, the lidar sees beneath it, beyond 2 m."""
    scans: dict[str, ScanMeasured] = {}
    told: list[tuple[str, bool]] = []

    async def scenario() -> None:
        async with simulated_robot(settings()) as robot:
            robot.daemon.bus.add_handler(lambda event: scans.update({event.lidar: event}), ScanMeasured)
            robot.daemon.bus.add_handler(lambda e: told.append((e.camera, e.healthy)), DepthCameraChanged)
            await asyncio.sleep(3.0)

    run_virtual(scenario())
    eye, lidar = scans["eye"], scans["lidar"]
    ahead = np.abs(eye.scan.bearing_rad) < 0.08
    assert np.median(eye.scan.range_m[ahead]) == pytest.approx(1.0, abs=0.03)
    beam = np.abs((lidar.scan.bearing_rad + math.pi) % math.tau - math.pi) < 0.08
    read = lidar.scan.range_m[beam]
    assert read[read > 0].min() > 2.0
    assert (eye.base_from_lidar.x_m, told) == (0.1, [("eye", True)])
    assert eye.scan.range_m.min() >= 0.0
    assert np.isfinite(eye.scan.range_m).all()


@pytest.mark.parametrize("robot_name", ["chefbot", "chefbot_lidar"])
def test_scans_and_health_are_on_the_socket_with_and_without_a_lidar(robot_name: str) -> None:
    """The topics ``scan`` and ``depth_cameras``; figures of both kinds."""

    async def scenario() -> None:
        async with simulated_robot(settings(robot_name)) as robot:
            await asyncio.sleep(1.0)
            async with asyncio.timeout(5):
                async with robot.client.subscribe("depth_cameras") as events:
                    assert plain((await anext(events)).data)["cameras"][0]["healthy"] is True
                async with robot.client.subscribe("scan") as events:
                    while (scan := plain((await anext(events)).data))["lidar"] != "eye":
                        pass
            assert len(scan["range_mm"]) == 80
            stats = await robot.client.call("get_stats")
            assert stats["depth_scans"]["eye"] >= 3

    run_virtual(scenario())


def test_a_robot_without_a_depth_camera_has_nothing_of_it() -> None:
    """No topic."""

    async def scenario() -> None:
        async with simulated_robot(load()) as robot:
            assert "depth_cameras" not in {topic.name for f in robot.daemon.features for topic in f.topics}

    run_virtual(scenario())


TALL = {
    "sim.body.height_m": 0.9,
    "sim.ultrasonic.max_range_m": 10.0,  # without an echo the published sketch is silent for a second
}


@pytest.mark.slow
@pytest.mark.parametrize("guards", sample([True, False]))
def test_a_tall_robot_stops_before_a_tables_top_and_only_the_camera_sees_it(guards: bool) -> None:
    """Three times towards the edge, at 0.2 m/s for 6 s each: it never touches; without the camera's guard it does."""

    async def scenario() -> None:
        told = settings("chefbot", depth_camera=[{**EYE, "guards": guards}], **TALL)
        async with simulated_robot(told) as robot:
            await asyncio.sleep(3.0)
            for _ in range(3):
                await robot.client.drive_for(6.0, 0.2)
                await asyncio.sleep(1.0)  # it stands so near that the camera does not see the edge any more
            truth = robot.board.truth(0.0)
            to_edge_m = 3.3 - 0.18 - truth.world_from_base.x_m
            assert truth.in_contact is not guards
            assert (0.05 < to_edge_m < 0.35) if guards else (abs(to_edge_m) < 0.01)

    run_virtual(scenario())


@pytest.mark.slow
def test_beside_the_table_the_camera_lets_it_drive_away() -> None:
    """After the stop: back by a third of a metre, then turned towards the free floor and on."""

    async def scenario() -> None:
        async with simulated_robot(settings("chefbot", **TALL)) as robot:
            await asyncio.sleep(3.0)
            await robot.client.drive_for(6.0, 0.2)
            stopped = robot.board.truth(0.0).world_from_base
            await robot.client.drive_for(2.0, -0.15)
            await robot.client.drive_for(4.0, 0.0, 0.6)
            await robot.client.drive_for(3.0, 0.15)
            moved = robot.board.truth(0.0)
            assert (
                math.dist((moved.world_from_base.x_m, moved.world_from_base.y_m), (stopped.x_m, stopped.y_m))
                > 0.4
            )
            assert not moved.in_contact

    run_virtual(scenario())


def test_a_camera_that_hangs_leaves_a_crawl_and_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its process stands still: told as silent half a second later; started again, nothing limits the robot."""
    hangs = False
    read = SimulatedDepthChild.read

    async def read_or_hang(child: SimulatedDepthChild) -> bytes:
        await asyncio.sleep(1e6 if hangs else 0)
        return await read(child)

    monkeypatch.setattr(SimulatedDepthChild, "read", read_or_hang)

    async def scenario() -> None:
        nonlocal hangs
        away = {**BEFORE_THE_TABLE, "start_heading_rad": 2.4}
        told = settings("chefbot", **{**TALL, "sim.world": away, "safety.guard.enabled": True})
        async with simulated_robot(told) as robot:
            await asyncio.sleep(3.0)
            hangs = True
            await asyncio.sleep(0.7)
            await robot.client.drive(0.0, 1.0)
            await asyncio.sleep(0.2)
            crawling = (await robot.client.get_state()).safety
            await robot.client.stop()
            hangs = False
            await asyncio.sleep(5.0)
            await robot.client.drive(0.0, 1.0)
            await asyncio.sleep(0.2)
            free = (await robot.client.get_state()).safety
            assert (crawling.limited_by, free.limited_by) == ("silent:eye", None)

    run_virtual(scenario())


def test_names_are_the_cameras_own() -> None:
    """One that is called as the lidar is refused."""
    with pytest.raises(SettingsError, match="lidars and depth cameras need names of their own"):
        settings(depth_camera=[{**EYE, "name": "lidar"}])


BESIDE_THE_COFFEE_TABLE = {
    "map_path": "flat",
    "start_x_m": 2.3,
    "start_y_m": 0.9,
    "start_heading_rad": 2.2,
}


@pytest.mark.slow
@pytest.mark.parametrize("sees", sample([True, False]))
def test_a_tall_robot_plans_and_drives_to_its_goal_round_a_table_that_only_the_camera_sees(
    tmp_path: Path, sees: bool
) -> None:
    """The coffee table is in the straight way. Its edge is an obstacle between the legs, where a lidar sees nothing."""
    save(MapStore(tmp_path, 3), "flat", FLAT.grid())
    cameras, edge = [dict(EYE)] if sees else [], (1.905, 1.58)
    told = settings(
        depth_camera=cameras,
        **TALL,
        **{"maps.folder": str(tmp_path), "sim.world": dict(BESIDE_THE_COFFEE_TABLE)},
    )

    async def scenario() -> None:
        async with simulated_robot(told, spawn_worker=worker_in_process) as robot:
            await asyncio.sleep(1.5)
            await robot.client.load_map("flat")
            await robot.client.set_pose(2.3, 0.9, 2.2)
            async with robot.client.subscribe("obstacles") as events:
                told_of = [(await anext(events)).data for _ in range(12)]
            points = list(zip(told_of[-1].x_m, told_of[-1].y_m, strict=True))
            assert any(math.dist(point, edge) < 0.15 for point in points) is sees, points
            if sees:
                await asyncio.wait_for(robot.client.navigate_to(x_m=1.2, y_m=2.4), 60.0)
                truth = robot.board.truth(asyncio.get_running_loop().time())
                at = truth.world_from_base
                assert math.dist((at.x_m, at.y_m), (1.2, 2.4)) < 0.06
                assert not truth.in_contact

    run_virtual(scenario())
