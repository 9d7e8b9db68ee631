"""Logs on stderr: a JSON object per line for systemd and files, colours for a terminal; a thread writes them.

An unread stderr never blocks the robot.
"""

import atexit
import logging
import os
import queue
import sys
import threading
from io import StringIO
from typing import TextIO

import structlog
from structlog.typing import EventDict, ExcInfo, FilteringBoundLogger, Processor

from chefbotd.core.printable import plain
from chefbotd.settings.model import Level

ROOM_FOR_LINES = 2000
FLUSH_TIMEOUT_S = 0.5


class LogWriter:
    """A stream whose writes never block and never fail. Lines that find no room are counted and reported later.

    The thread writes to the descriptor itself: at the interpreter's end nobody must wait for a stream's lock.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._texts: queue.Queue[str | None] = queue.Queue(ROOM_FOR_LINES)
        self._lost = 0
        self._thread = threading.Thread(target=self._write_texts, name="log", daemon=True)
        self._thread.start()
        atexit.register(self.close)

    def write(self, text: str) -> None:
        """Queue a line for the thread."""
        try:
            self._texts.put_nowait(text)
        except queue.Full:
            self._lost += 1

    def flush(self) -> None:
        """Do nothing: the queue is the only buffer."""

    def close(self) -> None:
        """Wait until the queued lines are written, for ``FLUSH_TIMEOUT_S`` at most."""
        atexit.unregister(self.close)
        try:
            self._texts.put_nowait(None)
        except queue.Full:
            return
        self._thread.join(FLUSH_TIMEOUT_S)

    def _write_texts(self) -> None:
        while (text := self._texts.get()) is not None:
            lost, self._lost = self._lost, 0
            if lost:
                self._write_text(f'{{"event": "log lines lost, nobody reads them", "lines": {lost}}}\n')
            self._write_text(text)

    def _write_text(self, text: str) -> None:
        data = text.encode(errors="backslashreplace")
        try:
            while data:
                data = data[os.write(self._descriptor, data) :]
        except OSError:  # a closed pipe, a full disk: there is nowhere to complain
            self._lost += 1


STDERR = 2
METHODS = ("debug", "info", "warning", "error", "critical", "exception", "log")
"""The methods of a logger to which the level applies."""


def configure(level: Level) -> LogWriter:
    """Set up structlog for the whole process; what the standard library logs (asyncio's complaints) joins it.

    The lines are written by a thread: closing what is returned waits for the last of them.
    """
    writer = LogWriter(STDERR)
    on_terminal = sys.stderr.isatty()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="%H:%M:%S", utc=False)
            if on_terminal
            else structlog.processors.TimeStamper(fmt="iso", utc=True),
            *_renderers(on_terminal=on_terminal),
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
    """Set the lowest level that is logged, for existing loggers too. Call ``configure`` first."""
    filtering = structlog.make_filtering_bound_logger(getattr(logging, level.upper()))
    used = structlog.get_config()["wrapper_class"]
    for name in METHODS:
        setattr(used, name, getattr(filtering, name))


class _Forwarder(logging.Handler):
    """Hands records of the standard library's logging to structlog."""

    def emit(self, record: logging.LogRecord) -> None:
        """Log the record at its own level."""
        log = structlog.get_logger(component=record.name)
        log.log(record.levelno, record.getMessage(), exc_info=record.exc_info)


LINES_SHOWN = 12
"""How many lines of a list a terminal shows; a log file has all of them."""


def _shorten_lists(_logger: object, _method: str, event: EventDict) -> EventDict:
    """Show the newest of a list of lines below the message, one per line, and the number of the others."""
    lines = event.get("lines")
    if not isinstance(lines, list):
        return event
    earlier = len(lines) - LINES_SHOWN
    more = [f"({earlier} earlier lines: only where the log is a file)"] if earlier > 0 else []
    text = [f"    {line}" for line in (*more, *lines[-LINES_SHOWN:])]
    return {**event, "lines": len(lines), "stack": "\n".join(text)}  # what is printed below the line


def _leave_out_nothing(_logger: object, _method: str, event: EventDict) -> EventDict:
    """Without the fields that say nothing: most lines then fit 80 columns, and an address is not cut in two."""
    return {key: value for key, value in event.items() if value is not None}


def _print_plainly(_logger: object, _method: str, event: EventDict) -> EventDict:
    """Show what a terminal would take for a command, whoever wrote it, as what it is not."""
    return {
        key: value if isinstance(value, bool | int | float | None) or key == "exc_info" else plain(str(value))
        for key, value in event.items()
    }


def _plain_traceback(stream: TextIO, exc_info: ExcInfo) -> None:
    text = StringIO()
    structlog.dev.plain_traceback(text, exc_info)
    stream.write(plain(text.getvalue()))


def _renderers(*, on_terminal: bool) -> list[Processor]:
    if on_terminal:
        return [
            _shorten_lists,
            _leave_out_nothing,
            _print_plainly,
            structlog.dev.ConsoleRenderer(
                pad_event_to=0, pad_level=False, exception_formatter=_plain_traceback
            ),
        ]
    return [structlog.processors.format_exc_info, structlog.processors.JSONRenderer(default=str)]
