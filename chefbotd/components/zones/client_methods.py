"""The typed client's methods of zones, which take ``of_map`` for ``map``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from chefbotd.client.caller import MethodCaller

if TYPE_CHECKING:
    from chefbotd.client import models


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

        One that covers the robot or a place, or cuts a place off, is refused unless it is ``confirmed``. With the
        ``revision`` of the list it is refused if somebody else changed the zones meanwhile.
        """
        saved: models.ZonesSaved = await self._ask(
            "ZonesSaved",
            "save_zone",
            points_m=[list(point) for point in points_m],
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
        """Draw several new zones, all or none; each has the keys of ``save_zone``: points_m, kind, name and so on."""
        saved: models.ZonesSaved = await self._ask(
            "ZonesSaved",
            "add_zones",
            zones=[dict(zone) for zone in zones],
            revision=revision,
            confirmed=confirmed,
            map=of_map,
        )
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
