"""Mapping: a map that is being made, and the topics ``mapping``, ``map`` and ``map_pose``."""

from typing import Annotated, Literal

from msgspec import Meta
from pydantic import Field, model_validator

from chefbotd.components.maps.events import MapChanged, MappingChanged, MappingData
from chefbotd.components.maps.models import GridPartData, grid_part
from chefbotd.core.events.robot import MapPoseUpdated
from chefbotd.core.record import Record, replace
from chefbotd.rpc.models import Params
from chefbotd.rpc.topics import Topic, same_names


class StartMappingParams(Params):
    """The map to make: a new one or, with a name, a saved one to continue."""

    name: str | None = Field(None, min_length=1, max_length=64)
    unfinished: bool = Field(False, description="continue the unfinished map")

    @model_validator(mode="after")
    def _one_of_both(self) -> "StartMappingParams":
        if self.name is not None and self.unfinished:
            raise ValueError("expected name or unfinished, not both: an unfinished map has no name")
        return self


class FinishMappingParams(Params):
    """The map's name; an existing map of this name gets a new version."""

    name: str = Field(min_length=1, max_length=64)


class MapData(GridPartData, frozen=True, kw_only=True):
    """Changed cells of the map that is being made, or all of it (``whole``); ``revision`` counts without gaps.

    ``cells`` are ``part_rows`` by ``part_columns`` from (``row``, ``column``) on, the lowest y first.
    """

    whole: bool
    cells: Annotated[str, Meta(description="a signed byte each: percent occupied, -1 unknown")]


class MapPoseData(Record, frozen=True):
    """The robot's pose in the map with its covariance, and how well the scan fits (0 to 1)."""

    x_m: float
    y_m: float
    heading_rad: Annotated[float, Meta(description="CCW positive, in (-pi, pi]")]
    covariance: Annotated[tuple[float, ...], Meta(description="3x3, row by row, over x, y, heading")]
    fit: float
    state: Annotated[
        str,
        Meta(
            description="mapping, localized, wheel_slip, uncertain, lost, searching (lost, and looking for a place), "
            "or ended (another map is in use: there is no pose)"
        ),
    ]
    searched: Annotated[float, Meta(description="the share of the search for a known place that is done")] = (
        0.0
    )
    map: Annotated[str | None, Meta(description="the map that it is in; none: a new one is being made")] = (
        None
    )
    frame_id: Literal["map"] = "map"
    child_frame_id: Literal["base_footprint"] = "base_footprint"


def map_data(event: MapChanged) -> MapData:
    """The data of the topic ``map`` for an event."""
    return MapData(**grid_part(event), whole=event.whole)


def _map_pose(event: MapPoseUpdated) -> MapPoseData:
    pose = event.map_from_base
    return MapPoseData(
        x_m=pose.x_m,
        y_m=pose.y_m,
        heading_rad=pose.heading_rad,
        covariance=event.covariance.row_by_row,
        fit=event.fit,
        state=event.state,
        searched=event.searched,
        map=event.map,
    )


def mapping_data(event: MappingChanged | None) -> MappingData:
    """The data of the topic ``mapping`` for an event."""
    data = same_names(MappingData)(event)
    return data if data.warning else replace(data, warning=None)


TOPICS = (
    Topic("mapping", (MappingChanged,), MappingData, mapping_data, always_known=True, for_guests=True),
    Topic("map", (MapChanged,), MapData, map_data, for_guests=True),
    Topic("map_pose", (MapPoseUpdated,), MapPoseData, _map_pose, for_guests=True),
)
