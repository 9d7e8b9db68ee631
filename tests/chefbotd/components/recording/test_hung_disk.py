"""A disk that hangs, under the whole daemon: on a virtual clock, in which the disk's thread never gets anywhere."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.components.recording.chunk_encoder import ChunkEncoder
from chefbotd.components.recording.recorder import Recorder
from chefbotd.components.recording.writer import InlineWriter, MakeRecorder, WriterThread
from chefbotd.testing.daemon import simulated_robot
from tests.chefbotd.components.recording.disks import FailingDisk
from tests.chefbotd.components.recording.test_recording import drive, settings


def test_a_robot_whose_disk_hangs_drives_on(tmp_path: Path) -> None:
    """Whoever asks for a recording is told after fifteen seconds; meanwhile not one control step is missed.

    What waits stays bounded, what finds no room is counted and told, and the daemon ends within its time.
    """
    disk = FailingDisk()
    disk.goes_on.clear()

    def hanging(make: MakeRecorder, most_bytes: int) -> WriterThread:
        def with_this_disk() -> tuple[ChunkEncoder, Recorder]:
            encoder, made = make()
            made._disk = disk
            return encoder, made

        writer = WriterThread(with_this_disk, 200_000)
        writer.ready.result(20.0)  # no time passes on the virtual clock meanwhile
        return writer

    async def main() -> None:
        async with simulated_robot(settings(tmp_path), start_writer=hanging) as robot:
            await robot.client.wait_until_armed()
            began_s, steps = asyncio.get_running_loop().time(), robot.board.truth(0.0).world_from_base.x_m
            asking = asyncio.ensure_future(robot.client.start_recording("never"))
            before = (await robot.client.call("get_stats"))["control_steps"]
            await drive(robot, 20.0)
            after = (await robot.client.call("get_stats"))["control_steps"]
            assert after - before >= 20.0 / 0.05 - 2
            assert robot.board.truth(0.0).world_from_base.x_m != steps
            with pytest.raises(CallError, match="has not answered for 15 s") as refused:
                await asking
            assert refused.value.kind == "storage_failed"
            told = (await robot.client.call("get_state"))["topics"]["recording"]["data"]
            assert told["dropped"] > 1000
            assert "does not answer" in told["reason"]
            assert told["state"] == "idle"
            assert asyncio.get_running_loop().time() - began_s < 35.0

    run_virtual(main())
    disk.goes_on.set()


class HeldUpWriter(InlineWriter):
    """On a busy computer: it comes to what was left there only each 2.5 s, and then to all of it."""

    def __init__(self, make: MakeRecorder, most_bytes: int) -> None:
        super().__init__(make, most_bytes)
        self._left: list[Callable[[Recorder], object]] = []
        asyncio.get_running_loop().call_later(2.5, self._come)

    def _put(self, work: Callable[[Recorder], object]) -> None:
        self._left.append(work)

    def _come(self) -> None:
        left, self._left = self._left, []
        for work in left:
            work(self.recorder)
        asyncio.get_running_loop().call_later(2.5, self._come)


def test_a_thread_that_is_held_up_is_no_disk_that_hangs(tmp_path: Path) -> None:
    """In ten seconds, in each of which something waits for it, nothing is said of the disk."""

    async def main() -> None:
        async with simulated_robot(settings(tmp_path), start_writer=HeldUpWriter) as robot:
            await robot.client.wait_until_armed()
            for _ in range(20):
                await drive(robot, 0.5)
                told = (await robot.client.call("get_state"))["topics"]["recording"]["data"]
                assert told["reason"] == ""

    with capture_logs() as logs:
        run_virtual(main())
    assert not [each for each in logs if each["event"] == "recording has a problem"]
