"""Estimates when a board without a clock printed each encoder line: evenly, though several arrive in one read.

Several lines of one read share the host's stamp, but they are cycles apart. So each line follows the one before it by
the mean cycle, and the host's stamps only pull this slowly into place. What comes out depends on the lines' stamps
alone: how the bytes of a read are cut makes no difference.
"""

import math

from chefbotd.core.record import MutableState

FIRST_CYCLE_S = 0.004
"""Until the first cycles are measured: the published sketch without a clock prints about 290 lines a second."""

PULL = 0.02
"""Share of the distance to the host's stamp that a line makes up: reads that come 16 ms apart move it little."""

LEAST_STEP, MOST_STEP = 0.5, 2.0
"""Shares of the mean cycle: two lines are never closer than the one, nor farther than the other without a pause."""

PAUSE_S = 0.025
PAUSE_CYCLES = 5.0
"""A line that is late by more than both of these comes after a pause, and is where the host saw it."""

MEMORY_S = 1.0
LONGEST_CYCLE_S = 0.25


class CycleClock(MutableState):
    """Follows the encoder lines of one board; ``observe`` each of them in their order."""

    _line_s: float | None = None
    _read_s: float = -math.inf
    _lines_of_read: int = 0
    _measured_s: float = 0.0
    _measured_lines: float = 0.0

    @property
    def cycle_s(self) -> float:
        """The mean time between two lines, lately."""
        return self._measured_s / self._measured_lines if self._measured_lines else FIRST_CYCLE_S

    def observe(self, host_s: float) -> float:
        """When this line was printed, in the host's time; ``host_s`` is when it was read. It always increases."""
        if host_s != self._read_s:
            self._begin_read(host_s)
        self._lines_of_read += 1
        self._line_s = host_s if self._line_s is None else self._next(self._line_s, host_s)
        return self._line_s

    def _next(self, before_s: float, host_s: float) -> float:
        cycle_s = self.cycle_s
        late_s = host_s - (before_s + cycle_s)
        if late_s > max(PAUSE_S, PAUSE_CYCLES * cycle_s):
            return host_s
        return before_s + min(MOST_STEP * cycle_s, max(LEAST_STEP * cycle_s, cycle_s + PULL * late_s))

    def _begin_read(self, host_s: float) -> None:
        """The lines of the read before took the time since the one before that; a read after a pause tells nothing."""
        interval_s, self._read_s = host_s - self._read_s, host_s
        lines, self._lines_of_read = self._lines_of_read, 0
        if lines and 0 < interval_s <= LONGEST_CYCLE_S:
            keep = math.exp(-interval_s / MEMORY_S)
            self._measured_s = self._measured_s * keep + interval_s
            self._measured_lines = self._measured_lines * keep + lines
