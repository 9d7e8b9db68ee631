"""Maps: the methods that list, load, send, import, rename and delete maps and places."""

from typing import Literal, Protocol

from pydantic import Field, model_validator

from chefbotd.maps.places import FARTHEST_M
from chefbotd.rpc.jobs import Progress
from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import DONE, Done, NoParams, Params, Result
from chefbotd.rpc.roles import Role

NAME = Field(min_length=1, max_length=64, description="a map's name")
PLACE = Field(min_length=1, max_length=64, description="a place's name")
OF_MAP = Field(None, min_length=1, max_length=64, description="the map in use, if none is named")


class MapName(Params):
    """A map."""

    name: str = NAME


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

    @model_validator(mode="after")
    def _x_and_y_together(self) -> "SavePlaceParams":
        if (self.x_m is None) != (self.y_m is None) or (self.x_m is None and self.heading_rad is not None):
            raise ValueError("expected x_m and y_m, with or without heading_rad, or none of the three")
        return self


class MapSummary(Result):
    """A stored map. ``condition`` is ``foreign`` for files that somebody put there: they are read when it is loaded.

    Of a ``damaged`` one no version is whole. ``problem`` says what is wrong, also with newer versions of a whole one.
    """

    name: str
    condition: Literal["whole", "damaged", "foreign"]
    problem: str | None
    in_use: bool
    version: int | None
    versions: tuple[int, ...]
    saved_at_s: float | None = Field(description="seconds since 1970, UTC")
    source: str | None
    resolution_m: float | None
    columns: int | None
    rows: int | None
    size_bytes: int | None
    can_go_on: bool = Field(description="SLAM's state is stored, so that mapping can extend the map")


class MapList(Result):
    """Every stored map, by name, and the one in use."""

    folder: str
    in_use: str | None
    maps: tuple[MapSummary, ...]


class MapInUse(Result):
    """A version of a map; ``warning`` says what is wrong with newer ones."""

    name: str
    version: int
    warning: str | None = None


class MapPart(Result):
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
    data: str


class PlaceData(Result):
    """A place: its pose in ``map``."""

    name: str
    x_m: float
    y_m: float
    heading_rad: float


class PlaceList(Result):
    """The places of a map, in the order in which they were saved."""

    map: str
    places: tuple[PlaceData, ...]


class Maps(Protocol):
    """What keeps the maps; what is not done raises ``chefbotd.core.commands.Refused``."""

    async def list_maps(self) -> MapList:
        """Every map."""
        ...

    async def load(self, name: str, progress: Progress) -> MapInUse:
        """Use a map."""
        ...

    async def part(self, name: str | None, part: int) -> MapPart:
        """A part of a map's cells."""
        ...

    async def import_files(self, yaml: str, name: str | None, replace: bool, progress: Progress) -> MapInUse:
        """Take somebody's files into the store."""
        ...

    async def rename(self, name: str, new_name: str) -> None:
        """Give a map another name."""
        ...

    async def delete(self, name: str) -> None:
        """Remove a map."""
        ...

    async def save_place(self, params: SavePlaceParams) -> PlaceData:
        """Keep a place."""
        ...

    async def places(self, of_map: str | None) -> PlaceList:
        """The places of a map."""
        ...

    async def delete_place(self, of_map: str | None, name: str) -> None:
        """Remove a place."""
        ...


class MapsMethods:
    """The methods of this feature; each runs as a job, because the disk may take its time."""

    def __init__(self, maps: Maps) -> None:
        self._maps = maps

    @method(role=Role.OBSERVE)
    async def list_maps(self, caller: Caller, params: NoParams, progress: Progress) -> MapList:
        """List the stored maps, whether each is intact, and which one is in use."""
        return await self._maps.list_maps()

    @method(role=Role.DRIVE, moves=False)
    async def load_map(self, caller: Caller, params: MapName, progress: Progress) -> MapInUse:
        """Use a map from now on, and after a restart."""
        return await self._maps.load(params.name, progress)

    @method(role=Role.OBSERVE)
    async def get_map(self, caller: Caller, params: GetMapParams, progress: Progress) -> MapPart:
        """The cells of a map, compressed, in parts."""
        return await self._maps.part(params.name, params.part)

    @method(role=Role.ADMIN, moves=False)
    async def import_map(self, caller: Caller, params: ImportMapParams, progress: Progress) -> MapInUse:
        """Store the map of map_server's files on the robot's computer."""
        return await self._maps.import_files(params.yaml, params.name, params.replace, progress)

    @method(role=Role.ADMIN, moves=False)
    async def rename_map(self, caller: Caller, params: RenameMapParams, progress: Progress) -> Done:
        """Give a map another name."""
        await self._maps.rename(params.name, params.new_name)
        return DONE

    @method(role=Role.ADMIN, moves=False)
    async def delete_map(self, caller: Caller, params: MapName, progress: Progress) -> Done:
        """Remove a map with all its versions and places."""
        await self._maps.delete(params.name)
        return DONE

    @method(role=Role.DRIVE, moves=False)
    async def save_place(self, caller: Caller, params: SavePlaceParams, progress: Progress) -> PlaceData:
        """Give a pose in a map a name, or move the place of this name; without a pose, the robot's."""
        return await self._maps.save_place(params)

    @method(role=Role.OBSERVE)
    async def list_places(self, caller: Caller, params: OfMapParams, progress: Progress) -> PlaceList:
        """The places of a map."""
        return await self._maps.places(params.map)

    @method(role=Role.DRIVE, moves=False)
    async def delete_place(self, caller: Caller, params: PlaceName, progress: Progress) -> Done:
        """Remove a place."""
        await self._maps.delete_place(params.map, params.name)
        return DONE
