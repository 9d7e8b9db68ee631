"""What the helpers give a robot with lidars, and among people."""

import asyncio
from pathlib import Path

import numpy as np

from chefbotd.clock import run_virtual
from chefbotd.core.events.lidars import LidarChanged
from chefbotd.rpc.encoding import plain
from chefbotd.settings import load
from chefbotd.testing.daemon import running_daemon, simulated_robot
from chefbotd.testing.transport import FakeSerialDevice
from firmware_protocol.lidar.ld19 import Ld19Packet, encode
from tests.robot_files import full

LIDARS = [
    {"name": "nose", "model": "ld19", "device": "/dev/nose"},
    {"name": "tail", "model": "ld06", "device": "/dev/rear"},
]


def test_each_lidar_is_opened_on_its_own_device_in_memory() -> None:
    """Of two lidars one is plugged in: its bytes make a scan; the other is told as unplugged; the board has its own."""

    async def scenario() -> list[str]:
        board, nose = FakeSerialDevice(), FakeSerialDevice()
        told: list[str] = []
        settings = load(overrides={"lidar": LIDARS})
        async with (
            running_daemon(board, settings, lidars={"nose": nose}) as client,
            client.subscribe("lidars") as events,
            client.subscribe("scan") as scans,
        ):
            for k in range(120):
                start, end = k * 960 % 36_000, (k * 960 + 880) % 36_000
                packet = Ld19Packet(3600, start, end, (1500 + k,) * 12, (200,) * 12, round(k * 2.667))
                nose.feed(encode(packet))
                await asyncio.sleep(0.002667)
            scan = plain((await anext(scans)).data)
            assert scan["lidar"] == "nose"
            assert set(scan["range_mm"]) <= set(range(1500, 1620))
            lidars = plain((await anext(events)).data)["lidars"]
            told += [f"{each['lidar']} {each['state']}" for each in lidars]
        assert board.transport is not nose.transport
        return told

    told = run_virtual(scenario())
    assert "nose up" in told
    assert "tail down" in told


def test_people_and_things_of_the_configuration_are_there(tmp_path: Path) -> None:
    """From a file: somebody who walks, and a bag; more is put there while it runs."""
    told = full("chefbot_lidar").read_text() + (
        "[[sim.people]]\npath_m = [[5.0, 3.9], [8.0, 4.1]]\nspeed_m_s = 1.2\nstops_for_robot = false\n"
        "[[sim.things]]\nx_m = 1.0\ny_m = 3.9\nradius_m = 0.2\n"
    )
    (tmp_path / "busy.toml").write_text(told)

    async def scenario() -> None:
        async with simulated_robot(load(tmp_path / "busy.toml")) as robot:
            changes: list[LidarChanged] = []
            robot.daemon.bus.add_handler(changes.append, LidarChanged)
            before = robot.board.crowd.discs
            await asyncio.sleep(1.0)
            robot.board.crowd.put("chair", 2.5, 3.9)
            after = robot.board.crowd.discs
            assert before[1].tolist() == after[1].tolist() == [1.0, 3.9, 0.2]
            assert 0.9 < np.hypot(*(after[0] - before[0])[:2]) < 1.5
            assert after[2].tolist() == [2.5, 3.9, 0.25]
            assert set(robot.lidars) == {"lidar"}

    run_virtual(scenario())
