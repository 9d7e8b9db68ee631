"""The fake serial device behaves like a serial port where it matters."""

import asyncio

import pytest

from chefbotd.clock import run_virtual
from chefbotd.link.port import LinkParameters
from chefbotd.testing.transport import FakeSerialDevice


class Recorder(asyncio.Protocol):
    """Remembers what its transport told it."""

    def __init__(self) -> None:
        self.told: list[object] = []

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.told.append("made")

    def data_received(self, data: bytes) -> None:
        self.told.append(data)

    def pause_writing(self) -> None:
        self.told.append("pause")

    def resume_writing(self) -> None:
        self.told.append("resume")

    def connection_lost(self, exc: Exception | None) -> None:
        self.told.append(exc)


def test_bytes_go_both_ways_and_a_lost_link_swallows_them():
    """Fed chunks arrive as fed, writes are recorded; after the unplug both directions are dead and quiet."""

    async def scenario() -> None:
        device, protocol = FakeSerialDevice(), Recorder()
        device.feed(b"unheard")
        transport = await device.open(LinkParameters(), protocol)
        await asyncio.sleep(0)
        device.feed(b"u\t1")
        device.feed(b"2\n")
        transport.write(b"s 1 1\r")
        device.unplug()
        device.unplug()
        transport.write(b"s 2 2\r")
        transport.abort()
        await asyncio.sleep(0)
        assert protocol.told[:3] == ["made", b"u\t1", b"2\n"]
        assert isinstance(protocol.told[3], OSError)
        assert len(protocol.told) == 4
        assert bytes(device.written) == b"s 1 1\r"
        assert transport.is_closing()

    run_virtual(scenario())


def test_a_stalled_reader_fills_the_buffer_and_pauses_the_writer():
    """With the limit at zero the first unsent byte pauses; draining hands everything over and resumes, once."""

    async def scenario() -> None:
        device, protocol = FakeSerialDevice(), Recorder()
        transport = await device.open(LinkParameters(), protocol)
        await asyncio.sleep(0)
        transport.set_write_buffer_limits(high=0)
        device.transport.stall()
        transport.write(b"s 1 1\r")
        transport.write(b"s 2 2\r")
        assert transport.get_write_buffer_size() == 12
        device.transport.drain()
        device.transport.drain()
        transport.set_write_buffer_limits()
        assert bytes(device.written) == b"s 1 1\rs 2 2\r"
        transport.close()
        await asyncio.sleep(0)
        assert protocol.told == ["made", "pause", "resume", None]

    run_virtual(scenario())


def test_an_unplugged_device_cannot_be_opened_until_it_is_plugged():
    """Opening fails as for a path without a device; after plug it works."""

    async def scenario() -> None:
        device = FakeSerialDevice(plugged=False)
        with pytest.raises(FileNotFoundError, match="/dev/ttyACM0"):
            await device.open(LinkParameters(), Recorder())
        device.plug()
        assert await device.open(LinkParameters(), Recorder())

    run_virtual(scenario())


def test_only_a_protocol_can_be_connected():
    """Something that is no asyncio.Protocol is refused with its name."""

    async def scenario() -> None:
        with pytest.raises(TypeError, match="BaseProtocol"):
            await FakeSerialDevice().open(LinkParameters(), asyncio.BaseProtocol())

    run_virtual(scenario())
