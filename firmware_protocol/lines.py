"""The grammar of one line kind: its numbers, how they become a message and how a message becomes them.

A number on the wire is digits with an optional minus before them, and with at most one point where the field
has decimals. Python's ``int`` and ``float`` take more than that (``1_0``, ``+1``, ``1e3``, ``nan``); the
codec lets nothing but ``NUMERIC`` come near them, and ``explain`` names what else stood there.

Boards of other makes write whole numbers with decimals (``57.3`` centimetres, counts as ``1204.00``), and counts without
a sign. Where a number is ``lenient`` such a line is read, if all its numbers have as many decimals: half of another
line, glued to this one where bytes were lost, looks otherwise.

Levels of an encoder's two lines are text, three edges per character. A character is a number in bijective base 4, each
level being a digit from 1 to 4: one level is 1 to 4, two are 5 to 20, three are 21 to 84. So they never read alike, and
the text needs no count. Added to ``OFFSET`` all of it is printable.
"""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, product
from typing import Any, TypeAlias

from firmware_protocol.messages import Reason

OFFSET = 40
EDGES_A_CHARACTER = 3

_FULL = re.compile(rb"[=-|]*[)-|]")  # only the last character may hold fewer than three


def pack(levels: Sequence[int]) -> str:
    """Levels from 0 to 3 as text."""
    starts = range(0, len(levels), EDGES_A_CHARACTER)
    return "".join(_character(levels[start : start + EDGES_A_CHARACTER]) for start in starts)


def _character(levels: Sequence[int]) -> str:
    value = 0
    for level in levels:
        value = value * 4 + level + 1
    return chr(OFFSET + value)


_LEVELS = {
    ord(_character(levels)): levels
    for count in range(1, EDGES_A_CHARACTER + 1)
    for levels in product(range(4), repeat=count)
}


def is_packed(text: bytes) -> bool:
    """Whether ``pack`` can have written this."""
    return bool(_FULL.fullmatch(text))


def unpack(text: bytes) -> tuple[int, ...]:
    """The levels of what ``is_packed``."""
    return tuple(chain.from_iterable(map(_LEVELS.__getitem__, text)))


NUMERIC = b"0123456789.-"
UNIT_NORM = (0.9, 1.1)  # rounding to two decimals moves the norm of four components by 0.01 at most

_WHOLE = re.compile(rb"-?[0-9]{1,64}")
_LENIENT = re.compile(rb"(-?[0-9]{1,64})(?:\.([0-9]{1,64}))?")
_DECIMAL = re.compile(rb"-?(?=.?[0-9])[0-9]{0,64}\.?[0-9]{0,64}")
_UNIT = f"from {UNIT_NORM[0]} to {UNIT_NORM[1]}"

Refusal: TypeAlias = tuple[Reason, str]


def is_unit(components: Iterable[float]) -> bool:
    """Whether the norm is close enough to 1 for two decimals to be the reason."""
    return UNIT_NORM[0] <= math.hypot(*components) <= UNIT_NORM[1]


@dataclass(frozen=True, slots=True)
class Number:
    """The values that a field can take, and with how many decimals it is written; none: a whole number.

    ``lenient``: a whole number may come with decimals, which are rounded down as the published sketch does, and a signed
    one may come as the unsigned number of the same bits. A text in ``nothing`` says that nothing was measured: it
    counts as 0.
    """

    low: float
    high: float
    decimals: int = 0
    lenient: bool = False
    nothing: frozenset[bytes] = frozenset()

    @property
    def parse(self) -> Callable[[bytes], float]:
        """``int`` or ``float``."""
        return float if self.decimals else int

    def explain(self, text: bytes) -> Refusal | None:
        """Why the text is not such a number; None when it is one."""
        if not (_DECIMAL if self.decimals else _WHOLE).fullmatch(text):
            return Reason.NOT_A_NUMBER, f"expected {self.describe_range()}, got {text.decode()!r}"
        if not self.low <= float(text) <= self.high:
            return Reason.OUT_OF_RANGE, f"expected {self.describe_range()}, got {text.decode()}"
        return None

    def rewrite(self, text: bytes) -> tuple[bytes, int] | None:
        """A whole number as it should have been written, and how many decimals it had; None where it is no number."""
        if text.lower() in self.nothing:
            return b"0", 0
        match = _LENIENT.fullmatch(text)
        if match is None:
            return None
        whole, fraction = int(match[1]), match[2] or b""
        if match[1] in self.nothing and not fraction.strip(b"0"):
            return b"0", len(fraction)
        if match[1].startswith(b"-") and fraction.strip(b"0"):
            whole -= 1
        span = int(self.high - self.low) + 1
        if self.low < 0 and self.high < whole < span:
            whole -= span
        return str(whole).encode(), len(fraction)

    def write(self, value: float) -> str:
        """The value's digits; raises ``ValueError`` when it is out of range or loses a fraction."""
        if not self.low <= value <= self.high or (not self.decimals and value % 1):
            raise ValueError(f"expected {self.describe_range()}, got {value!r}")
        return f"{value:.{self.decimals}f}"

    def describe_range(self) -> str:
        """For people: the type and the range."""
        return f"{'a number' if self.decimals else 'a whole number'} from {self.low} to {self.high}"


NO_DISTANCE = frozenset({b"-1", b"65535", b"4294967295", b"nan", b"inf"})
"""What drivers of range sensors say where the published sketch says 0: no echo (-1 also as an unsigned number)."""

INT16 = Number(-(2**15), 2**15 - 1)
INT32 = Number(-(2**31), 2**31 - 1)
UINT32 = Number(0, 2**32 - 1)
CENTIMETRES = Number(0, 2**15 - 1, nothing=NO_DISTANCE)
DUTY = Number(-(2**15), 2**15 - 1, decimals=2)
CYCLE_SECONDS = Number(0, 4295, decimals=2)  # the sketch's difference of two uint32 µs is at most 2^32 µs
COMPONENT = Number(-math.inf, math.inf, decimals=2)  # bounded by the norm of all four
ADC_12_BIT = Number(0, 4095, decimals=2)
ADC = Number(0, 2**16 - 1, decimals=2)  # the published boards have 12 bits, others 10 to 16
UINT16 = Number(0, 2**16 - 1)
UINT8 = Number(0, 2**8 - 1)


@dataclass(frozen=True, slots=True)
class PackedLevels:
    """One to ``most`` levels from 0 to 3 in one text (see ``firmware_protocol.lines``), read as a tuple."""

    most: int

    @property
    def parse(self) -> Callable[[bytes], tuple[int, ...]]:
        """From the text to the levels."""
        return unpack

    def explain(self, text: bytes) -> Refusal | None:
        """Why the text is not such levels; None when it is."""
        if not is_packed(text):
            return Reason.NOT_A_NUMBER, f"expected {self.describe_range()}, got {text.decode()!r}"
        if len(unpack(text)) > self.most:
            return Reason.OUT_OF_RANGE, f"expected {self.describe_range()}, got {len(unpack(text))}"
        return None

    def write(self, levels: tuple[int, ...]) -> str:
        """The levels' text; raises ``ValueError`` when there are none, too many, or one is out of range."""
        if not 1 <= len(levels) <= self.most or any(level not in range(4) for level in levels):
            raise ValueError(f"expected {self.describe_range()}, got {levels!r}")
        return pack(levels)

    def describe_range(self) -> str:
        """For people: what is packed, and how much of it."""
        return f"1 to {self.most} levels from 0 to 3, packed"


@dataclass(frozen=True, slots=True)
class Field:
    """A message's field: one number (or text of packed levels), or with ``times`` a tuple of so many."""

    name: str
    number: Number | PackedLevels
    times: int | None = None

    @property
    def numbers(self) -> tuple[Number | PackedLevels, ...]:
        """The numbers that it takes on the line."""
        return (self.number,) * (1 if self.times is None else self.times)

    def write(self, value: Any) -> list[str]:
        """Its texts on the line; raises ``ValueError`` naming field, value and range."""
        values = (value,) if self.times is None else value
        if len(values) != len(self.numbers):
            raise ValueError(f"{self.name}: expected {self.times} numbers, got {value!r}")
        try:
            return [self.number.write(number) for number in values]
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}") from None


@dataclass(frozen=True)
class LineKind:
    """A row of a codec's table: the line's first field, the message it means, and the numbers between.

    ``unit`` asks for a norm near 1 of numbers in the range of ``COMPONENT``; ``end`` is the line's end where
    the sketch strays from its usual.
    """

    kind: str
    message: type[Any]
    fields: tuple[Field, ...] = ()
    unit: bool = False
    end: bytes | None = None

    @cached_property
    def numbers(self) -> tuple[Number | PackedLevels, ...]:
        """Every number of the line, in order."""
        return tuple(number for field in self.fields for number in field.numbers)

    @cached_property
    def plain(self) -> tuple[Number, ...]:
        """Those of them that are numbers indeed: all, unless some are packed levels, which may look like anything."""
        return tuple(number for number in self.numbers if isinstance(number, Number))

    @property
    def is_packed(self) -> bool:
        """Whether some are not."""
        return len(self.plain) < len(self.numbers)

    @cached_property
    def slots(self) -> tuple[int | slice, ...]:
        """Where each field's value lies in the tuple of the line's numbers."""
        slots: list[int | slice] = []
        start = 0
        for field in self.fields:
            stop = start + len(field.numbers)
            slots.append(start if field.times is None else slice(start, stop))
            start = stop
        return tuple(slots)

    @cached_property
    def is_lenient(self) -> bool:
        """Whether a number of it may be written in another way."""
        return any(number.lenient for number in self.plain)

    def rewrite(self, texts: list[bytes]) -> list[bytes] | None:
        """The texts after the kind, right in number, as they should have been written; None where they mean nothing."""
        rewritten: list[bytes] = []
        decimals: set[int] = set()
        for number, text in zip(self.plain, texts, strict=True):
            if not number.lenient:
                rewritten.append(text)
            elif (strict := number.rewrite(text)) is None:
                return None
            else:
                rewritten.append(strict[0])
                decimals.add(strict[1])
        return rewritten if len(decimals) == 1 else None

    def explain(self, texts: list[bytes]) -> Refusal:
        """Why the texts after the kind, right in number, were refused by this row's reader."""
        for number, text in zip(self.numbers, texts, strict=True):
            if refusal := number.explain(text):
                return refusal
        if self.unit and not is_unit(map(float, texts)):
            return Reason.NOT_UNIT, f"expected a norm {_UNIT}, got {math.hypot(*map(float, texts)):.3f}"
        return Reason.OUT_OF_RANGE, f"{self.message.__name__} refuses these numbers itself"

    def suits(self, message: object) -> bool:
        """Whether the message has as many numbers as this row: a message may have a row for each count."""
        return all(
            field.times is None or len(getattr(message, field.name)) == field.times for field in self.fields
        )

    def write(self, message: object) -> list[str]:
        """The line's texts, the kind first; raises ``ValueError`` naming what does not fit."""
        texts = [text for field in self.fields for text in field.write(getattr(message, field.name))]
        if self.unit and not is_unit(map(float, texts)):
            raise ValueError(f"{self.message.__name__}: expected a norm {_UNIT}, got {message!r}")
        return [self.kind, *texts]
