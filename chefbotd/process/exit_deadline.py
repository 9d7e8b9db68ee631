"""Ends a process that does not end by itself: a plug-in's task may swallow its cancellation, or keep a thread."""

import asyncio
import os
import threading
import time
from collections.abc import Callable

import structlog

EXIT_WITHIN_S = 5.0
LAST_LINES_S = 0.3
"""For the log's thread to write what was logged."""

log = structlog.get_logger(component="app")


class ExitDeadline:
    """``start`` it when the end begins; the motors have been told to stop then."""

    def __init__(self, within_s: float = EXIT_WITHIN_S, end: Callable[[int], object] = os._exit) -> None:
        self._within_s, self._end = within_s, end
        self._started = False

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """End the process so long from now, unless it has ended by itself. Only the first call counts."""
        if not self._started:
            self._started = True
            threading.Thread(
                target=self._end_late_process, args=(loop,), name="exit deadline", daemon=True
            ).start()

    def _end_late_process(self, loop: asyncio.AbstractEventLoop) -> None:
        time.sleep(self._within_s)
        log.error(
            "the process does not end by itself, and is ended: a plug-in keeps a task or a thread",
            tasks=_tasks(loop),
            threads=[thread.name for thread in threading.enumerate() if not thread.daemon],
        )
        time.sleep(LAST_LINES_S)
        self._end(1)


def _tasks(loop: asyncio.AbstractEventLoop) -> list[str]:
    """What still runs in a loop of another thread."""
    try:
        return sorted(str(task.get_coro()) for task in asyncio.all_tasks(loop))
    except RuntimeError:  # they change while they are listed
        return []
