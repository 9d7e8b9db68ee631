"""What clients ask of zones, and what they are answered."""

from typing import Annotated, Any, Literal, TypeAlias

from msgspec import Meta
from pydantic import Field, model_validator

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
from chefbotd.components.zones.events import ZonesChanged
from chefbotd.components.zones.zone_file import (
    AnyZone,
    SlowZone,
    Wall,
    Zone,
    kind_of,
    outline_m,
)
from chefbotd.core.record import Record
from chefbotd.rpc.models import Params
from chefbotd.rpc.topics import Topic, same_names

MOST_POINTS = 200
"""Of a zone that is drawn by hand: whether its edges cross is looked at pair by pair."""

MOST_ADDED = 200
MOST_ADDED_POINTS = 5000
"""Of all zones of a request."""

ZoneKind: TypeAlias = Literal["keep_out", "slow", "wall"]
REVISION = revision_field("zones")


class ZoneId(OfMapParams):
    """A zone of a map."""

    id: str = id_field("a zone")
    revision: str | None = REVISION


class ChangeZonesParams(OfMapParams):
    """The zones of a map."""

    revision: str | None = REVISION


class ZoneShape(Params):
    """A zone with its outline in ``map``: the corners of an area, or the points of a wall."""

    kind: ZoneKind = Field("keep_out", description="not to be entered, to be driven slowly in, or a wall")
    name: str = Field("", max_length=100, description="for people")
    enabled: bool = Field(True, description="false: it is kept, and does not count")
    points_m: list[PointPair] = points_field(MOST_POINTS)
    max_speed_m_s: float | None = Field(
        None, gt=0, le=10, description="of a slow zone, which needs it", examples=[None]
    )
    width_m: float | None = WIDTH

    @model_validator(mode="after")
    def _fits_its_kind(self) -> "ZoneShape":
        require_outline(self.kind, self.points_m, self.width_m)
        if (self.kind == "slow") != (self.max_speed_m_s is not None):
            raise ValueError("expected max_speed_m_s for a slow zone, and for no other")
        return self

    def zone(self, own: str) -> AnyZone:
        """As it stands in the file."""
        about: dict[str, Any] = {"id": own, "name": self.name, "enabled": self.enabled}
        if self.kind == "wall":
            return Wall(**about, points_m=self.outline_m, width_m=self.width_m or WALL_WIDTH_M)
        if self.max_speed_m_s is not None:
            return SlowZone(**about, corners_m=self.outline_m, max_speed_m_s=self.max_speed_m_s)
        return Zone(**about, corners_m=self.outline_m)

    @property
    def outline_m(self) -> tuple[tuple[float, float], ...]:
        """The points as pairs."""
        return tuple((x_m, y_m) for x_m, y_m in self.points_m)


class SaveZoneParams(ChangeZonesParams, ZoneShape):
    """A zone; one of an ``id`` that there is replaces it."""

    id: str | None = Field(
        None, min_length=1, max_length=64, description="if none is given, it is a new zone"
    )
    confirmed: bool = CONFIRMED


class AddZonesParams(ChangeZonesParams):
    """New zones, which are drawn together or not at all."""

    zones: list[ZoneShape] = Field(min_length=1, max_length=MOST_ADDED)
    confirmed: bool = CONFIRMED
    continued: bool = Field(
        False,
        description="they belong to the change that made this revision, where one request is too short: "
        "one undo takes both back",
    )

    @model_validator(mode="after")
    def _continues_a_revision(self) -> "AddZonesParams":
        if self.continued and self.revision is None:
            raise ValueError("expected the revision that is continued, got none")
        return self

    @model_validator(mode="after")
    def _has_few_points(self) -> "AddZonesParams":
        count = sum(len(zone.points_m) for zone in self.zones)
        if count > MOST_ADDED_POINTS:
            raise ValueError(f"expected at most {MOST_ADDED_POINTS} corners in all, got {count}")
        return self


class ZoneData(Record, frozen=True):
    """A zone: the corners of an area, or the points of a wall, in ``map``. One that is not enabled does not count."""

    id: str
    kind: ZoneKind
    name: str
    enabled: bool
    points_m: tuple[tuple[float, float], ...]
    max_speed_m_s: Annotated[float | None, Meta(description="of a slow zone")] = None
    width_m: Annotated[float | None, Meta(description="of a wall")] = None


class ZoneList(Record, frozen=True):
    """The zones of a map. ``can_undo`` says whether there is a change to take back."""

    map: str
    revision: str
    zones: tuple[ZoneData, ...]
    can_undo: bool


class ZonesSaved(Record, frozen=True):
    """What was changed is on the disk; ``warning`` says why navigation cannot use the zones, if it cannot."""

    map: str
    revision: str
    zone: Annotated[ZoneData | None, Meta(description="the one that was saved")] = None
    warning: str | None = None


class ZonesData(Record, frozen=True):
    """The map whose zones were changed last, and what they are now; empty before the first change."""

    map: str = ""
    revision: str = ""


TOPICS = (
    Topic("zones", (ZonesChanged,), ZonesData, same_names(ZonesData), always_known=True, for_guests=True),
)


def zone_data(own: str, zone: AnyZone) -> ZoneData:
    """A zone as it is sent."""
    kind = kind_of(zone)
    return ZoneData(
        id=own,
        kind="wall" if kind == "walls" else "slow" if kind == "slow" else "keep_out",
        name=zone.name,
        enabled=zone.enabled,
        points_m=outline_m(zone),
        max_speed_m_s=zone.max_speed_m_s if isinstance(zone, SlowZone) else None,
        width_m=zone.width_m if isinstance(zone, Wall) else None,
    )
