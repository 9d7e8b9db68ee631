"""What clients ask of the edits of a map, and what they are answered."""

from typing import Annotated, Literal, TypeAlias

from msgspec import Meta
from pydantic import Field, model_validator

from chefbotd.components.map_edits.edit_file import (
    MOST_ANGLE_RAD,
    MOST_POINTS,
    WALL_WIDTH_M,
    Crop,
    DrawWall,
    Erase,
    MapEdit,
)
from chefbotd.components.map_edits.events import MapEdited
from chefbotd.components.maps.models import OfMapParams
from chefbotd.components.maps.storage.places import FARTHEST_M
from chefbotd.core.record import Record
from chefbotd.rpc.topics import Topic, same_names

EditKind: TypeAlias = Literal["erase", "wall", "crop"]
REVISION = Field(
    None,
    max_length=64,
    description="of the edits that were read; if they were changed meanwhile, the request is refused",
    examples=[None],
)
CONFIRMED = Field(False, description="what it would do to the robot, to places or to the way there is meant")
Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
PointPair = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]


class ChangeEditsParams(OfMapParams):
    """The edits of a map."""

    revision: str | None = REVISION
    confirmed: bool = CONFIRMED


class MapEditId(ChangeEditsParams):
    """An edit of a map."""

    id: str = Field(min_length=1, max_length=64, description="an edit's id")


class EditMapParams(ChangeEditsParams):
    """An edit, with its outline in ``map``: the corners of an area, or the points of a wall."""

    kind: EditKind = Field(description="erase what is inside, draw a wall, or crop to what is inside")
    to: Literal["free", "unknown"] | None = Field(
        None, description="what is erased becomes this; free, if nothing is given", examples=[None]
    )
    points_m: list[PointPair] = Field(
        min_length=2,
        max_length=MOST_POINTS,
        description="at least three for an area",
        examples=[[[1.0, 2.0], [3.0, 2.0], [3.0, 2.8]]],
    )
    width_m: float | None = Field(
        None, gt=0, le=5, description=f"of a wall; if none is given, {WALL_WIDTH_M} m", examples=[None]
    )

    @model_validator(mode="after")
    def _fits_its_kind(self) -> "EditMapParams":
        if self.kind != "wall" and len(self.points_m) < 3:
            raise ValueError(f"expected at least three corners for an area, got {len(self.points_m)}")
        if self.kind != "wall" and self.width_m is not None:
            raise ValueError("expected width_m for a wall alone")
        if self.kind != "erase" and self.to is not None:
            raise ValueError("expected to for what is erased alone")
        return self

    def edit(self) -> MapEdit:
        """As it stands in the file."""
        if self.kind == "wall":
            return DrawWall(points_m=self.outline_m, width_m=self.width_m or WALL_WIDTH_M)
        if self.kind == "crop":
            return Crop(points_m=self.outline_m)
        return Erase(to=self.to or "free", points_m=self.outline_m)

    @property
    def outline_m(self) -> tuple[tuple[float, float], ...]:
        """The points as pairs, to a tenth of a millimetre."""
        return tuple((round(x_m, 4), round(y_m, 4)) for x_m, y_m in self.points_m)


class TurnMapViewParams(OfMapParams):
    """By how much the view of a map is turned."""

    angle_rad: float = Field(
        ge=-MOST_ANGLE_RAD, le=MOST_ANGLE_RAD, description="CCW positive; 0 is as it was made"
    )
    revision: str | None = REVISION


class MapEditData(Record, frozen=True):
    """An edit: the corners of an area, or the points of a wall, in ``map``."""

    id: str
    kind: EditKind
    points_m: tuple[tuple[float, float], ...]
    to: Annotated[Literal["free", "unknown"] | None, Meta(description="what was erased is this")] = None
    width_m: Annotated[float | None, Meta(description="of a wall")] = None


class MapEditList(Record, frozen=True):
    """The edits of a map, in the order in which they are drawn.

    ``can_undo`` says whether there is a change to take back, ``can_redo`` whether one was taken back last.
    """

    map: str
    revision: str
    edits: tuple[MapEditData, ...]
    view_angle_rad: Annotated[
        float, Meta(description="by which the map is turned where it is shown, CCW positive")
    ]
    can_undo: bool
    can_redo: bool


class MapEditsSaved(Record, frozen=True):
    """What was changed is on the disk; ``warning`` says why the robot cannot use the map so, if it cannot."""

    map: str
    revision: str
    edit: Annotated[MapEditData | None, Meta(description="the one that was drawn")] = None
    warning: str | None = None


class MapEditsData(Record, frozen=True):
    """The map whose edits were changed last, and what they are now; empty before the first change."""

    map: str = ""
    revision: str = ""


TOPICS = (Topic("map_edits", (MapEdited,), MapEditsData, same_names(MapEditsData), always_known=True),)


def edit_data(own: str, edit: MapEdit) -> MapEditData:
    """An edit as it is sent."""
    return MapEditData(
        id=own,
        kind=edit.kind,
        points_m=edit.points_m,
        to=edit.to if isinstance(edit, Erase) else None,
        width_m=edit.width_m if isinstance(edit, DrawWall) else None,
    )
