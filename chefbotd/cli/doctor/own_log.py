"""The log of the doctor's own daemon: kept for the support bundle, and not printed between the findings."""

from collections import deque

import structlog

LINES_KEPT = 3000


class LogKept:
    """A stream that keeps the newest lines."""

    def __init__(self) -> None:
        self._lines: deque[str] = deque(maxlen=LINES_KEPT)

    def write(self, text: str) -> None:
        """Keep a line."""
        self._lines.append(text)

    def flush(self) -> None:
        """Nothing to do."""

    def text(self) -> str:
        """All that is kept."""
        return "".join(self._lines)


def keep_log() -> LogKept:
    """Have everything that is logged in this process kept instead of printed."""
    kept = LogKept()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            structlog.processors.JSONRenderer(default=str),
        ],
        logger_factory=structlog.WriteLoggerFactory(kept),  # type: ignore[arg-type]
        cache_logger_on_first_use=False,
    )
    return kept
