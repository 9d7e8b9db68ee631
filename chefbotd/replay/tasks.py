"""Services and long requests in a replay: each continues when it did in the recording."""

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Mapping
from typing import Any

from msgspec import Struct

from chefbotd.entries import Entries, is_done

Run = Callable[[], Coroutine[Any, Any, Any]]

MOST_TURNS = 20
"""A future that is shielded hears of its end some turns of the loop later."""


class _Running(Struct):
    task: Coroutine[Any, Any, Any]
    waits_for: "asyncio.Future[Any] | None" = None


class Tasks:
    """``services`` begin anew when they are stepped after their end; a request does not."""

    def __init__(self, services: Mapping[str, Run], entries: Entries) -> None:
        self._services, self._entries = services, entries
        self._requests: dict[str, Run] = {}
        self._running: dict[str, _Running] = {}

    def add_request(self, name: str, run: Run) -> None:
        """A request begins with its first step."""
        self._requests[name] = run

    async def step(self, name: str, *, cancelled: bool) -> bool:
        """Let a task go on to where it waits next; False for one that is not known or has nothing to go on with."""
        running = self._running.get(name)
        if running is None:
            run = self._requests.pop(name, None) or self._services.get(name)
            if run is None:
                return False
            running = self._running[name] = _Running(run())
        if not cancelled and not await _is_done(running.waits_for):
            return False
        self._entries.task = name
        try:
            task = running.task
            waits_for = task.throw(asyncio.CancelledError()) if cancelled else task.send(None)
        except (StopIteration, asyncio.CancelledError):
            del self._running[name]
            return True
        except Exception:  # noqa: BLE001 - what the recorded one led to is in the recording
            del self._running[name]
            return True
        finally:
            self._entries.task = ""
        if waits_for is not None:
            waits_for._asyncio_future_blocking = False
        running.waits_for = waits_for
        return True

    async def begin_anew(self) -> None:
        """Every service is at rest, and no request is under way."""
        for name, running in list(self._running.items()):
            if name not in self._entries.resting or is_done(running.waits_for):
                running.task.close()
                del self._running[name]
        self._requests.clear()
        for name in self._services.keys() - self._running.keys():
            await self.step(name, cancelled=False)

    def close(self) -> None:
        """The replay is over."""
        for running in self._running.values():
            with contextlib.suppress(Exception):  # why it ends is told already
                running.task.close()
        self._running.clear()
        self._requests.clear()


async def _is_done(future: "asyncio.Future[Any] | None") -> bool:
    for _ in range(MOST_TURNS):
        if future is None or future.done():
            return True
        await asyncio.sleep(0)
    return False
