"""The zones of a map in the file ``zones.yaml`` beside it: read, changed, written. Loads no numpy.

::

    keep_out:
      - {name: stairs, corners_m: [[0, 0], [1, 0], [1, 2]]}
    slow:
      - {name: by the counter, corners_m: [[3, 0], [5, 0], [5, 2]], max_speed_m_s: 0.1}
    walls:
      - {name: glass, points_m: [[2, 4], [6, 4]], width_m: 0.1}
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, TypeAlias

import yaml
from pydantic import Field, ValidationError, model_validator

from chefbotd.components.maps.outlines import WALL_WIDTH_M, Point
from chefbotd.core.bounded_yaml import load_first_document
from chefbotd.core.parameters import Parameters

ZONES: Final = "zones.yaml"
"""The file beside a map."""

ZONES_BEFORE: Final = "zones-before.yaml"
"""The file's content before its last change by a client."""

LARGEST_BYTES = 200_000
"""Of a file that clients make: it takes a second or two to read, and a longer one is not read at all at some point."""

DUMPER: Final = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""That of libyaml, where PyYAML was built with it, takes an eighth of the time."""

MOST_PROBLEMS = 5
MOST_SHOWN = 100
"""Letters of a value that is wrong: it may be as long as the file."""

MOST_ZONES = 1000
MOST_POINTS = 1000
Corners = Annotated[tuple[Point, ...], Field(min_length=3, max_length=MOST_POINTS)]


class _Drawn(Parameters):
    """What all kinds have: an ``id`` that stays, a name for people, and whether it counts."""

    id: str = Field(default="", max_length=64)
    name: str = Field(default="", max_length=100)
    enabled: bool = True


class Zone(_Drawn):
    """A polygon in the map's frame, its corners in either order."""

    corners_m: Corners


class SlowZone(Zone):
    """Here the robot drives no faster than this."""

    max_speed_m_s: float = Field(gt=0, le=10)


class Wall(_Drawn):
    """A line from point to point in the map's frame, which navigation takes for a wall."""

    points_m: tuple[Point, ...] = Field(min_length=2, max_length=MOST_POINTS)
    width_m: float = Field(default=WALL_WIDTH_M, gt=0, le=5)


AnyZone: TypeAlias = Zone | Wall


class Zones(Parameters):
    """All zones of a map, those that are switched off too; none by default."""

    keep_out: tuple[Zone, ...] = Field((), max_length=MOST_ZONES)
    slow: tuple[SlowZone, ...] = Field((), max_length=MOST_ZONES)
    walls: tuple[Wall, ...] = Field((), max_length=MOST_ZONES)

    @model_validator(mode="after")
    def _ids_differ(self) -> "Zones":
        ids = Counter(zone.id for zone in (*self.keep_out, *self.slow, *self.walls) if zone.id)
        if twice := next((own for own, count in ids.items() if count > 1), None):
            raise ValueError(f"two zones have the id {twice!r}: remove one of them, or its id")
        return self

    def named(self) -> Iterator[tuple[str, AnyZone]]:
        """Each with its id: its own, or else its kind and place in the file, which it gets at the next change."""
        ids = {zone.id for zone in (*self.keep_out, *self.slow, *self.walls)}
        for kind in KINDS:
            for number, zone in enumerate(getattr(self, kind), 1):
                own = zone.id or f"{kind}-{number}"
                while not zone.id and own in ids:
                    own += "-"
                yield own, zone


def kind_of(zone: AnyZone) -> str:
    """One of ``KINDS``."""
    return "walls" if isinstance(zone, Wall) else "slow" if isinstance(zone, SlowZone) else "keep_out"


def outline_m(zone: AnyZone) -> tuple[Point, ...]:
    """The corners of a zone, or the points of a wall."""
    return zone.points_m if isinstance(zone, Wall) else zone.corners_m


KINDS: Final = ("keep_out", "slow", "walls")
NO_ZONES = Zones()


def parse_zones(text: str, name: str) -> Zones:
    """The YAML text of the file called ``name``.

    Raises:
        ValueError: it is no YAML or holds no zones; its text names the file and what was expected.
    """
    try:
        return Zones.model_validate(load_first_document(text) or {})
    except ValidationError as error:
        problems = [
            f"{'.'.join(map(str, e['loc']))}: {e['msg']} (got {shorten_value(e['input'])})"
            for e in error.errors()[:MOST_PROBLEMS]
        ]
        raise ValueError(f"{name}: {'; '.join(problems)}") from error
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def shorten_value(value: object) -> str:
    """A value as it is written, cut where it is long."""
    text = repr(value)
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."


def write_zones(zones: Zones) -> bytes:
    """The file's content, which people can read and edit."""
    rows = zones.model_dump(mode="json", exclude_defaults=True)
    options: dict[str, Any] = {
        "default_flow_style": None,
        "sort_keys": False,
        "allow_unicode": True,
        "width": 120,
    }
    text: str = yaml.dump(rows, Dumper=DUMPER, **options)
    return text.encode()


def with_zones(zones: Zones, drawn: Mapping[str, AnyZone]) -> Zones:
    """These zones and more by their ids, or in place of those of the same ids; every zone has its id then."""
    rows: dict[str, list[AnyZone]] = {kind: [] for kind in KINDS}
    left = dict(drawn)
    for other, old in zones.named():
        if other not in drawn:
            rows[kind_of(old)].append(old.model_copy(update={"id": other}))
        elif kind_of(old) == kind_of(drawn[other]):
            rows[kind_of(old)].append(left.pop(other))
    for zone in left.values():
        rows[kind_of(zone)].append(zone)
    return Zones.model_validate({row: tuple(of_kind) for row, of_kind in rows.items()})


def without_zone(zones: Zones, own: str) -> Zones:
    """These zones but one; every other has its id then."""
    rows: dict[str, list[AnyZone]] = {kind: [] for kind in KINDS}
    for other, old in zones.named():
        if other != own:
            rows[kind_of(old)].append(old.model_copy(update={"id": other}))
    return Zones.model_validate({row: tuple(of_kind) for row, of_kind in rows.items()})
