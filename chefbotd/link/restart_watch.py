"""Detects restarts without a banner or a clock, by `Reset Done` or by counters near zero.

Of the published sketches one has no clock and no banner, and one says `Reset Done` and goes on as if nothing were.
"""

from chefbotd.core.record import MutableState, Record
from chefbotd.core.sentence import Sentence

NEAR_ZERO_COUNTS = 100
"""Counters of a board that has just started are not farther from zero, but for wheels that still roll out."""

ROLL_OUT_S = 0.3
"""How long wheels may keep turning after the board's counters restart: nothing brakes until its sketch runs."""

FAR_COUNTS = 500
"""Counters that were not farther from zero than this may have come there by driving; believing them costs 3 cm."""

AT_ZERO_COUNTS = 2
"""So near to zero on every wheel at once, counters do not come by driving."""

SILENCE_S = 0.1
"""A sketch that starts prints nothing for longer than between two of its lines; the published ones wait a second."""

GONE_ON_LINES = 3
"""After this many lines behind `Reset Done`, the board has not restarted."""


class _Counted(Record, frozen=True, array_like=True):
    stamp_s: float
    counts: tuple[int, ...]


class RestartWatch(MutableState):
    """Sees every encoder line of one board, over reconnections too."""

    has_gone_on: bool = False  # since its last `Reset Done`, which was no restart then
    _before: _Counted | None = None
    _rates: tuple[float, ...] = ()
    _said_s: float | None = None
    _lines_since: int = 0

    def reset_done(self, now_s: float) -> None:
        """The board says that it is about to restart."""
        self._said_s, self._lines_since, self.has_gone_on = now_s, 0, False

    def restarted(self) -> None:
        """A restart was detected: earlier counts belong to another run."""
        self._before, self._rates, self._said_s, self.has_gone_on = None, (), None, False

    def observe(self, now_s: float, counts: tuple[int, ...], *, has_clock: bool) -> str | None:
        """How this line shows that the board restarted; None if it does not.

        A board that has a clock shows it by that, so its counts prove nothing more.
        """
        if has_clock:
            if self._said_s is not None:
                self._count_line()
            return None
        before = self._before
        silent_s = 0.0 if before is None else now_s - before.stamp_s
        cause = self._cause(counts, silent_s)
        if cause is not None:
            self.restarted()
        elif self._said_s is not None:
            self._count_line()
        if before is not None and cause is None and 0 < silent_s < SILENCE_S:
            moved = zip(before.counts, counts, strict=True)
            self._rates = tuple([(new - old) / silent_s for old, new in moved])
        if before is None or silent_s > 0 or cause is not None:
            self._before = _Counted(now_s, counts)
        return cause

    def _count_line(self) -> None:
        """A line came after `Reset Done`: enough of them, and the board has gone on."""
        self._lines_since += 1
        if self._lines_since >= GONE_ON_LINES:
            self._said_s, self.has_gone_on = None, True

    def _cause(self, counts: tuple[int, ...], silent_s: float) -> str | None:
        if silent_s < SILENCE_S:
            return None
        if self._said_s is not None and not self._lines_since:
            return Sentence("board.fell_silent", "it said 'Reset Done' and fell silent")
        if self._is_back_at_zero(counts, silent_s):
            return Sentence(
                "board.counters_zero",
                "its counters were near zero, {counts}, after {seconds:.1f} s of silence",
                counts=counts,
                seconds=silent_s,
            )
        return None

    def _is_back_at_zero(self, counts: tuple[int, ...], silent_s: float) -> bool:
        """Whether the counters are near zero all at once, and the wheels cannot have rolled there."""
        before = self._before
        if before is None or max(map(abs, before.counts)) < FAR_COUNTS:
            return False
        if max(map(abs, counts)) <= AT_ZERO_COUNTS:
            return True
        rates = self._rates or (0.0,) * len(counts)
        if not all(_has_rolled(0, new, rate * ROLL_OUT_S) for new, rate in zip(counts, rates, strict=True)):
            return False
        return not all(
            _has_rolled(old, new, rate * silent_s)
            for old, new, rate in zip(before.counts, counts, rates, strict=True)
        )


def _has_rolled(before: int, after: int, farthest: float) -> bool:
    """Whether a wheel that went on as it turned, or came to rest on the way, may be there."""
    low, high = sorted((0.0, farthest))
    return low - NEAR_ZERO_COUNTS <= after - before <= high + NEAR_ZERO_COUNTS
