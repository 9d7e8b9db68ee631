"""The stubborn driver: a client that goes on saying what it says at 20 Hz, whatever it is answered."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Any

from chefbotd.client import CallError, Client, MotionInterrupted
from chefbotd.testing.daemon import SimulatedRobot

PERIOD_S = 0.05

Says = Callable[[Client], Awaitable[object]]


class Driver:
    """Drives at ``twist``, or says something else (``says``), or nothing (None); ``key`` is what lets it in."""

    def __init__(self, robot: SimulatedRobot, twist: tuple[float, float], key: dict[str, Any]) -> None:
        self._robot, self._key = robot, key
        self.twist = twist
        self.says: Says | None = self.drive
        self.gone = False
        self._task = asyncio.create_task(self._run())

    async def drive(self, client: Client) -> None:
        """What it says unless told otherwise."""
        await client.drive(*self.twist)

    @property
    def lost(self) -> bool:
        """Whether its connection ended and it was not its own doing."""
        return self._task.done() and not self.gone

    async def leave(self) -> None:
        """Close the connection in mid-drive."""
        self.gone = True
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    def come_back(self) -> None:
        """Connect again."""
        self.gone, self._task = False, asyncio.create_task(self._run())

    async def _run(self) -> None:
        host, port = await self._robot.daemon.server.address()
        async with Client.connect(host, port, name="driver", **self._key) as client:
            while True:
                if self.says is not None:
                    with contextlib.suppress(CallError, MotionInterrupted):
                        await self.says(client)
                await asyncio.sleep(PERIOD_S)
