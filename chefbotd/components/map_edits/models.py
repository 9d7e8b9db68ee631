"""What clients ask of the edits of a map, and what they are answered."""

from typing import Annotated, Literal, TypeAlias

from msgspec import Meta
from pydantic import Field, model_validator

from chefbotd.components.map_edits.edit_file import (
    MOST_ANGLE_RAD,
    MOST_POINTS,
    Crop,
    DrawWall,
    Erase,
    MapEdit,
)
from chefbotd.components.map_edits.events import MapEdited
from chefbotd.components.maps.drawn_models import (
    CONFIRMED,
    WIDTH,
    PointPair,
    id_field,
    points_field,
    require_outline,
    revision_field,
)
from chefbotd.components.maps.models import OfMapParams
from chefbotd.components.maps.outlines import WALL_WIDTH_M
from chefbotd.core.record import Record
from chefbotd.rpc.topics import Topic, same_names

EditKind: TypeAlias = Literal["erase", "wall", "crop"]
REVISION = revision_field("edits")


class ChangeEditsParams(OfMapParams):
    """The edits of a map."""

    revision: str | None = REVISION
    confirmed: bool = CONFIRMED


class MapEditId(ChangeEditsParams):
    """An edit of a map."""

    id: str = id_field("an edit")


class EditMapParams(ChangeEditsParams):
    """An edit, with its outline in ``map``: the corners of an area, or the points of a wall."""

    kind: EditKind = Field(description="erase what is inside, draw a wall, or crop to what is inside")
    to: Literal["free", "unknown"] | None = Field(
        None, description="what is erased becomes this; free, if nothing is given", examples=[None]
    )
    points_m: list[PointPair] = points_field(MOST_POINTS)
    width_m: float | None = WIDTH

    @model_validator(mode="after")
    def _fits_its_kind(self) -> "EditMapParams":
        require_outline(self.kind, self.points_m, self.width_m)
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
