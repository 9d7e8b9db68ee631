"""Listening at a port, at whichever baud rate, without a word."""

import asyncio
from collections.abc import Mapping

import pytest

from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.doctor.listening.ports import (
    RPLIDAR_QUESTION,
    ld_packets,
    listen,
    rplidar_link,
    rplidar_model,
    survey,
)
from chefbotd.link.port import LinkParameters
from chefbotd.testing.transport import FakeSerialDevice
from firmware_protocol.lidar import rplidar
from tests.fakes.lidar import ld19_bytes, noisy_box


class Talker(FakeSerialDevice):
    """A device that says the same again and again, by the rate at which it is opened."""

    def __init__(self, says: Mapping[int, bytes], *, every_s: float = 0.05) -> None:
        super().__init__()
        self._says, self._every_s = says, every_s

    async def open(self, parameters: LinkParameters, protocol: asyncio.BaseProtocol) -> asyncio.Transport:
        transport = await super().open(parameters, protocol)
        loop = asyncio.get_running_loop()

        def talk() -> None:
            if not transport.is_closing():
                self.feed(self._says.get(parameters.baud, b""))
                loop.call_later(self._every_s, talk)

        if parameters.baud in self._says:
            loop.call_later(self._every_s, talk)
        return transport


CYCLE = b"e\t10\t-3\ns\t0.00\t0.00\nb\t3000.00\n"


def test_a_board_is_heard_and_nothing_is_written():
    """Ten cycles in half a second; the port is closed again, and the board has read no byte."""

    async def scenario() -> None:
        device = Talker({115_200: CYCLE})
        listened = await listen(device.open, LinkParameters(device="/dev/x"), LoopClock(), 0.52)
        heard = survey(listened, "classic")
        assert heard.kinds == {"e": 10, "s": 10, "b": 10}
        assert not device.written
        assert device.transport is not None
        assert device.transport.is_closing()

    run_virtual(scenario())


def test_silence_and_a_cable_that_is_pulled():
    """Nothing is nothing; a port that is lost on the way says so."""

    async def scenario() -> None:
        device = Talker({})
        silent = await listen(device.open, LinkParameters(device="/dev/x"), LoopClock(), 0.5)
        assert not survey(silent, "classic").bytes
        asyncio.get_running_loop().call_later(0.2, device.unplug)
        lost = await listen(device.open, LinkParameters(device="/dev/x"), LoopClock(), 0.5)
        assert "unplugged" in lost.lost or "no data" in lost.lost
        with pytest.raises(FileNotFoundError):
            await listen(device.open, LinkParameters(device="/dev/x"), LoopClock(), 0.5)

    run_virtual(scenario())


def test_an_ld19_is_told_by_its_packets():
    """A tenth of a turn is enough; a board's lines hold none."""

    async def scenario() -> None:
        packets = b"".join(ld19_bytes(noisy_box(), 8))
        device = Talker({230_400: packets, 115_200: CYCLE})
        link = LinkParameters(device="/dev/x", baud=230_400)
        assert ld_packets(await listen(device.open, link, LoopClock(), 0.1)) >= 8
        assert not ld_packets(await listen(device.open, LinkParameters(device="/dev/x"), LoopClock(), 0.5))

    run_virtual(scenario())


def test_an_rplidar_answers_what_it_is():
    """Exactly the two bytes of the question are written; the answer names model and firmware."""

    async def scenario() -> None:
        device = FakeSerialDevice()
        info = bytes([0x18, 0x1D, 0x01, 0x07, *range(16)])
        device.on_write = lambda data: (
            device.written.extend(data),
            device.feed(rplidar.descriptor(0x04) + info),
        )[0]
        link = rplidar_link("/dev/x")
        listened = await listen(device.open, link, LoopClock(), 0.5, question=RPLIDAR_QUESTION)
        assert bytes(device.written) == b"\xa5\x50"
        assert rplidar_model(listened) == "RPLIDAR A1 (model 0x18, firmware 1.29)"

    run_virtual(scenario())
