"""Levels of two lines, packed three to a character."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_protocol.lines import is_packed, pack, unpack


@pytest.mark.parametrize(
    ("levels", "text"),
    [
        ((0,), ")"),  # digits 1: 40 + 1
        ((3,), ","),  # 4: 40 + 4
        ((0, 0), "-"),  # 1 1: 40 + 5
        ((2, 3), "8"),  # 3 4: 40 + 16
        ((0, 0, 0), "="),  # 1 1 1: 40 + 21
        ((2, 3, 1), "j"),  # 3 4 2: 40 + 66
        ((3, 3, 3), "|"),  # 4 4 4: 40 + 84
        ((2, 3, 1, 0), "j)"),
    ],
)
def test_three_levels_are_a_character(levels: tuple[int, ...], text: str) -> None:
    """Each level is a digit from 1 to 4 of a number in base 4, which is added to 40."""
    assert pack(levels) == text
    assert unpack(text.encode()) == levels


@given(st.lists(st.integers(0, 3), min_size=1, max_size=400).map(tuple))
def test_packed_levels_are_read_back(levels: tuple[int, ...]) -> None:
    """Any levels in any number: printable, without a TAB or a space, a third as long, and the same again."""
    text = pack(levels)
    assert all("!" <= character <= "~" for character in text)
    assert len(text) == -(-len(levels) // 3)
    assert is_packed(text.encode())
    assert unpack(text.encode()) == levels


@given(st.binary(max_size=6))
def test_text_that_was_not_packed_is_told(text: bytes) -> None:
    """Whatever else stands there: what counts as packed is what packing its levels gives again."""
    assert not is_packed(text) or pack(unpack(text)).encode() == text


@pytest.mark.parametrize("text", [b"", b"(", b"}", b")j", b"8=", b"j j", b"j\t"])
def test_only_the_last_character_may_be_short(text: bytes) -> None:
    """Nothing, characters beyond the range, and short ones before others are damage."""
    assert not is_packed(text)
