"""Waiting for the worker of a daemon that was started just now."""

import asyncio
from collections.abc import Callable
from typing import Final

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import Client

READY_S: Final = 240.0
"""The worker compiles its code once, when it is started for the first time."""


async def until_worker_ready(robot: Client, tell: Callable[[str], None]) -> int | None:
    """Wait, and tell what it is at; its process id.

    Raises:
        ProgramError: it cannot work here, or was not ready in time.
    """
    try:
        async with asyncio.timeout(READY_S), robot.subscribe("worker") as reports:
            async for event in reports:
                if event.data.state == "ready":
                    return event.data.pid
                if event.data.state == "unavailable":
                    raise ProgramError(Exit.NOT_DONE, event.data.reason)
                tell(f"the worker is {event.data.state} (the first time it compiles its code)")
    except TimeoutError:
        pass
    raise ProgramError(Exit.NOT_DONE, f"the worker was not ready within {READY_S:g} s")
