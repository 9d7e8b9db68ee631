"""From the bytes of a well-formed line to its message, as fast as plain Python goes.

A reader is only called with lines made of its kind's letters, its number of separators and ``NUMERIC``. It
refuses with ``ValueError`` and says no more: ``LineKind.explain`` finds the reason when speed is no matter.

The shapes that fill a cycle are unrolled and make the tuple that their message is themselves. Together that takes half
the time of the reader for any shape.
"""

from collections.abc import Callable
from math import hypot
from operator import call, le
from typing import Any, TypeAlias

from firmware_protocol.lines import UNIT_NORM, LineKind, is_unit

Reader: TypeAlias = Callable[[bytes], Any]

_REFUSED = "the line does not fit its kind"


def reader_of(row: LineKind, separator: bytes) -> Reader:
    """The fastest reader for a row's shape."""
    unrolled: Callable[[LineKind, bytes], Reader] = _read_packed if row.is_packed else _any
    if issubclass(row.message, tuple) and not row.is_packed:
        match row.slots, row.unit:
            case (0,), False:
                unrolled = _one
            case (0, 1), False:
                unrolled = _two
            case (slice(stop=2),), False:
                unrolled = _pair
            case (slice(stop=2), 2), False:
                unrolled = _pair_and_one
            case (0, 1, 2, 3), True:
                unrolled = _quaternion
    return unrolled(row, separator)


def _one(row: LineKind, separator: bytes) -> Reader:
    kind, message, new = row.kind.encode(), row.message, tuple.__new__
    (number,) = row.plain
    parse, low, high = number.parse, number.low, number.high

    def read(line: bytes) -> Any:
        head, text = line.split(separator)
        value = parse(text)
        if head != kind or not low <= value <= high:
            raise ValueError(_REFUSED)
        return new(message, (value,))

    return read


def _two(row: LineKind, separator: bytes) -> Reader:
    kind, message, new = row.kind.encode(), row.message, tuple.__new__
    first, second = row.plain
    parse_a, low_a, high_a = first.parse, first.low, first.high
    parse_b, low_b, high_b = second.parse, second.low, second.high

    def read(line: bytes) -> Any:
        head, text_a, text_b = line.split(separator)
        a = parse_a(text_a)
        b = parse_b(text_b)
        if head != kind or not low_a <= a <= high_a or not low_b <= b <= high_b:
            raise ValueError(_REFUSED)
        return new(message, (a, b))

    return read


def _pair(row: LineKind, separator: bytes) -> Reader:
    kind, message, new = row.kind.encode(), row.message, tuple.__new__
    number = row.plain[0]
    parse, low, high = number.parse, number.low, number.high

    def read(line: bytes) -> Any:
        head, text_a, text_b = line.split(separator)
        a = parse(text_a)
        b = parse(text_b)
        if head != kind or not low <= a <= high or not low <= b <= high:
            raise ValueError(_REFUSED)
        return new(message, ((a, b),))

    return read


def _pair_and_one(row: LineKind, separator: bytes) -> Reader:
    kind, message, new = row.kind.encode(), row.message, tuple.__new__
    number, _, third = row.plain
    parse, low, high = number.parse, number.low, number.high
    parse_c, low_c, high_c = third.parse, third.low, third.high

    def read(line: bytes) -> Any:
        head, text_a, text_b, text_c = line.split(separator)
        a = parse(text_a)
        b = parse(text_b)
        c = parse_c(text_c)
        if head != kind or not low <= a <= high or not low <= b <= high or not low_c <= c <= high_c:
            raise ValueError(_REFUSED)
        return new(message, ((a, b), c))

    return read


def _quaternion(row: LineKind, separator: bytes) -> Reader:
    kind, message, new = row.kind.encode(), row.message, tuple.__new__
    shortest, longest = UNIT_NORM

    def read(line: bytes) -> Any:
        head, text_x, text_y, text_z, text_w = line.split(separator)
        x = float(text_x)
        y = float(text_y)
        z = float(text_z)
        w = float(text_w)
        if head != kind or not shortest <= hypot(x, y, z, w) <= longest:
            raise ValueError(_REFUSED)
        return new(message, (x, y, z, w))

    return read


def _any(row: LineKind, separator: bytes) -> Reader:
    kind, message, slots, unit = row.kind.encode(), row.message, row.slots, row.unit
    parsers = [number.parse for number in row.plain]
    lows = [number.low for number in row.plain]
    highs = [number.high for number in row.plain]

    def read(line: bytes) -> Any:
        head, *texts = line.split(separator)
        values = tuple(map(call, parsers, texts))
        in_range = all(map(le, lows, values)) and all(map(le, values, highs))
        if head != kind or not in_range or (unit and not is_unit(values)):
            raise ValueError(_REFUSED)
        return message(*[values[slot] for slot in slots])

    return read


def _read_packed(row: LineKind, separator: bytes) -> Reader:
    """For lines that come with anything in their packed fields: every field is looked at."""
    kind, message, slots, numbers = row.kind.encode(), row.message, row.slots, row.numbers

    def read(line: bytes) -> Any:
        head, *texts = line.split(separator)
        if head != kind or any(number.explain(text) for number, text in zip(numbers, texts, strict=True)):
            raise ValueError(_REFUSED)
        values = tuple([number.parse(text) for number, text in zip(numbers, texts, strict=True)])
        return message(*[values[slot] for slot in slots])

    return read
