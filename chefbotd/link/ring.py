"""Keeps the last lines in both directions at low cost, and writes them to the log after a fault."""

import asyncio
from collections import deque

import structlog

from chefbotd.bus import Bus, Inbox
from chefbotd.core.events import SafetyChanged
from chefbotd.link.health import show

log = structlog.get_logger(component="link")

LINES_KEPT = 200
SETTLE_S = 0.05
"""What came just after the fault belongs to its story: the dump waits for it."""

DUMPS_APART_S = 10.0

Seen = tuple[float, bytes]


class LineRing:
    """The newest ``LINES_KEPT`` lines from the board and to it, each with the time it was read or written."""

    def __init__(self) -> None:
        self.heard: deque[Seen] = deque(maxlen=LINES_KEPT)
        self.said: deque[Seen] = deque(maxlen=LINES_KEPT)

    def as_text(self, now_s: float) -> list[str]:
        """Both ways in the order of time: seconds from ``now_s``, ``<`` from the board or ``>`` to it, the line."""
        lines = [(stamp_s, "<", line) for stamp_s, line in self.heard]
        lines += [(stamp_s, ">", line) for stamp_s, line in self.said]
        lines.sort(key=lambda seen: seen[0])
        return [f"{stamp_s - now_s:.3f} {sign} {show(line)}" for stamp_s, sign, line in lines]


class FaultLog:
    """Writes the ring to the log when a fault latches; a user's stop is none."""

    def __init__(self, bus: Bus, ring: LineRing) -> None:
        self._ring = ring
        self._inbox: Inbox[SafetyChanged] = bus.subscribe(SafetyChanged)
        self._fault: str | None = None
        self._dumped_s = float("-inf")
        self.dumps = 0

    async def run(self) -> None:
        """Wait for faults until cancelled; of faults within ``DUMPS_APART_S`` only the first is dumped."""
        async for event in self._inbox:
            fault, self._fault = self._fault, event.fault
            if event.fault not in (None, fault) and event.stamp_s - self._dumped_s >= DUMPS_APART_S:
                self._dumped_s = event.stamp_s
                await asyncio.sleep(SETTLE_S)
                self._dump(event)

    def _dump(self, event: SafetyChanged) -> None:
        self.dumps += 1
        log.warning("lines around a fault", fault=event.fault, lines=self._ring.as_text(event.stamp_s))
