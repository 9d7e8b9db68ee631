"""What a demonstration waits for before its robot moves, on a virtual clock."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

from chefbotd.cli.drive.simulated_daemon import until_ready
from chefbotd.client.errors import CallTimeout
from chefbotd.clock import run_virtual

COMPILES_S = 90.0


class StandingClock:
    """A robot on a clock of its own, which stands until its worker has compiled: no odometry comes before."""

    def __init__(self) -> None:
        self._odometry = asyncio.Event()

    @asynccontextmanager
    async def subscribe(self, topic: str) -> AsyncIterator[Any]:
        yield self._reports()

    async def _reports(self) -> AsyncIterator[Any]:
        yield SimpleNamespace(data=SimpleNamespace(state="starting"))
        await asyncio.sleep(COMPILES_S)
        self._odometry.set()
        yield SimpleNamespace(data=SimpleNamespace(state="ready", pid=7))

    async def wait_until_armed(self, timeout_s: float = 10.0) -> None:
        """As the client's: it does not wait for long."""
        try:
            async with asyncio.timeout(timeout_s):
                await self._odometry.wait()
        except TimeoutError:
            raise CallTimeout(f"the robot was not ready to move within {timeout_s:g} s") from None


def test_a_first_demonstration_waits_while_its_worker_compiles_for_longer_than_a_robot_starts() -> None:
    """In a new checkout a slow computer compiles for minutes: that is said, and ends nothing."""
    told: list[str] = []

    async def begin() -> int | None:
        robot: Any = StandingClock()
        return await until_ready(robot, told.append)

    assert run_virtual(begin()) == 7
    assert told == ["the worker is starting (the first time it compiles its code)"]
