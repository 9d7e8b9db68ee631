"""Waiting on the real clock for what happens, with an end that no busy computer comes near."""

import asyncio
import time
from collections.abc import Callable
from typing import Final

PATIENCE_S: Final = 100.0


async def until(happens: Callable[[], bool]) -> None:
    """Wait for what has no event: another process, a thread or the kernel. Raises ``TimeoutError`` at the end."""
    async with asyncio.timeout(PATIENCE_S):
        while not happens():  # noqa: ASYNC110 - nobody tells us
            await asyncio.sleep(0.005)


def wait_until(happens: Callable[[], bool]) -> None:
    """The same in a thread, or while the loop is to stand still."""
    ends_s = time.monotonic() + PATIENCE_S
    while not happens():
        if time.monotonic() > ends_s:
            raise TimeoutError(f"it did not happen within {PATIENCE_S:g} s")
        time.sleep(0.005)
