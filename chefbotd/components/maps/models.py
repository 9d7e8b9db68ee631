"""Maps and places, and a part of a grid as the topics tell it: of the growing map, and of the costs."""

from base64 import b64encode
from typing import Annotated, Any, Literal

from msgspec import Meta
from msgspec.structs import asdict
from pydantic import Field, model_validator

from chefbotd.components.maps.outlines import FARTHEST_M
from chefbotd.components.maps.storage.places import MOST_NOTE, PlaceKind
from chefbotd.core.grid_patch import GridPatch
from chefbotd.core.record import Record
from chefbotd.rpc.models import Params

NAME = Field(min_length=1, max_length=64, description="a map's name")
PLACE = Field(min_length=1, max_length=64, description="a place's name")
OF_MAP = Field(None, min_length=1, max_length=64, description="the map in use, if none is named")


class MapName(Params):
    """A map."""

    name: str = NAME


class LoadMapParams(MapName):
    """A map to use."""

    resolution_is_right: bool = Field(
        False, description="cells of more than 0.25 m, or a floor of more than 1 km, are meant so"
    )


class GetMapParams(Params):
    """A map, or else the one that is being made, or the one in use; a large one comes in parts, one by one."""

    name: str | None = Field(None, min_length=1, max_length=64)
    part: int = Field(0, ge=0, le=1_000_000)


class ImportMapParams(Params):
    """map_server's files; a path that is relative begins at the folder of maps."""

    yaml: str = Field(min_length=1, max_length=1024, description="the YAML file, on the robot's computer")
    name: str | None = Field(
        None, min_length=1, max_length=64, description="the file's own, if none is given"
    )
    replace: bool = Field(False, description="the map may exist: this becomes its next version")


class RenameMapParams(Params):
    """A map, and the name that it gets."""

    name: str = NAME
    new_name: str = NAME


class OfMapParams(Params):
    """A map, or else the one in use."""

    map: str | None = OF_MAP


class PlaceName(OfMapParams):
    """A place of a map."""

    name: str = PLACE


class SavePlaceParams(PlaceName):
    """A place, with its pose in ``map``; without one it is where the robot is."""

    x_m: float | None = Field(None, ge=-FARTHEST_M, le=FARTHEST_M)
    y_m: float | None = Field(None, ge=-FARTHEST_M, le=FARTHEST_M)
    heading_rad: float | None = Field(None, description="CCW positive; 0 where only x_m and y_m are given")
    kind: Literal["table", "dock", "home", "other"] | None = Field(
        None, description="if none is given, as the place had it, or other"
    )
    note: str | None = Field(
        None, max_length=MOST_NOTE, description="for people; if none is given, as the place had it"
    )

    @model_validator(mode="after")
    def _x_and_y_together(self) -> "SavePlaceParams":
        if (self.x_m is None) != (self.y_m is None) or (self.x_m is None and self.heading_rad is not None):
            raise ValueError("expected x_m and y_m, with or without heading_rad, or none of the three")
        return self


class MapSummary(Record, frozen=True):
    """A stored map. ``condition`` is ``foreign`` for files that others put there: they are read when it is loaded.

    Of a ``damaged`` one no version is whole. ``problem`` says what is wrong, also with newer versions of a whole one.
    """

    name: str
    condition: Literal["whole", "damaged", "foreign"]
    problem: str | None
    in_use: bool
    version: int | None
    versions: tuple[int, ...]
    saved_at_s: Annotated[float | None, Meta(description="seconds since 1970, UTC")]
    source: str | None
    resolution_m: float | None
    columns: int | None
    rows: int | None
    size_bytes: int | None
    can_go_on: Annotated[bool, Meta(description="SLAM's state is stored, so that mapping can extend the map")]


class MapList(Record, frozen=True):
    """Every stored map, by name, and the one in use."""

    folder: str
    in_use: str | None
    maps: tuple[MapSummary, ...]


class MapInUse(Record, frozen=True):
    """A version of a map; ``warning`` says what is wrong with newer ones."""

    name: str
    version: int
    warning: str | None = None


class MapPart(Record, frozen=True, kw_only=True):
    """A part of a map's cells: base64 of zlib of a signed byte each, row by row, the lowest row first.

    -1 is unknown, 0 free, 100 occupied. (``x_m``, ``y_m``, ``heading_rad``) is where the outer corner of the first cell
    lies in ``map``. The text of all ``parts``, put together, is one base64. ``stamp_s`` is the daemon's time. A map that
    is being made has no ``saved_at_s``, its revision as version, and no name unless it goes on with a stored one.
    """

    name: str | None
    version: int
    stamp_s: float
    saved_at_s: float | None
    resolution_m: float
    columns: int
    rows: int
    x_m: float
    y_m: float
    heading_rad: float
    encoding: Literal["base64 zlib int8"] = "base64 zlib int8"
    part: int
    parts: int
    edits: Annotated[
        str | None, Meta(description="the revision of the edits that are drawn on it; of a stored map alone")
    ] = None
    data: str


class PlaceData(Record, frozen=True):
    """A place: its pose in ``map``, what it is for, and a note for people."""

    name: str
    x_m: float
    y_m: float
    heading_rad: float
    kind: PlaceKind = PlaceKind.OTHER
    note: str = ""


class PlaceList(Record, frozen=True):
    """The places of a map, in the order in which they were saved."""

    map: str
    places: tuple[PlaceData, ...]


class GridPartData(Record, frozen=True):
    """``cells`` are ``part_rows`` by ``part_columns`` from (``row``, ``column``) on, the lowest y first."""

    revision: int
    resolution_m: float
    x_m: Annotated[
        float, Meta(description="of the outer corner of cell (0, 0), in map; as y_m and heading_rad")
    ]
    y_m: float
    heading_rad: float
    columns: int
    rows: int
    column: int
    row: int
    part_columns: int
    part_rows: int
    encoding: Literal["base64 zlib int8"] = "base64 zlib int8"


def grid_part(event: GridPatch) -> dict[str, Any]:
    """What ``GridPartData`` has of an event, and its ``cells``."""
    names = set(GridPartData.__struct_fields__) & set(event.__struct_fields__)
    origin = asdict(event.map_from_grid)
    return (
        {name: getattr(event, name) for name in names} | origin | {"cells": b64encode(event.cells).decode()}
    )
