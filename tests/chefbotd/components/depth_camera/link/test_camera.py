"""A depth camera's process as the daemon sees it: scans, and every way in which it may fail."""

import asyncio
import os
import random
import signal
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, SystemClock, run_virtual
from chefbotd.components.depth_camera.link.camera import DepthCamera
from chefbotd.components.depth_camera.link.process import (
    BEARINGS,
    SCAN,
    CameraProcess,
    DepthChild,
    encode,
    spawn_program,
)
from chefbotd.components.depth_camera.parameters import DepthSourceParameters
from chefbotd.core.events.lidars import DepthCameraChanged, ScanMeasured
from tests.waiting import PATIENCE_S

BEARS = encode(BEARINGS, 0.0, np.array([-0.5, 0.25]))
SEES = encode(SCAN, 3.5, np.array([1.5, 0.0]))
MOUNTED = {
    "name": "eye",
    "mount_x_m": 0.1,
    "mount_y_m": -0.05,
    "mount_yaw_rad": 0.3,
    "silence_timeout_s": 2.0,
}


class Script:
    """Processes that write and end as told; each step is bytes, a pause in seconds, or the end (None)."""

    def __init__(self, *runs: Sequence[bytes | float | None] | OSError) -> None:
        self._runs = list(runs)
        self.ended = 0

    async def spawn(self, parameters: DepthSourceParameters) -> DepthChild:
        """The next run."""
        run = self._runs.pop(0) if self._runs else (1e6,)
        if isinstance(run, OSError):
            raise run
        return ScriptedChild(self, list(run))


class ScriptedChild:
    """One run."""

    def __init__(self, script: Script, steps: list[bytes | float | None]) -> None:
        self._script, self._steps = script, steps

    async def read(self) -> bytes:
        """The next bytes."""
        while self._steps:
            step = self._steps.pop(0)
            if step is None:
                return b""
            if isinstance(step, bytes):
                return step
            await asyncio.sleep(step)
        return b""

    async def end(self) -> str:
        """As a process that said why."""
        self._script.ended += 1
        return "no camera is plugged in"


def seen(script: Script, seconds: float) -> tuple[list[ScanMeasured], list[tuple[bool, str]], DepthCamera]:
    """What is published within so many virtual seconds."""

    async def scenario() -> tuple[list[ScanMeasured], list[tuple[bool, str]], DepthCamera]:
        bus, scans, told = Bus(), [], []  # type: ignore[var-annotated]
        bus.add_handler(scans.append, ScanMeasured)
        bus.add_handler(lambda event: told.append((event.healthy, event.reason)), DepthCameraChanged)
        parameters = DepthSourceParameters.model_validate(MOUNTED)
        camera = DepthCamera(parameters, bus, LoopClock(), script.spawn, random.Random(1))
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(camera.run(), seconds)
        return scans, told, camera

    return run_virtual(scenario())


def test_each_image_is_a_scan_with_the_cameras_mount() -> None:
    """Bearings once, then a scan for each image, stamped by the camera's process."""
    scans, told, camera = seen(Script([BEARS + SEES[:9], SEES[9:] + SEES, 1e6]), 1.0)
    assert [scan.stamp_s for scan in scans] == [3.5, 3.5]
    first, mount = scans[0], scans[0].base_from_lidar
    assert (first.lidar, mount.x_m, mount.y_m, mount.heading_rad) == ("eye", 0.1, -0.05, 0.3)
    assert first.scan.bearing_rad.tolist() == [-0.5, 0.25]
    assert first.scan.range_m.tolist() == [1.5, 0.0]
    assert first.scan.after_s.tolist() == [0.0, 0.0]
    assert (told, camera.scans, camera.starts) == ([(True, "")], 2, 1)


def test_a_camera_that_falls_silent_is_ended_and_started_again() -> None:
    """Two seconds without an image: told, killed, and well again with the next process."""
    script = Script([BEARS, SEES, 1e6], [BEARS, SEES, 1e6])
    scans, told, camera = seen(script, 4.5)
    assert [healthy for healthy, _ in told] == [True, False, True]
    assert "no image for 2 s" in told[1][1]
    assert (len(scans), camera.starts, script.ended) == (2, 2, 2)  # the second at the end of the run


def test_one_that_never_sends_an_image_has_time_to_start_and_then_no_more() -> None:
    """15 s for the first image; then it is ended."""
    _, told, camera = seen(Script([BEARS, 1e6]), 15.5)
    assert told == [(False, "no image for 15 s: is the camera plugged in, or does its library hang?")]
    assert camera.starts == 1


def test_a_camera_that_is_not_there_is_tried_ever_more_rarely_and_told_once() -> None:
    """Its process ends with a reason each time: 1, 2, 4, 8, 16, 30 s between the starts, give or take a fifth."""
    _, told, camera = seen(Script(*[[None]] * 50), 74.0)
    assert told == [(False, "no camera is plugged in")]
    assert camera.starts == 7
    for seconds, starts in ((0.7, 1), (1.3, 2), (2.3, 2), (3.7, 3)):
        assert seen(Script(*[[None]] * 50), seconds)[2].starts == starts


@pytest.mark.parametrize(
    ("bad", "told"),
    [
        (b"Segmentation fault, core dumped", "expected a scan"),
        (BEARS + encode(SCAN, 1.0, np.zeros(3)), "3 ranges for 2 bearings"),
    ],
)
def test_bytes_that_are_no_scans_end_the_process(bad: bytes, told: str) -> None:
    """What is no message is published by nobody."""
    scans, changes, _ = seen(Script([bad, 1e6]), 1.0)
    assert scans == []
    assert told in changes[0][1]


def test_a_process_that_cannot_be_started_is_told() -> None:
    """No memory for another process."""
    told = seen(Script(OSError(12, "Cannot allocate memory")), 1.0)[1]
    assert told == [(False, "its process cannot be started: Cannot allocate memory")]


def folder_camera(folder: Path) -> DepthSourceParameters:
    """A camera of 8 by 6 pixels from a folder: a wall at 2 m over two rows, the band from the floor to 1 m."""
    Image.fromarray(np.full((6, 8), 2000, np.uint16)).save(folder / "wall.png")
    optics = {"width": 8, "height": 6, "focal_x_px": 8, "focal_y_px": 8, "center_x_px": 4, "center_y_px": 3}
    told = {"source": "folder", "folder": folder, "beams": 4, "rate_hz": 20, "silence_timeout_s": 1.0}
    return DepthSourceParameters.model_validate({**optics, **told})


@pytest.mark.realtime
def test_the_real_process_plays_a_folder_is_frozen_and_comes_back(tmp_path: Path) -> None:
    """SIGSTOP in the middle, as if its library hung: told, killed, started again. At the end none is left."""
    children: list[DepthChild] = []

    async def spawn(parameters: DepthSourceParameters) -> DepthChild:
        children.append(await spawn_program(parameters))
        return children[-1]

    async def scenario() -> list[ScanMeasured]:
        bus, scans, frozen = Bus(), [], asyncio.Event()  # type: ignore[var-annotated]
        camera = DepthCamera(folder_camera(tmp_path), bus, SystemClock(), spawn, random.Random(1))

        def take(scan: ScanMeasured) -> None:
            scans.append(scan)
            if len(scans) == 3:
                os.kill(pid(children[-1]), signal.SIGSTOP)
            if len(children) > 1 and len(scans) > 6:  # a busy computer may have had it start once more
                frozen.set()

        bus.add_handler(take, ScanMeasured)
        running = asyncio.create_task(camera.run())
        async with asyncio.timeout(PATIENCE_S):
            await frozen.wait()
        running.cancel()
        await asyncio.wait({running})
        return scans

    scans = asyncio.run(scenario())
    assert max(scans[0].scan.range_m) == pytest.approx(2.0, abs=0.2)
    assert abs(scans[-1].stamp_s - SystemClock().now_s()) < 10
    for child in children:
        with pytest.raises(ProcessLookupError):
            os.kill(pid(child), 0)


def pid(child: DepthChild) -> int:
    """The process's number."""
    assert isinstance(child, CameraProcess)
    return child.pid


@pytest.mark.realtime
def test_the_real_process_says_why_it_gives_no_images(tmp_path: Path) -> None:
    """An empty folder: its sentence is the camera's reason."""
    (tmp_path / "empty").mkdir()

    async def scenario() -> str:
        parameters = folder_camera(tmp_path).model_copy(update={"folder": tmp_path / "empty"})
        child = await spawn_program(parameters)
        assert await child.read() == b""
        return await child.end()

    assert asyncio.run(scenario()) == f"{tmp_path / 'empty'}: there is no file *.png"


@pytest.mark.realtime
def test_the_process_ends_with_the_daemon(tmp_path: Path) -> None:
    """When nobody holds its stdin open any more it is gone, whatever its library does."""

    async def scenario() -> int:
        child = await spawn_program(folder_camera(tmp_path))
        assert await child.read()
        assert isinstance(child, CameraProcess)
        child.let_go()
        async with asyncio.timeout(PATIENCE_S):
            while await child.read():
                pass
        await child.end()
        return 0

    assert asyncio.run(scenario()) == 0
