"""The typed client's methods of zones, which take ``of_map`` for ``map``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from chefbotd.client.caller import MethodCaller
from chefbotd.client.errors import CallError
from chefbotd.components.maps.client_methods import round_points

if TYPE_CHECKING:
    from chefbotd.client import models

LONGEST_PART_BYTES = 3000
"""Of zones in a request, which has at most 4096 bytes where nothing else is configured."""


class ZoneMethods(MethodCaller):
    """The methods of zones."""

    async def list_zones(self, of_map: str | None = None) -> models.ZoneList:
        """The zones of a map, or of the one in use."""
        listed: models.ZoneList = await self._ask("ZoneList", "list_zones", map=of_map)
        return listed

    async def save_zone(
        self,
        points_m: Sequence[Sequence[float]],
        *,
        id: str | None = None,
        kind: Literal["keep_out", "slow", "wall"] = "keep_out",
        name: str = "",
        enabled: bool = True,
        max_speed_m_s: float | None = None,
        width_m: float | None = None,
        revision: str | None = None,
        confirmed: bool = False,
        of_map: str | None = None,
    ) -> models.ZonesSaved:
        """Draw a zone with these corners (x, y) in ``map``, or change that of this id.

        Corners are sent to a tenth of a millimetre, so that 150 of them fit into a request.
        One that covers the robot or a place, or cuts a place off, is refused unless it is ``confirmed``. With the
        ``revision`` of the list it is refused if somebody else changed the zones meanwhile.
        """
        saved: models.ZonesSaved = await self._ask(
            "ZonesSaved",
            "save_zone",
            points_m=round_points(points_m),
            id=id,
            kind=kind,
            name=name,
            enabled=enabled,
            max_speed_m_s=max_speed_m_s,
            width_m=width_m,
            revision=revision,
            confirmed=confirmed,
            map=of_map,
        )
        return saved

    async def add_zones(
        self,
        zones: Sequence[Mapping[str, Any]],
        *,
        revision: str | None = None,
        confirmed: bool = False,
        of_map: str | None = None,
    ) -> models.ZonesSaved:
        """Draw several new zones, all or none; each has the keys of ``save_zone``: points_m, kind, name and so on.

        What is too long for one request goes in several. One ``undo_zones`` takes all back, and that is done where one
        of them is refused. Only a connection that is lost between them leaves a part.
        """
        first, *others = _parts_of(zones)

        async def add(part: Sequence[Mapping[str, Any]], revision: str | None, of_map: str | None) -> Any:
            return await self._ask(
                "ZonesSaved",
                "add_zones",
                zones=[dict(zone) for zone in part],
                revision=revision,
                confirmed=confirmed,
                map=of_map,
                continued=None if part is first else True,
            )

        saved: models.ZonesSaved = await add(first, revision, of_map)
        try:
            for part in others:
                saved = await add(part, saved.revision, saved.map)
        except CallError:
            await self.undo_zones(revision=saved.revision, of_map=saved.map)
            raise
        return saved

    async def delete_zone(
        self, id: str, *, revision: str | None = None, of_map: str | None = None
    ) -> models.ZonesSaved:
        """Take a zone off a map."""
        saved: models.ZonesSaved = await self._ask(
            "ZonesSaved", "delete_zone", id=id, revision=revision, map=of_map
        )
        return saved

    async def undo_zones(
        self, *, revision: str | None = None, of_map: str | None = None
    ) -> models.ZonesSaved:
        """Take the last change of a map's zones back; done again, it is made again."""
        saved: models.ZonesSaved = await self._ask("ZonesSaved", "undo_zones", revision=revision, map=of_map)
        return saved


def _parts_of(zones: Sequence[Mapping[str, Any]]) -> list[list[Mapping[str, Any]]]:
    """The zones in requests that are short enough; at least one, which may be empty."""
    parts: list[list[Mapping[str, Any]]] = [[]]
    length = 0
    for zone in zones:
        own = len(json.dumps(dict(zone), separators=(",", ":"))) + 1
        if parts[-1] and length + own > LONGEST_PART_BYTES:
            parts.append([])
            length = 0
        parts[-1].append(zone)
        length += own
    return parts
