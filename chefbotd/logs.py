"""Logs on stderr: one JSON object per line for systemd and files, colours for a terminal.

What a fault repeats a thousand times a second is told by ``RateLimitedLog``: the first at once, the rest as a count.
"""

import asyncio
import logging
import sys
from dataclasses import dataclass, field
from typing import Any, Literal

import structlog
from structlog.typing import EventDict, FilteringBoundLogger, Processor

from chefbotd.log_writer import LogWriter

STDERR = 2

Level = Literal["debug", "info", "warning", "error"]


def configure(level: Level) -> LogWriter:
    """Set up structlog for the whole process; what the standard library logs (asyncio's complaints) joins it.

    The lines are written by a thread: closing what is returned waits for the last of them.
    """
    writer = LogWriter(STDERR)
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            *_renderers(on_terminal=sys.stderr.isatty()),
        ],
        wrapper_class=structlog.make_filtering_bound_logger(getattr(logging, level.upper())),
        logger_factory=structlog.WriteLoggerFactory(writer),  # type: ignore[arg-type]
        cache_logger_on_first_use=True,
    )
    logging.basicConfig(handlers=[_Forwarder()], level=logging.WARNING, force=True)
    return writer


class _Forwarder(logging.Handler):
    """Hands records of the standard library's logging to structlog."""

    def emit(self, record: logging.LogRecord) -> None:
        """Log the record at its own level."""
        log = structlog.get_logger(component=record.name)
        log.log(record.levelno, record.getMessage(), exc_info=record.exc_info)


LINES_SHOWN = 12
"""Of a list of lines, on a terminal; whoever needs them all sends the log to a file."""


def _shorten_lists(_logger: object, _method: str, event: EventDict) -> EventDict:
    """For a terminal: the newest of a list of lines below the message, each on its own, and how many there are more."""
    lines = event.get("lines")
    if not isinstance(lines, list):
        return event
    earlier = len(lines) - LINES_SHOWN
    more = [f"({earlier} earlier lines: only where the log is a file)"] if earlier > 0 else []
    told = [f"    {line}" for line in (*more, *lines[-LINES_SHOWN:])]
    return {**event, "lines": len(lines), "stack": "\n".join(told)}  # what is printed below the line


def _renderers(*, on_terminal: bool) -> list[Processor]:
    if on_terminal:
        return [_shorten_lists, structlog.dev.ConsoleRenderer()]
    return [structlog.processors.format_exc_info, structlog.processors.JSONRenderer(default=str)]


@dataclass(slots=True)
class _Held:
    """What has been kept back of one event: how many, and the newest one's fields."""

    count: int = 0
    fields: dict[str, Any] = field(default_factory=dict)


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
