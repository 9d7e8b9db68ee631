"""Serves a replay to clients and to the page, read-only."""

import asyncio
from collections.abc import Callable
from functools import wraps
from types import TracebackType
from typing import Any, Self

from msgspec.structs import replace

from chefbotd.app import Daemon
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.rpc.method import Method

LOOKING = frozenset(
    {
        "authenticate",
        "set_client_name",
        "describe",
        "ping",
        "get_state",
        "subscribe",
        "unsubscribe",
        "cancel",
        "get_stats",
        "get_pid",
        "get_urdf",
    }
)
WHY = "this is a replay: it cannot be driven, stopped or changed"


class Serving:
    """The daemon's socket and page, as long as the context lasts."""

    def __init__(self, daemon: Daemon) -> None:
        self._daemon = daemon
        self._tasks: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> Self:
        daemon = self._daemon
        daemon.rpc.exchange_methods(_guarded)
        loops = [daemon.rpc.run, daemon.server.run, *([daemon.page.run] if daemon.page is not None else [])]
        self._tasks = [asyncio.create_task(loop()) for loop in loops]
        await daemon.server.address()
        if daemon.page is not None:
            await daemon.page.address()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


def _guarded(method: Method) -> Method:
    if method.name in LOOKING:
        return method
    return replace(method, handle=_refusing(method.handle))


def _refusing(handle: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(handle)
    def refuse(*arguments: object) -> None:
        raise Refused(RefusalKind.DISARMED, WHY)

    return refuse
