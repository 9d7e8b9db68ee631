"""Lidars in the daemon: what its socket tells of them, and what a daemon without one does not load."""

import asyncio
import math
import subprocess
import sys
from collections.abc import Awaitable, Callable

import numpy as np
import pytest

from chefbotd.client import Client, NotReported
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import Pose2D
from chefbotd.core.scan import LaserScan
from chefbotd.driving.lidars.service import scan_data
from chefbotd.settings import load
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from tests.fakes.lidar import ld19_packets, noisy_box
from tests.waiting import PATIENCE_S

TOP = {"name": "top", "model": "ld19", "device": "/dev/top", "mount_x_m": 0.11, "mount_yaw_rad": 0.7}
LOW = {"name": "low", "model": "rplidar_a1", "device": "/dev/low"}

Story = Callable[[Client, FakeSerialDevice], Awaitable[None]]


def run(story: Story) -> None:
    """A daemon with two lidars, of which the first is there."""

    async def scenario() -> None:
        device = FakeSerialDevice()
        settings = load(overrides={"lidar": [TOP, LOW]})
        async with running_daemon(FakeSerialDevice(), settings, lidars={"top": device}) as robot:
            await asyncio.sleep(0.1)
            await story(robot, device)

    run_virtual(scenario())


async def feed(device: FakeSerialDevice, seconds: float) -> None:
    """What an LD19 sends in that time."""
    begin_s = LoopClock().now_s()
    for at_s, data in ld19_packets(noisy_box()):
        if at_s > seconds:
            return
        await asyncio.sleep(max(0.0, begin_s + at_s - LoopClock().now_s()))
        device.feed(data)


def test_the_topic_scan_tells_turns_in_millimetres() -> None:
    """450 beams of 0.8 degrees, clockwise, so a negative step; the wall at the left (90 degrees CCW) 1 m away."""

    async def story(robot: Client, device: FakeSerialDevice) -> None:
        async with robot.subscribe("scan", policy="ordered") as scans:
            feeding = asyncio.create_task(feed(device, 1.0))
            event = await anext(scans)
            await feeding
        data = event.data
        assert (data.lidar, data.x_m, data.y_m, data.yaw_rad) == ("top", 0.11, 0.0, 0.7)
        assert (len(data.range_mm), data.bearing_mrad) == (450, None)
        assert data.bearing_step_rad == pytest.approx(-math.radians(0.8), abs=1e-6)
        left = round((-3 * math.pi / 2 - data.bearing_start_rad) / data.bearing_step_rad)
        assert data.range_mm[left] == pytest.approx(1000, abs=30)
        assert data.duration_s == pytest.approx(0.1, abs=0.003)

    run(story)


def test_the_topic_lidars_tells_which_one_measures() -> None:
    """The one that is fed is healthy; the other's device is not there, and why is said."""

    async def story(robot: Client, device: FakeSerialDevice) -> None:
        await feed(device, 1.5)
        top, low = (await robot.get_state()).lidars.lidars
        assert (top.lidar, top.model, top.device, top.state) == ("top", "ld19", "/dev/top", "up")
        assert (top.healthy, top.condition, top.reason) == (True, "healthy", "")
        assert (low.lidar, low.state, low.healthy, low.condition) == ("low", "down", False, "down")
        assert "no such device" in low.reason

    run(story)


def test_what_lidars_send_is_counted() -> None:
    """By lidar, and what was passed over by its reason: noise of four bytes."""

    async def story(robot: Client, device: FakeSerialDevice) -> None:
        device.feed(b"\x01\x02\x03\x04")
        await feed(device, 1.0)
        stats = await robot.call("get_stats")
        assert stats["lidar_scans"] == {"top": 9, "low": 0}
        assert stats["lidar_packets"]["top"] == pytest.approx(375, abs=5)
        assert stats["lidar_refused"]["top noise"] == 4
        assert stats["lidar_opens"] == {"top": 1, "low": 0}
        assert stats["lidar_bytes_in"]["top"] == 4 + 47 * stats["lidar_packets"]["top"]

    run(story)


def test_a_robot_without_a_lidar_has_none_of_it() -> None:
    """No topic, no figure, and no state."""

    async def scenario() -> None:
        async with running_daemon(FakeSerialDevice()) as robot:
            assert {"scan", "lidars"} & (await robot.call("describe"))["topics"].keys() == set()
            assert not any(name.startswith("lidar") for name in await robot.call("get_stats"))
            with pytest.raises(NotReported):
                _ = (await robot.get_state()).lidars

    run_virtual(scenario())


def test_uneven_beams_are_told_each_with_its_bearing() -> None:
    """Three beams at 0.1, 0.5 and 0.6 rad; a reading that is none is 0, whatever stood for it."""
    bearing = np.array([0.1, 0.5, 0.6])
    scan = LaserScan(7.0, bearing, np.array([1.2345, math.inf, math.nan]), np.array([-0.02, -0.01, 0.0]))
    data = scan_data(ScanMeasured(7.0, "top", Pose2D(), scan))
    assert (data.bearing_step_rad, data.bearing_mrad) == (None, (100, 500, 600))
    assert data.range_mm == (1234, 0, 0)
    assert data.duration_s == 0.02


def test_an_empty_scan_is_told_as_one() -> None:
    """No beam at all."""
    nothing = np.zeros(0)
    data = scan_data(ScanMeasured(7.0, "top", Pose2D(), LaserScan(7.0, nothing, nothing, nothing)))
    assert (data.range_mm, data.bearing_mrad, data.bearing_step_rad) == ((), None, 0.0)


def test_what_the_client_reads_loads_no_numpy() -> None:
    """The models of the topics are for programs that may have none."""
    code = "import sys, chefbotd.client.models; print('numpy' in sys.modules)"
    said = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=PATIENCE_S
    )
    assert said.stdout.strip() == "False"
