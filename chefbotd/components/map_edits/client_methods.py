"""The typed client's methods of map edits, which take ``of_map`` for ``map``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from chefbotd.client.caller import MethodCaller
from chefbotd.components.maps.client_methods import round_points

if TYPE_CHECKING:
    from chefbotd.client import models


class MapEditMethods(MethodCaller):
    """The methods of map edits.

    With the ``revision`` of the list a change is refused if somebody else changed the edits meanwhile. One that would
    leave the robot or a place where nobody can drive, or cut a place off, is refused unless it is ``confirmed``.
    """

    async def list_map_edits(self, of_map: str | None = None) -> models.MapEditList:
        """The edits of a map, or of the one in use."""
        listed: models.MapEditList = await self._ask("MapEditList", "list_map_edits", map=of_map)
        return listed

    async def edit_map(
        self,
        kind: Literal["erase", "wall", "crop"],
        points_m: Sequence[Sequence[float]],
        *,
        to: Literal["free", "unknown"] | None = None,
        width_m: float | None = None,
        revision: str | None = None,
        confirmed: bool = False,
        of_map: str | None = None,
    ) -> models.MapEditsSaved:
        """Erase what is within these corners (x, y) in ``map``, draw a wall along these points, or crop the map.

        What is erased becomes free, or ``to`` unknown.
        """
        saved: models.MapEditsSaved = await self._ask(
            "MapEditsSaved",
            "edit_map",
            kind=kind,
            points_m=round_points(points_m),
            to=to,
            width_m=width_m,
            revision=revision,
            confirmed=confirmed,
            map=of_map,
        )
        return saved

    async def turn_map_view(
        self, angle_rad: float, *, revision: str | None = None, of_map: str | None = None
    ) -> models.MapEditsSaved:
        """Turn the view of a map (CCW positive); nothing that is driven by changes."""
        saved: models.MapEditsSaved = await self._ask(
            "MapEditsSaved", "turn_map_view", angle_rad=angle_rad, revision=revision, map=of_map
        )
        return saved

    async def delete_map_edit(
        self, id: str, *, revision: str | None = None, confirmed: bool = False, of_map: str | None = None
    ) -> models.MapEditsSaved:
        """Take an edit off a map."""
        saved: models.MapEditsSaved = await self._ask(
            "MapEditsSaved", "delete_map_edit", id=id, revision=revision, confirmed=confirmed, map=of_map
        )
        return saved

    async def undo_map_edit(
        self, *, revision: str | None = None, confirmed: bool = False, of_map: str | None = None
    ) -> models.MapEditsSaved:
        """Take the last change of a map's edits back, and then those before it."""
        saved: models.MapEditsSaved = await self._ask(
            "MapEditsSaved", "undo_map_edit", revision=revision, confirmed=confirmed, map=of_map
        )
        return saved

    async def redo_map_edit(
        self, *, revision: str | None = None, confirmed: bool = False, of_map: str | None = None
    ) -> models.MapEditsSaved:
        """Make the change again that was taken back last."""
        saved: models.MapEditsSaved = await self._ask(
            "MapEditsSaved", "redo_map_edit", revision=revision, confirmed=confirmed, map=of_map
        )
        return saved
