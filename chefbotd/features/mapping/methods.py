"""Mapping: the methods that start and end it, and the topics ``mapping``, ``map`` and ``map_pose``."""

from typing import Literal, Protocol

from pydantic import Field, model_validator

from chefbotd.core.events.mapping import MapChanged, MappingChanged, MapPoseUpdated
from chefbotd.features.maps.grid_part import GridPartData, grid_part
from chefbotd.rpc.jobs import Progress
from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import NoParams, Params, Result, TopicData
from chefbotd.rpc.roles import Role
from chefbotd.rpc.topics import Topic


class StartMappingParams(Params):
    """Which map: a new one, or with a name the saved one that is gone on with."""

    name: str | None = Field(None, min_length=1, max_length=64)
    unfinished: bool = Field(False, description="continue the unfinished map")

    @model_validator(mode="after")
    def _one_of_both(self) -> "StartMappingParams":
        if self.name is not None and self.unfinished:
            raise ValueError("expected name or unfinished, not both: an unfinished map has no name")
        return self


class FinishMappingParams(Params):
    """What the map is to be called; a map of that name gets a new version."""

    name: str = Field(min_length=1, max_length=64)


class MappingResult(Result):
    """How the map stands."""

    state: str = Field(description="idle, mapping, paused or finishing")
    name: str | None = Field(description="the map that is being extended")
    keyframes: int
    loops: int
    path_m: float
    warning: str | None = Field(default=None, description="what is lost of the unfinished map")


class MapSaved(Result):
    """The map was saved."""

    name: str
    version: int
    keyframes: int
    loops: int
    path_m: float


class MappingData(TopicData):
    """The state of mapping; ``reason`` says what is wrong, if anything is."""

    state: str = Field(default="idle", description="idle, mapping, paused or finishing")
    name: str | None = Field(default=None, description="the map that is being extended")
    keyframes: int = 0
    loops: int = 0
    path_m: float = 0.0
    scans: int = 0
    unfinished: bool = Field(default=False, description="there is an unfinished map on the disk")
    reason: str = ""
    warning: str | None = Field(default=None, description="what is lost of the unfinished map")


class MapData(GridPartData):
    """Changed cells of the map that is being made, or all of it (``whole``); ``revision`` counts without gaps.

    ``cells`` are ``part_rows`` by ``part_columns`` from (``row``, ``column``) on, the lowest y first.
    """

    whole: bool
    cells: str = Field(description="a signed byte each: percent occupied, -1 unknown")


class MapPoseData(TopicData):
    """The robot's pose in the map with its covariance, and how well the scan fits (0 to 1)."""

    x_m: float
    y_m: float
    heading_rad: float = Field(description="CCW positive, in (-pi, pi]")
    covariance: tuple[float, ...] = Field(description="3x3, row by row, over x, y, heading")
    fit: float
    state: str = Field(description="mapping, wheel_slip, uncertain or lost")
    frame_id: Literal["map"] = "map"
    child_frame_id: Literal["base_footprint"] = "base_footprint"


class Mapping(Protocol):
    """What makes maps. Each raises ``chefbotd.core.commands.Refused`` where it is not done."""

    async def start(self, name: str | None, *, unfinished: bool) -> MappingResult:
        """Begin, or go on."""
        ...

    async def pause(self) -> MappingResult:
        """Take in no scans until started again."""
        ...

    async def finish(self, name: str, progress: Progress) -> MapSaved:
        """Match all scans once more, and save the map."""
        ...

    async def discard(self) -> MappingResult:
        """Forget the map that is being made, or was never finished."""
        ...


class MappingMethods:
    """The methods of this feature."""

    def __init__(self, mapping: Mapping) -> None:
        self._mapping = mapping

    @method(role=Role.DRIVE, moves=False)
    async def start_mapping(
        self, caller: Caller, params: StartMappingParams, progress: Progress
    ) -> MappingResult:
        """Begin a map, go on with a saved one by its name, or go on after a pause."""
        return await self._mapping.start(params.name, unfinished=params.unfinished)

    @method(role=Role.DRIVE, moves=False)
    async def pause_mapping(self, caller: Caller, params: NoParams, progress: Progress) -> MappingResult:
        """Pause mapping until start_mapping is sent."""
        return await self._mapping.pause()

    @method(role=Role.DRIVE, moves=False)
    async def finish_mapping(
        self, caller: Caller, params: FinishMappingParams, progress: Progress
    ) -> MapSaved:
        """Match all scans once more, save the map under a name, and end; reports progress."""
        return await self._mapping.finish(params.name, progress)

    @method(role=Role.DRIVE, moves=False)
    async def discard_mapping(self, caller: Caller, params: NoParams, progress: Progress) -> MappingResult:
        """End without saving, and forget the map that was never finished; saved maps stay."""
        return await self._mapping.discard()


def map_data(event: MapChanged) -> MapData:
    """What the topic ``map`` tells of an event."""
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
    )


def _mapping(event: MappingChanged | None) -> MappingData:
    data = MappingData.of(event)
    return data if data.warning else data.model_copy(update={"warning": None})


TOPICS = (
    Topic("mapping", (MappingChanged,), MappingData, _mapping, always_known=True),
    Topic("map", (MapChanged,), MapData, map_data),
    Topic("map_pose", (MapPoseUpdated,), MapPoseData, _map_pose),
)
