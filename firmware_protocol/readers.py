"""From the bytes of a well-formed line to its message, as fast as plain Python goes.

A reader is only called with lines made of its kind's letters, its number of separators and ``NUMERIC``. It
refuses with ``ValueError`` and says no more: ``LineKind.explain`` finds the reason when speed is no matter.
The shapes that fill a cycle are unrolled, which takes half the time of the reader that suits them all.
"""

from collections.abc import Callable
from math import hypot
from operator import call, le
from typing import Any, TypeAlias

from firmware_protocol.lines import UNIT_NORM, LineKind, Number, is_unit

Reader: TypeAlias = Callable[[bytes], Any]

_REFUSED = "the line does not fit its kind"


def reader_of(row: LineKind, separator: bytes) -> Reader:
    """The fastest reader for a row's shape."""
    kind, message, numbers = row.kind.encode(), row.message, row.numbers
    if row.unit and row.slots == (0, 1, 2, 3):
        return _quaternion(kind, separator, message)
    if not row.unit and row.slots == (0,):
        return _one(kind, separator, message, numbers[0])
    if not row.unit and row.slots in ((0, 1), (slice(0, 2),)):
        return _two(kind, separator, message, numbers[0], numbers[1], row.slots == (slice(0, 2),))
    return _any(row, separator)


def _one(kind: bytes, separator: bytes, message: type[Any], number: Number) -> Reader:
    parse, low, high = number.parse, number.low, number.high

    def read(line: bytes) -> Any:
        head, text = line.split(separator)
        value = parse(text)
        if head == kind and low <= value <= high:
            return message(value)
        raise ValueError(_REFUSED)

    return read


def _two(
    kind: bytes, separator: bytes, message: type[Any], first: Number, second: Number, grouped: bool
) -> Reader:
    parse_a, low_a, high_a = first.parse, first.low, first.high
    parse_b, low_b, high_b = second.parse, second.low, second.high

    def read(line: bytes) -> Any:
        head, text_a, text_b = line.split(separator)
        a = parse_a(text_a)
        b = parse_b(text_b)
        if head == kind and low_a <= a <= high_a and low_b <= b <= high_b:
            return message((a, b)) if grouped else message(a, b)
        raise ValueError(_REFUSED)

    return read


def _quaternion(kind: bytes, separator: bytes, message: type[Any]) -> Reader:
    shortest, longest = UNIT_NORM

    def read(line: bytes) -> Any:
        head, text_x, text_y, text_z, text_w = line.split(separator)
        x = float(text_x)
        y = float(text_y)
        z = float(text_z)
        w = float(text_w)
        if head == kind and shortest <= hypot(x, y, z, w) <= longest:
            return message(x, y, z, w)
        raise ValueError(_REFUSED)

    return read


def _any(row: LineKind, separator: bytes) -> Reader:
    kind, message, slots, unit = row.kind.encode(), row.message, row.slots, row.unit
    parsers = [number.parse for number in row.numbers]
    lows = [number.low for number in row.numbers]
    highs = [number.high for number in row.numbers]

    def read(line: bytes) -> Any:
        head, *texts = line.split(separator)
        values = tuple(map(call, parsers, texts))
        in_range = all(map(le, lows, values)) and all(map(le, values, highs))
        if head == kind and in_range and not (unit and not is_unit(values)):
            return message(*[values[slot] for slot in slots])
        raise ValueError(_REFUSED)

    return read
