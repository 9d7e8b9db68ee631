"""Logs on stderr: one JSON object per line for systemd and files, colours for a terminal."""

import logging
import sys

import structlog
from structlog.typing import EventDict, FilteringBoundLogger, Processor

from chefbotd.process.log_writer import LogWriter
from chefbotd.settings.model import Level

STDERR = 2
METHODS = ("debug", "info", "warning", "error", "critical", "exception", "log")
"""Those of a logger that heed the level."""


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
        wrapper_class=_logger_class(level),
        logger_factory=structlog.WriteLoggerFactory(writer),  # type: ignore[arg-type]
        cache_logger_on_first_use=True,
    )
    logging.basicConfig(handlers=[_Forwarder()], level=logging.WARNING, force=True)
    return writer


def _logger_class(level: Level) -> type[FilteringBoundLogger]:
    """A class of loggers of its own, which ``set_level`` can change under the loggers that are made of it."""
    filtering = structlog.make_filtering_bound_logger(getattr(logging, level.upper()))
    return type("Logger", (filtering,), {})


def set_level(level: Level) -> None:
    """Log from this level on; also through loggers that have been in use before. ``configure`` comes first."""
    wanted = structlog.make_filtering_bound_logger(getattr(logging, level.upper()))
    used = structlog.get_config()["wrapper_class"]
    for name in METHODS:
        setattr(used, name, getattr(wanted, name))


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
