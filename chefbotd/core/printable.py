"""What a terminal may be given of a text that somebody else may have written, and what a client's text may hold.

Control characters (C0, DEL, C1) move the cursor, set the title or hide what stands elsewhere; characters for the
direction of writing (UAX #9, and U+206A to U+206F) show a text in another order than it has; U+2028 and U+2029 end
a line where nobody expects it.
"""

import re
from collections.abc import Mapping

_DIRECTION = "\u061c\u200e\u200f\u2028-\u202e\u2066-\u206f"
_UNPRINTABLE = re.compile(f"[\x00-\x1f\x7f-\x9f{_DIRECTION}]")
_UNPRINTABLE_IN_LINES = re.compile(f"[\x00-\x08\x0b-\x1f\x7f-\x9f{_DIRECTION}]")
_WITHOUT_TEXT = (float, int, bool, type(None))


def plain(text: str) -> str:
    """The text as a terminal may show it: line ends and tabs stay, other such characters are replaced."""
    return _UNPRINTABLE_IN_LINES.sub("\N{REPLACEMENT CHARACTER}", text)


def find_unprintable(value: object) -> str | None:
    """The first text with such a character, a line end among them, in JSON of any depth; None: there is none."""
    if isinstance(value, str):
        return value if _UNPRINTABLE.search(value) else None
    if isinstance(value, Mapping):
        parts = [*value.keys(), *value.values()]
    elif isinstance(value, list | tuple):
        parts = list(value)
    else:
        return None
    for part in parts:
        if type(part) not in _WITHOUT_TEXT and (text := find_unprintable(part)) is not None:
            return text
    return None


def one_line(text: str) -> str:
    """The text with each such character replaced, line ends too."""
    return _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", text)
