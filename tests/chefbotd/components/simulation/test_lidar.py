"""Lidars in an event loop: on the virtual clock, and each on a pseudo-terminal of its own."""

import asyncio
import json
import os
from pathlib import Path

import pytest

from chefbotd.clock import LoopClock, SystemClock, run_virtual
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.embedded import EmbeddedBoard
from chefbotd.components.simulation.lidar import LidarFault, LidarRunner
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.simulate import simulate
from chefbotd.components.simulation.simulation import Simulation, build_launchpad, build_lidars
from chefbotd.components.simulation.spinning import LidarMount
from chefbotd.core.geometry import Pose2D
from firmware_protocol.lidar.ld19 import Ld19Decoder
from tests.waiting import PATIENCE_S

IN_FLAT = SimulationParameters.model_validate({"world": {"map_path": Path("flat")}})
TWO = (LidarMount("front", Pose2D(0.1, 0.0, 0.3)), LidarMount("rear one/2", Pose2D(-0.1, 0.0, 3.0)))


def test_bytes_come_as_they_leave_the_lidar_and_faults_come_and_go() -> None:
    """375 packets a second, none in a silence, none that turns in a stall; all the same twice."""

    async def scenario() -> tuple[list[int], bytes]:
        clock, heard = LoopClock(), bytearray()
        simulation = Simulation(IN_FLAT, lidars=TWO[:1])
        board = BoardRunner(build_launchpad(simulation), lambda _: None, clock)
        runner = LidarRunner(build_lidars(simulation)["front"], board, heard.extend, clock)
        task = asyncio.create_task(runner.run())
        decoder, counts = Ld19Decoder(), []
        for fault in (None, LidarFault.SILENT, LidarFault.STALLED, None):
            runner.fault = fault
            begin = len(heard)
            await asyncio.wait({task}, timeout=1.0)
            read = decoder.feed_bytes(bytes(heard[begin:]))
            counts += [len(read), sum(packet.speed_deg_s == 0 for packet in read)]
        task.cancel()
        return counts, bytes(heard)

    counts, heard = run_virtual(scenario())
    first, still, silent, _, stalled, stuck, last, _ = counts
    assert first == pytest.approx(375, abs=5)
    assert (still, silent) == (0, 0)
    assert stuck >= stalled - 5 >= 365
    assert last == pytest.approx(375, abs=5)
    assert run_virtual(scenario()) == (counts, heard)


async def packets_on(device: Path, count: int) -> Ld19Decoder:
    """Open a lidar's device and read until so many packets have come."""
    decoder, descriptor = Ld19Decoder(), os.open(device, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
    try:
        async with asyncio.timeout(PATIENCE_S):
            while decoder.packets < count:
                await asyncio.sleep(0.02)
                try:
                    decoder.feed_bytes(os.read(descriptor, 65_536))
                except BlockingIOError:
                    continue
    finally:
        os.close(descriptor)
    return decoder


@pytest.mark.realtime
def test_each_lidar_has_a_device_beside_the_boards() -> None:
    """Two lidars, one of a name that no file has: both are opened and read, and gone with the board."""

    async def scenario() -> list[Path]:
        with EmbeddedBoard(Simulation(IN_FLAT, lidars=TWO), SystemClock()) as board:
            running = asyncio.create_task(board.run(lambda _: None))
            devices = list(board.lidar_devices.values())
            assert [device.name for device in devices] == ["board-front", "board-1"]
            decoders = await asyncio.gather(*[packets_on(device, 100) for device in devices])
            running.cancel()
            assert (
                sum(sum(decoder.refused.values()) for decoder in decoders) < 200
            )  # the first packet may be half
        return devices

    assert not any(device.exists() for device in asyncio.run(scenario()))


@pytest.mark.realtime
def test_simulate_says_each_lidars_device_after_the_boards(tmp_path: Path) -> None:
    """Two lines more, in the order of the configuration; with a link, theirs are beside it."""
    said: list[str] = []

    async def words():  # type: ignore[no-untyped-def]
        link = tmp_path / "robot-front"
        await packets_on(link, 20)
        yield "quit"

    simulation = Simulation(IN_FLAT, lidars=TWO)
    asyncio.run(
        simulate(simulation, link_path=tmp_path / "robot", as_json=True, commands=words(), say=said.append)
    )
    board, front, rear = (json.loads(line) for line in said)
    assert list(board) == ["device"]
    assert [front["lidar"], rear["lidar"]] == ["front", "rear one/2"]
    assert len({board["device"], front["device"], rear["device"]}) == 3
    assert list(tmp_path.iterdir()) == []
