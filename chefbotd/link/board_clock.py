"""The board's clock: unwrapped, protected against damaged lines, and related to the host's clock.

Speeds are differences of the board's own time, so USB and scheduling jitter never reach them. The relation to host time
is a straight line (offset and skew) fitted by exponentially weighted least squares, with late readings left out.
"""

import math
from enum import StrEnum

from msgspec import field

from chefbotd.core.record import MutableState, Record

MICROS_PER_TURN = 2**32
"""`t` is a uint32 of microseconds: it wraps every 71.6 minutes."""

CYCLE_ROUNDING_S = 0.011
"""The wire's two decimals, and the time between the board's two readings of its clock."""

RESTART_SLACK_S = 0.05
"""A board that restarted counts from zero since then: it cannot show more than the host saw pass, and this much."""

HOST_JITTER_S = 0.03
"""How unevenly the host reads lines that came evenly; a host that was later than this costs one more cycle."""

CLOCKS_APART = 0.01
"""How far the two clocks' seconds may differ: ten times what a ceramic resonator does."""

LONGEST_GAP_S = 10.0
"""A pair of agreeing readings may lie this far ahead of the last good one and still be the same run of the clock."""


class StampVerdict(StrEnum):
    """What a reading of the board's clock turned out to be."""

    GOOD = "good"
    SUSPECT = "suspect"
    RESYNCED = "resynced"
    RESTARTED = "restarted"


class _Reading(Record, frozen=True):
    micros: int
    board_s: float
    host_s: float


class ClockRelation(MutableState):
    """``host = offset + (1 + skew) * board``, by weighted least squares that forgets with a time constant.

    A line is late when it waited in a buffer, never early: readings later than six times the usual scatter are left
    out. When many in a row are, the clocks really have parted (the host slept) and the fit starts afresh.
    """

    MEMORY_S = 120.0
    LATE_FLOOR_S = 0.005
    MOST_LEFT_OUT = 50
    FIRST_READINGS = 10

    excluded: int = 0
    _weight: float = 0.0
    _mean_board: float = 0.0
    _mean_host: float = 0.0
    _var_board: float = 0.0
    _covariance: float = 0.0
    _rate: float = 1.0
    _newest_board_s: float = 0.0
    _scatter_s: float = 0.0
    _count: int = 0
    _left_out_in_a_row: int = 0

    def _clear(self) -> None:
        self._weight = self._mean_board = self._mean_host = 0.0
        self._var_board = self._covariance = 0.0
        self._rate = 1.0
        self._newest_board_s = self._scatter_s = 0.0
        self._count = self._left_out_in_a_row = 0

    def observe(self, board_s: float, host_s: float) -> None:
        """Fit one more pair of simultaneous readings, unless it came too late to say anything."""
        if self._count > 1:
            residual_s = host_s - self.host_s(board_s)
            if (
                self._count >= self.FIRST_READINGS
                and residual_s > self.LATE_FLOOR_S
                and residual_s > 6 * self._scatter_s
            ):
                self._leave_out()
                if self.is_known:
                    return
            else:
                self._left_out_in_a_row = 0
                self._scatter_s += (abs(residual_s) - self._scatter_s) / min(self._count, 200)
        self._fit(board_s, host_s)

    @property
    def is_known(self) -> bool:
        """Whether there was a reading to go by."""
        return self._count > 0

    def _leave_out(self) -> None:
        self.excluded += 1
        self._left_out_in_a_row += 1
        if self._left_out_in_a_row >= self.MOST_LEFT_OUT:
            self._clear()

    def _fit(self, board_s: float, host_s: float) -> None:
        since_s = board_s - self._newest_board_s
        if self._count and since_s > 0:
            keep = math.exp(-since_s / self.MEMORY_S)
            self._weight *= keep
            self._var_board *= keep
            self._covariance *= keep
        self._weight += 1.0
        from_mean_s = board_s - self._mean_board
        self._mean_board += from_mean_s / self._weight
        self._mean_host += (host_s - self._mean_host) / self._weight
        self._var_board += from_mean_s * (board_s - self._mean_board)
        self._covariance += from_mean_s * (host_s - self._mean_host)
        self._rate = self._covariance / self._var_board if self._var_board > 1.0 else 1.0
        self._newest_board_s = board_s
        self._count += 1

    def host_s(self, board_s: float) -> float:
        """Host time at a board time; before the first reading the board time itself."""
        if not self._count:
            return board_s
        return self._mean_host + self._rate * (board_s - self._mean_board)

    @property
    def skew_ppm(self) -> float | None:
        """How much faster host time runs than the board's, in parts per million; None until it can be told."""
        return (self._rate - 1.0) * 1e6 if self._var_board > 1.0 else None

    @property
    def jitter_s(self) -> float | None:
        """Mean distance of the readings from the line; None until there is a line."""
        return self._scatter_s if self._count > 1 else None


class BoardClock(MutableState):
    """Follows the `t` lines of one board. ``board_s`` goes on over restarts.

    ``stamp_s`` is the host time of the last good reading, by the relation of the clocks: it never goes back, and never
    lies after the line was read. ``late_s`` is how much later that was; 0 while the clock is in doubt.
    """

    stamp_s: float = -math.inf
    late_s: float = 0.0
    suspects: int = 0
    relation: ClockRelation = field(default_factory=ClockRelation)
    _last: _Reading | None = None
    _suspect: _Reading | None = None

    def expect_new_count(self) -> None:
        """The board is known to have restarted (its banner was seen): take the next reading as it is."""
        if self._last is not None:
            self._suspect = None
            self._last = None
            self.relation = ClockRelation()
            self.late_s = 0.0

    @property
    def in_doubt(self) -> bool:
        """The newest reading disagreed with all before it: what was measured with it must wait for the next."""
        return self._suspect is not None

    def observe(self, micros: int, cycle_s: float, host_s: float) -> StampVerdict:
        """Take a `t` line: µs since boot (uint32), seconds since the cycle before, and when it was read."""
        last = self._last
        if last is None:
            self._accept_reading(_Reading(micros, host_s, host_s))
            return StampVerdict.GOOD
        if _follows(last, micros, cycle_s, host_s):
            step_s = ((micros - last.micros) % MICROS_PER_TURN) * 1e-6
            self._accept_reading(_Reading(micros, last.board_s + step_s, host_s))
            return StampVerdict.GOOD
        if self._suspect is not None and _follows(self._suspect, micros, cycle_s, host_s):
            return self._reanchor(last, micros, host_s)
        self.suspects += 1
        self.late_s = 0.0
        self._suspect = _Reading(micros, last.board_s, host_s)
        return StampVerdict.SUSPECT

    def board_s(self, host_s: float) -> float:
        """Board time at a host time shortly after the last reading; the host's own before the first."""
        if self._last is None:
            return host_s
        return self._last.board_s + max(0.0, host_s - self._last.host_s)

    def time_of_s(self, micros: int) -> float | None:
        """Board time of another reading of its counter, within half a turn of the last good one; None before that."""
        if self._last is None:
            return None
        half = MICROS_PER_TURN // 2
        return self._last.board_s + ((micros - self._last.micros + half) % MICROS_PER_TURN - half) * 1e-6

    @property
    def latest_s(self) -> float | None:
        """Board time of the last good reading; None before the first."""
        return None if self._last is None else self._last.board_s

    @property
    def newest(self) -> tuple[int, float] | None:
        """The newest reading, believed or not, in us, and when it was read; None before the first."""
        reading = self._suspect or self._last
        return None if reading is None else (reading.micros, reading.host_s)

    def _accept_reading(self, reading: _Reading) -> None:
        self._last, self._suspect = reading, None
        self.relation.observe(reading.board_s, reading.host_s)
        made_s = self.relation.host_s(reading.board_s)
        if made_s > self.stamp_s:
            self.stamp_s = made_s if made_s < reading.host_s else reading.host_s
        self.late_s = reading.host_s - self.stamp_s

    def _reanchor(self, last: _Reading, micros: int, host_s: float) -> StampVerdict:
        """Two readings in a row agree with each other and not with the past: believe them.

        A board that can have started since the last good reading has, unless it is as far ahead as the host is.
        """
        ahead_s = ((micros - last.micros) % MICROS_PER_TURN) * 1e-6
        elapsed_s = max(0.0, host_s - last.host_s)
        restarted = micros * 1e-6 < elapsed_s + RESTART_SLACK_S and not _agree(ahead_s, elapsed_s)
        if ahead_s <= LONGEST_GAP_S and not restarted:
            self._accept_reading(_Reading(micros, last.board_s + ahead_s, host_s))
            return StampVerdict.RESYNCED
        self.relation = ClockRelation()
        self._accept_reading(_Reading(micros, last.board_s + elapsed_s, host_s))
        return StampVerdict.RESTARTED if restarted else StampVerdict.RESYNCED


def _follows(earlier: _Reading, micros: int, cycle_s: float, host_s: float) -> bool:
    """Whether the step since an earlier reading is what the line itself says it is, or what the host saw pass."""
    step_s = ((micros - earlier.micros) % MICROS_PER_TURN) * 1e-6
    if abs(step_s - cycle_s) <= CYCLE_ROUNDING_S + 0.01 * step_s:
        return True
    return step_s > 0.0 and _agree(step_s, host_s - earlier.host_s)


def _agree(board_s: float, host_s: float) -> bool:
    """Whether two durations, one by each clock, may be of the same thing."""
    return abs(board_s - host_s) <= HOST_JITTER_S + CLOCKS_APART * host_s


# Estimates when a board without a clock printed each encoder line: evenly, though several arrive in one read.
#
# Several lines of one read share the host's stamp, but they are cycles apart. So each line follows the one before it by
# the mean cycle, and the host's stamps only pull this slowly into place. What comes out depends on the lines' stamps
# alone: how the bytes of a read are cut makes no difference.

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
