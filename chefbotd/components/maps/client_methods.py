"""The typed client's methods of maps and places that do more than ask, or take ``of_map`` for ``map``."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from chefbotd.client.caller import MethodCaller, drop_defaults, parse
from chefbotd.client.errors import ProtocolError
from chefbotd.client.wire import ProgressListener
from chefbotd.components.maps.map_image import MapImage

if TYPE_CHECKING:
    from chefbotd.client import models


def round_points(points_m: Sequence[Sequence[float]]) -> list[list[float]]:
    """Points as they are sent: to a tenth of a millimetre, so that 150 of them fit into a request."""
    return [[round(float(value), 4) for value in point] for point in points_m]


class MapMethods(MethodCaller):
    """The methods of maps."""

    async def get_map(self, name: str | None = None, on_progress: ProgressListener | None = None) -> MapImage:
        """The cells of a map; without a ``name`` of the one that is being made, or else of the one in use.

        ``on_progress`` counts its parts.
        """
        from chefbotd.client import models

        params = drop_defaults(name=name)
        parts: list[models.MapPart] = []
        while not parts or len(parts) < parts[0].parts:
            part = parse(models.MapPart, await self.call("get_map", **params, part=len(parts)))
            if parts and _which(part) != _which(parts[0]):
                parts = []  # it was saved or edited anew meanwhile
                continue
            parts.append(part)
            if on_progress is not None:
                on_progress(len(parts), part.parts, "receiving")
        return _image(parts)

    async def save_place(
        self,
        name: str,
        x_m: float | None = None,
        y_m: float | None = None,
        heading_rad: float | None = None,
        *,
        of_map: str | None = None,
        kind: Literal["table", "dock", "home", "other"] | None = None,
        note: str | None = None,
    ) -> models.PlaceData:
        """Give a pose a name, or move the place of this name; without a pose, it is where the robot is.

        Without a ``kind`` or a ``note`` a place keeps what it has.
        """
        place: models.PlaceData = await self._ask(
            "PlaceData",
            "save_place",
            name=name,
            x_m=x_m,
            y_m=y_m,
            heading_rad=heading_rad,
            map=of_map,
            kind=kind,
            note=note,
        )
        return place

    async def list_places(self, of_map: str | None = None) -> models.PlaceList:
        """The places of a map; without one, of the map in use."""
        places: models.PlaceList = await self._ask("PlaceList", "list_places", map=of_map)
        return places

    async def delete_place(self, name: str, of_map: str | None = None) -> None:
        """Remove a place."""
        await self._ask(None, "delete_place", name=name, map=of_map)


def _which(part: models.MapPart) -> tuple[str | None, int, str | None]:
    return part.name, part.version, part.edits


def _image(parts: list[models.MapPart]) -> MapImage:
    first = parts[0]
    expected = first.rows * first.columns
    try:
        packed = base64.b64decode("".join(part.data for part in parts), validate=True)
        cells = zlib.decompressobj().decompress(packed, expected + 1)
    except (ValueError, zlib.error) as error:
        raise ProtocolError(f"get_map: the cells cannot be unpacked: {error}") from error
    if len(cells) != expected:
        raise ProtocolError(f"get_map: {expected} cells were expected, but at least {len(cells)} arrived")
    return MapImage(
        first.name,
        first.version,
        first.saved_at_s,
        first.resolution_m,
        first.columns,
        first.rows,
        first.x_m,
        first.y_m,
        first.heading_rad,
        cells,
    )
