"""A board that sends what a test asks for, and keeps what it received."""

import asyncio
from collections.abc import Iterable

from chefbotd.core.record import Record
from chefbotd.testing.transport import FakeSerialDevice
from firmware_protocol.codec import CLASSIC, Variant, from_board, to_board
from firmware_protocol.decoder import Decoder
from firmware_protocol.messages import BoardTime, EncoderCounts, Malformed, Message, SetDuty


class Received(Record, frozen=True):
    """A line that the daemon sent, decoded, and the loop's time when it arrived."""

    stamp_s: float
    message: Message | Malformed


class ScriptedBoard:
    """The board's end of a ``FakeSerialDevice``.

    ``say`` sends any message or raw bytes now, ``cycle`` the `t` and `e` lines of one cycle, ``play`` a whole script
    with its times. ``received`` holds every line the daemon wrote, ``duty`` the motor command in force.
    """

    def __init__(self, device: FakeSerialDevice, *, variant: Variant = CLASSIC) -> None:
        self._device = device
        self._codec = from_board(variant)
        self._decoder = Decoder(to_board(variant))
        self._micros = 0
        self.received: list[Received] = []
        device.on_write = self._hear

    @property
    def duty(self) -> tuple[int, ...] | None:
        """The newest motor command; None before the first."""
        return next((r.message.duty for r in reversed(self.received) if isinstance(r.message, SetDuty)), None)

    @property
    def duties(self) -> list[tuple[float, tuple[int, ...]]]:
        """Every motor command with the time it came."""
        return [(r.stamp_s, r.message.duty) for r in self.received if isinstance(r.message, SetDuty)]

    def say(self, *said: Message | bytes) -> None:
        """Send messages, or bytes as they are, in one chunk."""
        self._device.feed(b"".join(s if isinstance(s, bytes) else self._codec.encode(s) for s in said))

    def cycle(self, *counts: int, cycle_s: float = 0.02) -> None:
        """Send the time and the encoder counts of a cycle that took ``cycle_s`` by the board's clock."""
        self._micros = (self._micros + round(cycle_s * 1e6)) % 2**32
        self.say(BoardTime(self._micros, cycle_s), EncoderCounts(counts))

    async def play(self, script: Iterable[tuple[float, Message | bytes]]) -> None:
        """Say each line at its time, in seconds from now."""
        loop = asyncio.get_running_loop()
        start_s = loop.time()
        for at_s, said in script:
            await asyncio.sleep(max(0.0, start_s + at_s - loop.time()))
            self.say(said)

    def _hear(self, data: bytes) -> None:
        self._device.written.extend(data)
        now_s = asyncio.get_running_loop().time()
        self.received.extend(Received(now_s, message) for _, message in self._decoder.feed(data))
