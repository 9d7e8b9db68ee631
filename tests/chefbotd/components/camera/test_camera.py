"""The camera on virtual time: on while somebody looks, and well again after every way in which it fails."""

import asyncio
import random
from collections.abc import Awaitable, Callable, Sequence
from typing import TypeVar

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.camera.algorithms.jpeg import read_picture
from chefbotd.components.camera.camera import LINGER_S, LONGEST_WAIT_S, Camera
from chefbotd.components.camera.events import CameraChanged, CameraPictureTaken
from chefbotd.components.camera.link.source import ArrivedPicture, CameraLost, PictureSource
from chefbotd.components.camera.parameters import CameraParameters
from tests.chefbotd.components.camera.pictures import picture

T = TypeVar("T")
PERIOD_S = 0.1
PICTURE = read_picture(picture(), 100_000)


class Script:
    """A source that sends so many pictures each time that it is opened, and then is lost; None: for ever."""

    def __init__(self, *runs: int | str | None) -> None:
        self.runs: list[int | str | None] = list(runs)
        self.opened = self.closed = 0

    async def open(self, parameters: CameraParameters) -> PictureSource:
        self.opened += 1
        run = self.runs.pop(0) if self.runs else None
        if isinstance(run, str):
            raise CameraLost(run)
        return ScriptedSource(self, run)


class ScriptedSource:
    """One run."""

    def __init__(self, script: Script, left: int | None) -> None:
        self._script, self._left = script, left

    async def read(self) -> ArrivedPicture:
        await asyncio.sleep(PERIOD_S)
        if self._left is not None:
            if not self._left:
                raise CameraLost("/dev/video0 is gone: was the camera unplugged?")
            self._left -= 1
        return ArrivedPicture(PICTURE, 0.02, 1)

    async def close(self) -> None:
        self._script.closed += 1


def on(script: Script, look: Callable[[Camera, list[CameraChanged]], Awaitable[T]], **keys: object) -> T:
    """Run the camera, and ``look``, which is handed what was said of it."""

    async def scenario() -> T:
        bus, said = Bus(), list[CameraChanged]()
        bus.add_handler(said.append, CameraChanged)
        parameters = CameraParameters.model_validate({"enabled": True, **keys})
        camera = Camera(parameters, bus, LoopClock(), script.open, random.Random(1))
        task = asyncio.create_task(camera.run())
        try:
            return await look(camera, said)
        finally:
            task.cancel()
            await asyncio.wait([task])

    return run_virtual(scenario())


def states(said: Sequence[CameraChanged]) -> list[str]:
    """The states, in their order."""
    return [changed.state for changed in said]


def test_the_camera_is_off_until_somebody_looks_and_again_after_the_last_look() -> None:
    """Its source is opened for the first look, and closed ten seconds after the last."""
    script = Script()

    async def look(camera: Camera, said: list[CameraChanged]) -> None:
        await asyncio.sleep(60.0)
        assert (script.opened, states(said)) == (0, ["off"])
        frame = await camera.next_picture(0, 5.0)
        assert (frame.number, frame.width_px, frame.height_px) == (1, 32, 24)
        await asyncio.sleep(LINGER_S - 1.0)
        assert script.closed == 0
        await asyncio.sleep(2.0)
        assert (script.closed, camera.newest) == (1, None)
        assert states(said)[1:] == ["starting", "running", "off"]
        assert len({changed.log_line() for changed in said}) == 1  # the log is not filled by those who look

    on(script, look)


def test_each_picture_is_seen_once_and_says_how_old_it_is() -> None:
    """A viewer that asks for what is newer than its last waits for it; a late one gets the newest alone."""

    async def look(camera: Camera, said: list[CameraChanged]) -> None:
        first = await camera.next_picture(0, 5.0)
        second = await camera.next_picture(first.number, 5.0)
        assert (first.number, second.number) == (1, 2)
        assert first.age_s == pytest.approx(0.02)
        assert second.stamp_s - first.stamp_s == pytest.approx(PERIOD_S)
        await asyncio.sleep(5 * PERIOD_S + 0.05)
        late = await camera.next_picture(second.number, 5.0)
        assert late.number == 7
        assert late.age_s == pytest.approx(0.07)

    on(Script(), look)


def test_a_number_of_another_run_of_the_daemon_is_answered_at_once() -> None:
    """Numbers begin anew; a page that was open before asks with its old one."""

    async def look(camera: Camera, said: list[CameraChanged]) -> None:
        await camera.next_picture(0, 5.0)
        assert (await camera.next_picture(4711, 5.0)).number == 1

    on(Script(), look)


def test_a_camera_that_is_unplugged_heals_when_it_is_plugged_in_again() -> None:
    """What is wrong is said once, the last picture is not shown any more, and within seconds there is a new one."""
    gone = "there is no /dev/video0: is the camera plugged in?"
    script = Script(3, *[gone] * 6)

    async def look(camera: Camera, said: list[CameraChanged]) -> None:
        for number in range(3):
            assert (await camera.next_picture(number, 5.0)).number == number + 1
        with pytest.raises(CameraLost, match="was the camera unplugged"):
            await camera.next_picture(3, 5.0)
        assert camera.newest is None
        began_s = asyncio.get_running_loop().time()
        while True:
            try:
                frame = await camera.next_picture(3, 5.0)
                break
            except CameraLost:
                await asyncio.sleep(1.0)
        assert frame.number > 3
        assert asyncio.get_running_loop().time() - began_s < 6 * 1.2 * LONGEST_WAIT_S
        assert states(said) == ["starting", "running", "failed", "failed", "running"]
        assert (said[3].reason, script.opened, script.closed) == (gone, 8, 1)

    on(script, look)


def test_a_source_that_hangs_is_given_up_and_opened_again() -> None:
    """A driver that says nothing, not even that it is silent."""
    script = Script()
    opened = script.open

    class Hangs(ScriptedSource):
        async def read(self) -> ArrivedPicture:
            await asyncio.sleep(1e6)
            raise AssertionError

    async def open_source(parameters: CameraParameters) -> PictureSource:
        source = await opened(parameters)
        return Hangs(script, None) if script.opened == 1 else source

    script.open = open_source  # type: ignore[method-assign]

    async def look(camera: Camera, said: list[CameraChanged]) -> None:
        for _ in range(3):
            with pytest.raises(CameraLost):
                await camera.next_picture(0, 10.0)
        while camera.newest is None:
            await asyncio.sleep(0.5)
            camera._note_look()
        assert script.closed == 1
        assert "hangs" in next(changed.reason for changed in said if changed.reason)

    on(script, look)


def test_pictures_are_recorded_at_their_own_rate_without_anybody_looking() -> None:
    """Two a second of ten, with the bytes of the picture."""

    async def look(camera: Camera, said: list[CameraChanged]) -> None:
        recorded: list[CameraPictureTaken] = []
        camera._bus.add_handler(recorded.append, CameraPictureTaken)
        await asyncio.sleep(10.05)
        assert 19 <= len(recorded) <= 21
        assert recorded[0].jpeg == picture()
        assert b'jpeg":""' in recorded[0].encode_recorded()

    on(Script(), look, recorded_hz=2.0)


def test_a_camera_costs_nothing_while_nobody_looks() -> None:
    """No timer of it runs: an hour of virtual time takes no step."""

    async def look(camera: Camera, said: list[CameraChanged]) -> None:
        await asyncio.sleep(3600.0)
        assert len(said) == 1

    on(Script(), look)
