"""Encodes the levels of an encoder's two lines as text, three edges per character.

A character is a number in bijective base 4, each level being a digit from 1 to 4: one level is 1 to 4, two are 5 to 20,
three are 21 to 84. So they never read alike, and the text needs no count. Added to ``OFFSET`` all of it is printable.
"""

import re
from collections.abc import Sequence
from itertools import chain, product

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
