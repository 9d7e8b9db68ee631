"""The simulated robot's own clock, which a busy computer slows down: by it a demonstration is timed."""

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Final

from chefbotd.client import Client

LATE_SHARE: Final = 0.9
"""A clock that goes slower than this share of the computer's is worth a word."""

STANDS_S: Final = 120.0
"""A robot whose clock stands still for so long, by the computer's, is not waited for any more."""


class RobotTime:
    """The time by the stamps of what the robot reports."""

    def __init__(self, computer_s: Callable[[], float] = time.monotonic) -> None:
        self.now_s = -math.inf
        self._computer_s = computer_s
        self._first: tuple[float, float] | None = None
        self._limits: dict[asyncio.Timeout, float] = {}
        self._begun = asyncio.Event()

    def take_stamp(self, stamp_s: float) -> None:
        """The robot's clock has come to this; whoever has waited for too long is told."""
        self.now_s = max(self.now_s, stamp_s)
        if self._first is None:
            self._first = (self.now_s, self._computer_s())
            self._begun.set()
        now_s = asyncio.get_running_loop().time()
        for limit, until_s in self._limits.items():
            limit.reschedule(now_s if self.now_s >= until_s else now_s + STANDS_S)

    @asynccontextmanager
    async def timeout(self, seconds: float) -> AsyncIterator[None]:
        """Raise ``TimeoutError`` when the block takes longer by the robot's clock, or when that stands still."""
        async with asyncio.timeout(STANDS_S) as limit:
            self._limits[limit] = self.now_s + seconds
            try:
                yield
            finally:
                del self._limits[limit]

    async def sleep(self, seconds: float) -> None:
        """Wait so long by the robot's clock."""
        with contextlib.suppress(TimeoutError):
            async with self.timeout(seconds):
                await asyncio.Event().wait()

    async def until_first(self) -> None:
        """Wait for the first stamp."""
        await self._begun.wait()

    def share(self) -> float:
        """How fast it has gone since its first stamp, as a share of the computer's clock."""
        if self._first is None or (passed_s := self._computer_s() - self._first[1]) <= 0:
            return 1.0
        return (self.now_s - self._first[0]) / passed_s

    def late_text(self) -> str:
        """What is to be said of a computer that is too busy; nothing where it is not."""
        share = self.share()
        if share >= LATE_SHARE:
            return ""
        return f"the computer is busy: the simulated robot's clock goes at {100 * share:.0f} % of real time"


async def follow(robot: Client, clock: RobotTime) -> None:
    """Keep the clock by what the simulator reports, until cancelled."""
    async with robot.subscribe("sim", max_rate_hz=10.0) as events:
        async for event in events:
            clock.take_stamp(event.stamp_s)
