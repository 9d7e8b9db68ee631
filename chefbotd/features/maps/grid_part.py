"""A part of a grid for topics: of the growing map, and of the costs."""

from base64 import b64encode
from typing import Any, Literal, TypeVar

from msgspec import Struct
from msgspec.structs import asdict
from pydantic import Field

from chefbotd.core.events.mapping import MapChanged
from chefbotd.core.events.navigation import CostmapChanged
from chefbotd.core.geometry import Pose2D
from chefbotd.rpc.models import TopicData

E = TypeVar("E", MapChanged, CostmapChanged)


class GridPartData(TopicData):
    """``cells`` are ``part_rows`` by ``part_columns`` from (``row``, ``column``) on, the lowest y first."""

    revision: int
    resolution_m: float
    x_m: float = Field(description="of the outer corner of cell (0, 0), in map; as y_m and heading_rad")
    y_m: float
    heading_rad: float
    columns: int
    rows: int
    column: int
    row: int
    part_columns: int
    part_rows: int
    encoding: Literal["base64 zlib int8"] = "base64 zlib int8"


def grid_part(event: MapChanged | CostmapChanged) -> dict[str, Any]:
    """What ``GridPartData`` has of an event, and its ``cells``."""
    origin = event.map_from_grid
    return {
        "revision": event.revision,
        "resolution_m": event.resolution_m,
        "x_m": origin.x_m,
        "y_m": origin.y_m,
        "heading_rad": origin.heading_rad,
        "columns": event.columns,
        "rows": event.rows,
        "column": event.column,
        "row": event.row,
        "part_columns": event.part_columns,
        "part_rows": event.part_rows,
        "cells": b64encode(event.cells).decode(),
    }


def grid_event(kind: type[E], part: Struct) -> E:
    """A part of a grid from the worker as an event, whose fields have the same names."""
    fields = asdict(part)
    return kind(map_from_grid=Pose2D(*fields.pop("origin")), **fields)
