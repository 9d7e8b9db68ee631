"""Logs for messages that a fault repeats: the first at once, the rest as a count."""

import asyncio
from typing import Any

from msgspec import Struct
from structlog.typing import FilteringBoundLogger


class _Held(Struct):
    """What has been kept back of one event: how many, and the newest one's fields."""

    count: int = 0
    fields: dict[str, Any] = {}


class RateLimitedLog:
    """Says the first of each event at once; what follows within ``every_s`` becomes one line with its count.

    The summary carries the newest one's fields, ``more`` (how many there were) and ``within_s``. An event that goes
    on is summarised every ``every_s``; one that has paused that long is a first one again. Needs a running loop.
    """

    def __init__(self, log: FilteringBoundLogger, every_s: float = 10.0) -> None:
        self._log, self._every_s = log, every_s
        self._held: dict[str, _Held] = {}

    def warning(self, event: str, **fields: Any) -> None:
        """Log a warning, unless one of the same event has just been logged."""
        held = self._held.get(event)
        if held is None:
            self._log.warning(event, **fields)
            self._hold(event)
        else:
            held.count += 1
            held.fields = fields

    def _hold(self, event: str) -> None:
        self._held[event] = _Held()
        asyncio.get_running_loop().call_later(self._every_s, self._summarise, event)

    def _summarise(self, event: str) -> None:
        held = self._held.pop(event)
        if held.count:
            self._log.warning(event, **held.fields, more=held.count, within_s=self._every_s)
            self._hold(event)
