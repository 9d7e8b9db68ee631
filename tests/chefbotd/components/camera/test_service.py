"""Who may look at the camera, how many at a time, and what one that does not read is sent."""

import asyncio
import base64
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from chefbotd.bus import Bus
from chefbotd.cli.common.arguments import Address
from chefbotd.cli.common.context import CommandContext
from chefbotd.client import Client
from chefbotd.clock import Clock, LoopClock, run_virtual
from chefbotd.components.camera.algorithms.jpeg import read_picture
from chefbotd.components.camera.camera import Camera
from chefbotd.components.camera.cli import camera as camera_command
from chefbotd.components.camera.link.source import ArrivedPicture, CameraLost, PictureSource
from chefbotd.components.camera.parameters import CameraParameters
from chefbotd.components.camera.service import GONE_S, CameraService, camera_feature
from chefbotd.components.camera.status_text import camera as status_row
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.features.feature import Feature
from chefbotd.rpc.method import methods_of
from chefbotd.rpc.parameters import Role
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from tests.chefbotd.components.camera.pictures import picture

LARGE = picture(90, 2400, 1800)
PARAMETERS = CameraParameters(enabled=True)


class Source:
    """Ten pictures a second."""

    def __init__(self, jpeg: bytes = picture()) -> None:
        self._picture = read_picture(jpeg, 1_000_000)

    async def read(self) -> ArrivedPicture:
        await asyncio.sleep(0.1)
        return ArrivedPicture(self._picture, 0.0)

    async def close(self) -> None:
        """There is nothing to close."""


def a_camera(
    bus: Bus, clock: Clock, parameters: CameraParameters = PARAMETERS, jpeg: bytes = picture()
) -> Camera:
    """One that sends these pictures."""

    async def open_source(parameters: CameraParameters) -> PictureSource:
        return Source(jpeg)

    return Camera(parameters, bus, clock, open_source, random.Random(1))


class Viewer:
    """A client by its number."""

    def __init__(self, number: int) -> None:
        self.session = self
        self.number = number


async def look(service: CameraService, number: int, **params: Any) -> Any:
    """Ask as a client does."""
    (row,) = (row for row in methods_of(service) if row.name == "get_camera_frame")
    return await row.handle(Viewer(number), row.params.model_validate(params), None)


def test_as_many_look_as_may_and_one_that_is_gone_makes_room() -> None:
    """The third of two is refused, with the number; six seconds after the last look of another it is let in."""

    async def scenario() -> None:
        bus, clock = Bus(), LoopClock()
        camera = a_camera(bus, clock, CameraParameters(enabled=True, max_viewers=2))
        service = CameraService(camera, clock)
        running = asyncio.create_task(camera.run())
        await look(service, 1)
        await look(service, 2)
        with pytest.raises(Refused, match="2 clients look") as refused:
            await look(service, 3)
        assert refused.value.kind is RefusalKind.TOO_MANY_VIEWERS
        await look(service, 1, after=1)
        await asyncio.sleep(GONE_S - 0.2)
        await look(service, 1)
        await asyncio.sleep(0.5)
        await look(service, 3)
        assert service.viewers == 2
        running.cancel()

    run_virtual(scenario())


def test_a_client_waits_for_one_picture_at_a_time() -> None:
    """The second request is refused, and the first one answered."""

    async def scenario() -> None:
        bus, clock = Bus(), LoopClock()
        camera = a_camera(bus, clock)
        service = CameraService(camera, clock)
        running = asyncio.create_task(camera.run())
        first = asyncio.create_task(look(service, 1))
        await asyncio.sleep(0)
        with pytest.raises(Refused, match="one at a time"):
            await look(service, 1)
        assert (await first).number == 1
        running.cancel()

    run_virtual(scenario())


def test_without_a_picture_the_reason_is_answered() -> None:
    """As the source has said it."""

    async def lost(parameters: CameraParameters) -> PictureSource:
        raise CameraLost("there is no /dev/video0: is the camera plugged in?")

    async def scenario() -> None:
        bus, clock = Bus(), LoopClock()
        camera = Camera(PARAMETERS, bus, clock, lost, random.Random(1))
        running = asyncio.create_task(camera.run())
        with pytest.raises(Refused, match="no picture: there is no /dev/video0") as refused:
            await look(CameraService(camera, clock), 1)
        assert refused.value.kind is RefusalKind.NO_PICTURE
        running.cancel()

    run_virtual(scenario())


@pytest.mark.parametrize("role", [Role.DRIVE, Role.ADMIN])
def test_the_configuration_says_who_sees_the_picture(role: Role) -> None:
    """Guests and observers do not by themselves; whether there is one, everybody sees."""
    clock = LoopClock()
    camera = a_camera(Bus(), clock, CameraParameters(enabled=True, role=role))
    roles = {row.name: row.role for row in camera_feature(camera, clock).methods}
    assert roles == {"get_camera_frame": role, "get_camera_status": Role.OBSERVE}
    assert CameraParameters().role is Role.DRIVE
    assert not Role.GUEST.allows(CameraParameters().role)


def on_socket(act: Callable[[Client], Any], jpeg: bytes) -> Any:
    """Run a daemon with this camera, and ``act``."""

    def feature(bus: Bus, clock: Clock) -> Feature:
        return camera_feature(a_camera(bus, clock, jpeg=jpeg), clock)

    async def scenario() -> Any:
        async with running_daemon(FakeSerialDevice(), features=[feature]) as client:
            return await act(client)

    return run_virtual(scenario())


def test_a_picture_comes_over_the_socket_as_it_was_taken() -> None:
    """Byte for byte, in base64; the topic says that the camera runs."""

    async def act(client: Client) -> None:
        frame = await client.call("get_camera_frame")
        assert base64.b64decode(frame["jpeg"]) == picture()
        topics = (await client.call("get_state"))["topics"]
        assert topics["camera"]["data"]["state"] == "running"

    on_socket(act, picture())


def test_a_client_that_asks_again_and_again_and_reads_nothing_holds_one_picture() -> None:
    """Of fifty requests those that the buffers of the kernel take are answered, and the control loop goes on."""

    async def act(client: Client) -> int:
        host, port = client.address
        reader, writer = await asyncio.open_connection(host, port, limit=1000)
        for number in range(50):
            writer.write(
                json.dumps({"jsonrpc": "2.0", "id": number, "method": "get_camera_frame"}).encode() + b"\n"
            )
        await asyncio.sleep(4.0)
        state = await client.call("get_state")
        assert state["stamp_s"] > 0
        received = 0
        try:
            async with asyncio.timeout(0.5):
                while data := await reader.read(1 << 20):
                    received += data.count(b'"jpeg"')
        except TimeoutError:
            pass
        writer.close()
        return received

    assert len(LARGE) > 60_000
    assert on_socket(act, LARGE) <= 12


def test_the_commands_write_a_picture_and_say_how_the_camera_is(tmp_path: Path) -> None:
    """``camera snapshot`` and ``camera status``, before a daemon without a camera and with one."""

    class Robot:
        async def call(self, name: str, **params: Any) -> Any:
            if name == "get_camera_frame":
                size = {"width_px": 32, "height_px": 24}
                return {
                    "number": 1,
                    "stamp_s": 5.0,
                    "age_s": 0.04,
                    **size,
                    "jpeg": base64.b64encode(picture()).decode(),
                }
            counts = {"pictures": 9, "dropped": 1, "starts": 2, "viewers": 0}
            return {
                "state": "failed",
                "reason": "it is gone",
                "source": "/dev/video0",
                "width_px": 0,
                "height_px": 0,
                "age_s": None,
                **counts,
            }

    class Context(CommandContext, frozen=True):
        def run_with_client(self, action: Any, **options: Any) -> Any:
            return asyncio.run(action(Robot()))

    context = Context(Address("127.0.0.1", 1))
    file = tmp_path / "now.jpg"
    told = CliRunner().invoke(camera_command, ["snapshot", str(file)], obj=context)
    assert file.read_bytes() == picture()
    assert "32 x 24" in told.output
    assert "0.04 s old" in told.output
    told = CliRunner().invoke(camera_command, ["status"], obj=context)
    assert "/dev/video0: failed: it is gone" in told.output
    assert "9 pictures, 1 dropped, started 2 times" in told.output
    refused = CliRunner().invoke(camera_command, ["snapshot", str(tmp_path / "no" / "file.jpg")], obj=context)
    assert "cannot be written" in str(refused.exception)


def test_the_row_of_the_status_says_why_there_is_no_picture() -> None:
    """Off, running with its size, or failed with the reason."""
    size = {"width_px": 640, "height_px": 480}
    assert status_row({"state": "running", "reason": "", **size}).text == "running, 640 x 480"
    assert status_row({"state": "failed", "reason": "it is gone", **size}).text == "no picture: it is gone"
