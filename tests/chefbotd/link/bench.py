"""A session on a virtual clock, with a board that the test plays."""

import asyncio
from collections.abc import Awaitable, Callable

from chefbotd.bus import Bus, Inbox
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core import events
from chefbotd.link.board_memory import BoardMemory
from chefbotd.link.counting import Counting
from chefbotd.link.port import LinkParameters
from chefbotd.link.session import BoardSession
from chefbotd.testing.board import ScriptedBoard
from chefbotd.testing.transport import FakeSerialDevice
from firmware_protocol.codec import CLASSIC, Variant

EVERYTHING = (
    events.LinkOpened,
    events.LinkClosed,
    events.BoardResetProgressed,
    events.BoardRestarted,
    events.LineRefused,
    events.TextReceived,
    events.EncodersCounted,
    events.UltrasonicEchoed,
    events.DutyEchoed,
    events.OrientationReported,
    events.InertialCounted,
    events.BatteryCounted,
)


STOP = b"s 0 0\r"
OPENING = 2 * STOP
"""A line that was cut short by what was before takes the first of them with it."""


class Bench:
    """A session on a fake device, with an inbox for everything it publishes."""

    def __init__(
        self,
        variant: Variant = CLASSIC,
        counting: Counting | None = None,
        memory: BoardMemory | None = None,
    ) -> None:
        self.bus = Bus()
        self.device = FakeSerialDevice()
        self.board = ScriptedBoard(self.device, variant=variant)
        self.session = BoardSession(
            self.bus,
            LoopClock(),
            variant,
            device="/dev/fake",
            setpoints_per_s=200.0,
            counting=counting,
            memory=memory,
        )
        self.inbox: Inbox[object] = self.bus.subscribe(*EVERYTHING)

    def heard(self) -> list[object]:
        """Everything published since the last call."""
        return [self.inbox.take_event() for _ in range(len(self.inbox))]


def on_bench(
    scenario: Callable[[Bench], Awaitable[None]],
    variant: Variant = CLASSIC,
    counting: Counting | None = None,
    memory: BoardMemory | None = None,
) -> None:
    """Run a scenario with the device open, on the virtual clock."""

    async def run() -> None:
        bench = Bench(variant, counting, memory)
        await bench.device.open(LinkParameters(), bench.session)
        await asyncio.sleep(0)
        assert isinstance(bench.inbox.take_event(), events.LinkOpened)
        await scenario(bench)

    run_virtual(run())


def cycle(number: int) -> bytes:
    """The `t`, `e` and `u` lines of a cycle of 20 ms."""
    return b"t\t%d\t0.02\ne\t%d\t%d\nu\t87\n" % (5_000_000 + number * 20_000, number * 3, number * -2)
