"""Starts the second process (``last_stop``) that stops the motors if this one is killed, and says goodbye to it."""

import asyncio
import contextlib
import os
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncIterator

import structlog

from chefbotd.link.port import LinkParameters
from chefbotd.link.wires import stop_line
from chefbotd.process import last_stop
from chefbotd.process.last_stop import END_MESSAGE
from chefbotd.settings import Settings

ENDING_S = 2.0
AGAIN_S = 1.0
log = structlog.get_logger(component="stop_guard")


@contextlib.asynccontextmanager
async def stop_guard(settings: Settings) -> AsyncIterator[None]:
    """Have a guard of the robot's motors while the block lasts, however the block ends.

    The block begins before the guard has started. A device that is no path (``socket://``) has none.
    """
    link = settings.link
    if "://" in link.device:
        yield
        return
    guard = _Guard(link, stop_line(settings.robot.wire))
    keeping = asyncio.create_task(guard.keep())
    try:
        yield
    finally:
        keeping.cancel()
        await guard.end_cleanly()


class _Guard:
    """Keeps the second process running: starts another one if it ends."""

    def __init__(self, link: LinkParameters, stop: bytes) -> None:
        self._link, self._stop = link, stop
        self._starting = self._start_process()

    async def keep(self) -> None:
        """Start another one whenever it ends."""
        while (process := await asyncio.shield(self._starting)) is not None:
            code = await process.wait()
            log.warning("the stop guard has ended, and is started again", code=code)
            await asyncio.sleep(AGAIN_S)
            self._starting = self._start_process()

    async def end_cleanly(self) -> None:
        """Let the running one end without a stop."""
        if (process := await self._starting) is not None:
            with contextlib.suppress(OSError, TimeoutError):
                async with asyncio.timeout(ENDING_S):
                    await process.communicate(END_MESSAGE)

    def _start_process(self) -> "asyncio.Task[Process | None]":
        return asyncio.create_task(_start_guard(self._link, self._stop))


async def _start_guard(link: LinkParameters, stop: bytes) -> Process | None:
    """Start it in its own session, so that Ctrl-C does not reach it. None if the system cannot start it."""
    lines = (str(int(link.dtr)), str(int(link.rts)))
    try:
        return await asyncio.create_subprocess_exec(
            *(
                sys.executable,
                "-P",
                "-m",
                last_stop.__name__,
                link.device,
                str(link.baud),
                *lines,
                stop.hex(),
                str(os.getpid()),
            ),
            stdin=PIPE,
            stdout=DEVNULL,
            stderr=DEVNULL,
            start_new_session=True,
        )
    except OSError as error:
        log.warning(
            "the stop guard cannot start, so nothing stops the motors if chefbotd is killed", error=str(error)
        )
        return None
