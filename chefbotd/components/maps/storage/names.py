"""Names of maps and places: which are allowed, and their normal form.

A map's name is a file's name, so it has no separators, does not begin with a dot or a hyphen, and is kept in Unicode's
form NFC: a name typed on a Mac finds the map that was named on Linux. Upper and lower case are different.
"""

import unicodedata

from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.core.commands import RefusalKind
from chefbotd.core.sentence import Sentence

MAX_CHARACTERS = 64
MAX_BYTES = 200
"""A file's name may have 255 (ext4), and ours adds a suffix."""

ALLOWED = " -_."


def map_name(text: str) -> str:
    """The name as it is kept.

    Raises:
        MapStoreError: it is not allowed.
    """
    name = unicodedata.normalize("NFC", text)
    expected = (
        f"expected 1 to {MAX_CHARACTERS} letters, digits, spaces, hyphens, underscores and dots, "
        "the first one a letter, a digit or an underscore, the last one no space or dot"
    )
    allowed = all(character in ALLOWED or unicodedata.category(character)[0] in "LMN" for character in name)
    if not (name and allowed and name[0] not in " -." and name[-1] not in " ."):
        raise MapStoreError(
            RefusalKind.BAD_NAME,
            Sentence(
                "maps.bad_name", "{name!r} cannot be a map's name: {expected}", name=text, expected=expected
            ),
        )
    if len(name) > MAX_CHARACTERS or len(name.encode()) > MAX_BYTES:
        raise MapStoreError(
            RefusalKind.BAD_NAME,
            Sentence(
                "maps.long_name",
                "{name!r} cannot be a map's name: it is too long; {expected}",
                name=text[:80],
                expected=expected,
            ),
        )
    return name


def place_name(text: str) -> str:
    """The name as it is kept: anything that can be printed, without spaces around it.

    Raises:
        MapStoreError: it is not allowed.
    """
    name = unicodedata.normalize("NFC", text).strip()
    if not (0 < len(name) <= MAX_CHARACTERS and name.isprintable()):
        raise MapStoreError(
            RefusalKind.BAD_NAME,
            Sentence(
                "maps.bad_place_name",
                "{name!r} cannot be a place's name: expected 1 to {most} characters that can be printed",
                name=text[:80],
                most=MAX_CHARACTERS,
            ),
        )
    return name
