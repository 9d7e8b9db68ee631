"""Whether a board writes its lines, or its clock, in another way than the protocol: then no cable is to blame.

A damaged line is a matter of chance, and differs from the next one. A kind of line that is refused each time for the
same reason is a format; a clock that runs at a thousandth of the computer's counts milliseconds.
"""

import math
import re
from collections.abc import Callable

from msgspec import field

from chefbotd.core.record import MutableState, Record, replace
from chefbotd.core.sentence import Sentence
from firmware_protocol.codec import FROM_BOARD, Variant, rows_from_board
from firmware_protocol.messages import Malformed

ENOUGH_REFUSED = 20
"""So many lines of a kind in a row, refused for the same reason: with half of them damaged, one case in a million."""

DAMAGED_COSTS = 3
"""A line that is refused for another reason takes off so many: with a tenth of them damaged, a format is still found."""

MICROS_SPAN = 2**32
SPAN_S = 1.5
"""The board's clock is compared with the computer's over so long, twice."""

STEADY, LIKE_OURS = 0.05, (0.9, 1.1)
"""The two comparisons agree within this share; a clock within these of ours is one. A resonator is good for 0.5 %."""

ONE_COUNT = 1e-6 / SPAN_S
"""By how much the last digit changes a comparison."""

UNITS = {"milliseconds": 1e-3, "seconds": 1e-6, "tenths of a millisecond": 1e-2, "nanoseconds": 1e3}
"""What a board may count in the place of microseconds, and how fast such a clock seems to run."""

OTHER_SEPARATOR = re.compile(rb"(?:^|\n)[a-z]( |,|;|:|, )-?[0-9]")


class KindRefusals(Record, frozen=True):
    """Lines of one kind that were refused for ``reason``, in a row; ``accepted`` counts the good ones before them."""

    reason: str
    accepted: int
    refused: int = 0
    example: str = ""
    detail: str = ""


class FormatWatch(MutableState):
    """Counts refused lines by their kind."""

    _kinds: dict[str, KindRefusals] = field(default_factory=dict)

    def note_refused(
        self, line: Malformed, shown: str, kinds: frozenset[str], accepted_of: Callable[[str], int]
    ) -> None:
        """A line was refused; ``shown`` is the line for people, ``accepted_of`` counts the good lines of a kind."""
        kind = line.line.partition(FROM_BOARD.separator)[0].decode("ascii", "replace")
        if kind not in kinds:
            return
        accepted, refusals = accepted_of(kind), self._kinds.get(kind)
        if refusals is not None and refusals.accepted == accepted and refusals.reason != line.reason:
            if refusals.refused > DAMAGED_COSTS:  # a line of another format may be damaged besides
                self._kinds[kind] = replace(refusals, refused=refusals.refused - DAMAGED_COSTS)
                return
            refusals = None
        if refusals is None or refusals.accepted != accepted:
            refusals = KindRefusals(line.reason, accepted)
        self._kinds[kind] = KindRefusals(refusals.reason, accepted, refusals.refused + 1, shown, line.detail)

    def refusals(self) -> dict[str, KindRefusals]:
        """What is known of each kind that was refused."""
        return self._kinds

    def refused_kind(self, accepted_of: Callable[[str], int]) -> str | None:
        """A sentence about a kind of line that is always refused; None where there is none."""
        for kind, refusals in self._kinds.items():
            if refusals.refused >= ENOUGH_REFUSED and accepted_of(kind) == refusals.accepted:
                return describe_refused(kind, refusals.refused, refusals.detail, refusals.example)
        return None


def describe_refused(kind: str, count: int, detail: str, example: str) -> str:
    """A kind of line that is always refused, for people."""
    return Sentence(
        "board.lines_refused",
        "every {kind!r} line is refused ({count} in a row): {detail}, such as '{example}'. The board writes it "
        "in another format than docs/protocol.md; this is no damage",
        kind=kind,
        count=count,
        detail=detail,
        example=example,
    )


def kinds_of(variant: Variant) -> dict[str, tuple[str, ...]]:
    """The names of the messages' classes that each kind of line stands for."""
    classes: dict[str, tuple[str, ...]] = {}
    for row in rows_from_board(variant):
        classes[row.kind] = (*classes.get(row.kind, ()), row.message.__name__)
    return classes


def has_other_separator(sample: bytes) -> bool:
    """Whether text looks like a board's lines, but with another separator than one TAB."""
    return bool(OTHER_SEPARATOR.search(sample))


class TimeUnitWatch(MutableState):
    """Compares the board's clock with the computer's, as they were at the ends of two spans."""

    _from: tuple[int, float] | None = None
    _rate: float | None = None
    rate: float | None = None

    def observe(self, micros: int, host_s: float) -> None:
        """A reading of the board's clock (uint32) and when it was read. ``rate`` is set where two spans agree."""
        if self._from is None:
            self._from = micros, host_s
            return
        span_s = host_s - self._from[1]
        if span_s < SPAN_S:
            return
        ahead = (micros - self._from[0]) % MICROS_SPAN
        if ahead >= MICROS_SPAN // 2:  # it went back: the board has restarted
            self.begin()
            return
        rate = ahead * 1e-6 / span_s
        before, self._from, self._rate = self._rate, (micros, host_s), rate
        agrees = before is not None and math.isclose(before, rate, rel_tol=STEADY, abs_tol=ONE_COUNT)
        if agrees:  # a span that agrees with none, as of a reading that waited, ends nothing
            self.rate = rate

    def begin(self) -> None:
        """A port was opened, or the board has restarted."""
        self._from = self._rate = self.rate = None

    @property
    def complaint(self) -> str | None:
        """A sentence about a clock that is none in microseconds; None where all is well, or nothing is known."""
        return None if self.rate is None else describe_rate(self.rate)


def describe_rate(rate: float) -> str | None:
    """What a clock that runs ``rate`` times as fast as the computer's counts, for people; None where it is right."""
    if LIKE_OURS[0] <= rate <= LIKE_OURS[1]:
        return None
    for unit, seems in UNITS.items():
        if math.isclose(rate, seems, rel_tol=2 * STEADY, abs_tol=ONE_COUNT):
            return Sentence(
                "board.time_unit",
                "the time column of 't' counts {unit}, and the protocol has microseconds there (micros()): "
                "speeds would be wrong by {times:g} times",
                unit=unit,
                times=1 / seems,
            )
    return Sentence(
        "board.clock_rate",
        "the board's clock runs {rate:.2g} times as fast as the computer's, so speeds are wrong by as much: is "
        "its program built for another frequency of the processor?",
        rate=rate,
    )
