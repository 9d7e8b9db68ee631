"""The named places of a map in their file: read, changed, written."""

import difflib
import json
from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Literal

from pydantic import Field, ValidationError

from chefbotd.components.maps.outlines import Coordinate
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.names import place_name
from chefbotd.core.commands import RefusalKind
from chefbotd.core.parameters import Parameters
from chefbotd.core.sentence import Sentence

PLACES = "places.json"
MOST_PLACES = 1000
MOST_NOTE = 200


class PlaceKind(StrEnum):
    """What a place is for."""

    TABLE = "table"
    DOCK = "dock"
    HOME = "home"
    OTHER = "other"


class Place(Parameters):
    """A pose in ``map``, what it is for, and a note for people; the heading is CCW positive."""

    x_m: Coordinate
    y_m: Coordinate
    heading_rad: float
    kind: PlaceKind = PlaceKind.OTHER
    note: str = Field("", max_length=MOST_NOTE)


class _File(Parameters):
    format: Literal[1] = 1
    places: dict[str, Place]


def parse_places(data: bytes | None, map_name: str) -> dict[str, Place]:
    """The places by name, in the order in which they were saved; of a file that is not there, none.

    Raises:
        MapStoreError: it is no such file. It is left as it is, for a person to look at.
    """
    if data is None:
        return {}
    try:
        return dict(_File.model_validate_json(data).places)
    except ValidationError as error:
        problem = error.errors()[0]
        where = ".".join(map(str, problem["loc"]))
        raise MapStoreError(
            RefusalKind.MAP_UNREADABLE,
            Sentence(
                "maps.places_unreadable",
                "the places of the map {map!r} cannot be read: {file}: {why}",
                map=map_name,
                file=PLACES,
                why=f"{where + ': ' if where else ''}{problem['msg']}",
            ),
        ) from error


def to_file(places: Mapping[str, Place]) -> bytes:
    """The file's content, which people can read and edit."""
    rows = {name: place.model_dump(mode="json", exclude_defaults=True) for name, place in places.items()}
    return json.dumps({"format": 1, "places": rows}, indent=2, ensure_ascii=False).encode() + b"\n"


def with_place(places: Mapping[str, Place], name: str, place: Place) -> dict[str, Place]:
    """These places, and one more or a changed one; raises ``MapStoreError`` for a bad name or too many."""
    changed = {**places, place_name(name): place}
    if len(changed) > MOST_PLACES:
        raise MapStoreError(
            RefusalKind.OUT_OF_RANGE,
            Sentence("maps.too_many_places", "a map has at most {most} places", most=MOST_PLACES),
        )
    return changed


def describe_unknown(name: str, names: Iterable[str]) -> str:
    """What a map has in place of an unknown name, the most similar ones first, for people."""
    names = list(names)
    by_plain = {other.casefold(): other for other in names}
    close = difflib.get_close_matches(name.casefold(), by_plain, n=2)
    if close:
        return f"did you mean {' or '.join(repr(by_plain[match]) for match in close)}?"
    return f"there are: {', '.join(names) or 'none'}"


def without_place(places: Mapping[str, Place], name: str) -> dict[str, Place]:
    """These places but one; raises ``MapStoreError`` if it is not among them."""
    name = place_name(name)
    if name not in places:
        raise MapStoreError(
            RefusalKind.UNKNOWN_PLACE,
            Sentence(
                "maps.unknown_place",
                "no place named {place!r}; {others}",
                place=name,
                others=describe_unknown(name, places),
            ),
        )
    return {other: place for other, place in places.items() if other != name}
