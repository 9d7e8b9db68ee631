"""What a terminal is given of texts that others wrote."""

import pytest

from chefbotd.core.printable import find_unprintable, one_line, plain

HOSTILE = {
    "title": "\x1b]0;a title\x07",
    "colour": "\x1b[8m",
    "C1": "\x9b2J",
    "DEL": "\x7f",
    "NUL": "\0",
    "backspaces": "\b\b",
    "return": "\r",
    "override": "\u202e",
    "isolate": "\u2067",
    "mark": "\u061c",
    "separator": "\u2028",
}


@pytest.mark.parametrize("hostile", HOSTILE.values(), ids=HOSTILE)
def test_commands_to_a_terminal_are_found_and_replaced(hostile: str) -> None:
    """Wherever they stand; each such character becomes one that says that something was there."""
    text = f"before{hostile}behind"
    assert find_unprintable({"a": [1, {"b": text}]}) == text
    assert find_unprintable({text: 1}) == text
    for made in (plain(text), one_line(text)):
        assert not set(made) & set("\x1b\x07\x9b\x7f\0\b\r\u202e\u2067\u061c\u2028")
        assert len(made) == len(text)


def test_other_text_stays_as_it_is() -> None:
    """Letters of any script, accents, and emoji that are joined."""
    text = "Küche, кухня, 厨房, مطبخ, \U0001f468\u200d\U0001f373"
    assert find_unprintable([text, None, 1.5, True]) is None
    assert plain(text) == one_line(text) == text
    assert plain("one\n\ttwo") == "one\n\ttwo"
    assert one_line("one\n\ttwo") == "one\ufffd\ufffdtwo"
