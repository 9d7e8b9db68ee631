"""Writes lines to the board. A stop is written first, before any unsent line, and last."""

import asyncio
import threading
from collections import deque

import structlog

from chefbotd.bus import Bus, Inbox
from chefbotd.clock import Clock
from chefbotd.core.events import Direction, LineSeen, SafetyChanged
from chefbotd.core.events.inputs import BOARD_LINK, DrainAnswered, LinkBytesWritten
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.inputs import inputs_of
from chefbotd.link.health import show
from chefbotd.link.port import PortTransport

log = structlog.get_logger(component="link")

LINES_KEPT = 200
LINES_LOGGED = 20
SETTLE_S = 0.05
"""What came just after the fault belongs to its story: the dump waits for it."""

DUMPS_APART_S = 10.0

Seen = tuple[float, bytes]


class LineRing:
    """The last lines of the newest ``LINES_KEPT`` reads from the board, and as many to it, each with its time."""

    def __init__(self) -> None:
        self.heard: deque[tuple[float, list[bytes]]] = deque(maxlen=LINES_KEPT)
        self.said: deque[Seen] = deque(maxlen=LINES_KEPT)

    def as_text(self, now_s: float, most: int = LINES_LOGGED) -> list[str]:
        """The newest in the order of time: seconds from ``now_s``, ``<`` from the board or ``>`` to it, the line.

        The ring of the recorder has all of them, and the doctor's bundle has that ring.
        """
        lines = [(stamp_s, "<", line) for stamp_s, read in self.heard for line in read]
        lines += [(stamp_s, ">", line) for stamp_s, line in self.said]
        lines.sort(key=lambda seen: seen[0])
        return [f"{stamp_s - now_s:.3f} {sign} {show(line)}" for stamp_s, sign, line in lines[-most:]]


class FaultLog:
    """Writes the ring to the log when a fault latches; a user's stop is no fault."""

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


FIRST_STOPS = 2
"""A line that was cut short, here or in the board's own buffer, takes the first stop with it.

An empty line before the stop would end it too, but in the parser of the classic sketch it is undefined what that does.
"""

LAST_STOPS = 4
"""One damaged line, which may take the next with it, must not leave the motors on for ever."""


class WriterState(MutableState):
    """What was written and asked so far.

    ``queries`` counts how often ``has_drained`` was asked, ``had_drained`` is what the answer was then.
    """

    lines_out: int = 0
    queries: int = 0
    had_drained: bool = False


class BoardWriter(StatefulPart[WriterState]):
    """Says lines while a port is open; counts, keeps and publishes each. ``stop`` is the line that stops the motors."""

    def __init__(self, bus: Bus, clock: Clock, lines: LineRing, stop: bytes) -> None:
        self._bus, self._clock, self._lines, self._stop = bus, inputs_of(clock), lines, stop
        self._port: PortTransport | None = None
        self._port_lock = threading.Lock()
        self.memory = WriterState()

    def begin(self, port: PortTransport) -> None:
        """A port was opened; ``stop_first`` is to follow."""
        port.set_write_buffer_limits(high=0)
        self._port = port

    def end(self) -> None:
        """The port is gone, or as good as: nothing more is said there."""
        with self._port_lock:
            self._port = None

    def has_drained(self) -> bool:
        """Whether the port is open and has sent everything."""
        port, memory = self._port, self.memory
        drained = port is not None and not port.get_write_buffer_size()
        memory.queries += 1
        if drained is not memory.had_drained:
            memory.had_drained = drained
            if self._clock.recording:
                self._clock.publish(DrainAnswered(self._clock.now_s(), memory.queries, drained))
        return drained

    def unread_bytes(self) -> int:
        """How many bytes wait to be read; none without a port."""
        return 0 if self._port is None else self._port.unread_bytes()

    def write(self, line: bytes, now_s: float) -> None:
        """Write a line after all that is unsent; without a port it is dropped."""
        if self._port is not None:
            self._port.write(line)
            self._note(line, now_s, 1)

    def stop_first(self, now_s: float) -> None:
        """Write a stop before all that is unsent, which is dropped."""
        self.write_first(self._stop, now_s)

    def write_first(self, line: bytes, now_s: float, again: bytes | None = None) -> None:
        """Write a line before all that is unsent, which is dropped; twice, as what it cuts short takes the first.

        ``again`` is the second one where it reads otherwise: a checked line has its own number.
        """
        if self._port is None:
            return
        if again is None:
            self._port.overtake(line * FIRST_STOPS)
            self._note(line, now_s, FIRST_STOPS)
        else:
            self._port.overtake(line + again)
            self._note(line, now_s, 1)
            self._note(again, now_s, 1)

    def stop_last(self) -> None:
        """The shutdown stop on this port, which is closed then: stops, instead of all that is unsent."""
        if self._port is not None:
            self._port.close_saying(self._stop * LAST_STOPS)
            self._note(self._stop, self._clock.now_s(), LAST_STOPS)
            self.end()

    def stop_from_thread(self) -> bool:
        """As ``stop_first``, past a loop that stands still, from any thread: whether the port took it."""
        with self._port_lock:
            return self._port is not None and self._port.write_from_thread(self._stop * FIRST_STOPS)

    def _note(self, line: bytes, now_s: float, times: int) -> None:
        if self._clock.recording:
            self._clock.publish(LinkBytesWritten(now_s, BOARD_LINK, line * times))
        text = line.rstrip(b"\r\n")
        self.memory.lines_out += times
        self._lines.said.extend(((now_s, text),) * times)
        if self._bus.has_listeners(LineSeen):
            for _ in range(times):
                self._bus.publish(LineSeen(now_s, Direction.TO_BOARD, text))
