"""Finds the pose of a waypoint: given directly, or by the name of a place of the map in use."""

import json
from collections.abc import Sequence
from typing import Protocol

import msgspec

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.entries import Entries
from chefbotd.features.maps.models import PlaceList
from chefbotd.features.navigation.models import Waypoint
from chefbotd.rpc.encoding import encode
from chefbotd.worker.skills.navigation_requests import GoalAsked


class Places(Protocol):
    """Who knows the named places."""

    async def places(self, of_map: str | None) -> PlaceList:
        """Those of a map; without one, of the map in use."""
        ...


class Destinations:
    """Looks places up as they are now: a place that is moved or deleted later changes no goal."""

    def __init__(self, places: Places, entries: Entries) -> None:
        self._places, self._entries = places, entries

    async def goals(self, numbers: Sequence[int], waypoints: Sequence[Waypoint]) -> list[GoalAsked]:
        """The goals of these numbers; raises ``Refused`` where there is no such place. The places are read once."""
        known = None
        if any(waypoint.place is not None for waypoint in waypoints):
            known = await self._known_places()
        return [_goal(number, waypoint, known) for number, waypoint in zip(numbers, waypoints, strict=True)]

    async def _known_places(self) -> PlaceList:
        """Those of the map in use; where the disk has no answer, why not."""

        async def ask() -> str:
            try:
                return encode(await self._places.places(None)).decode()
            except Refused as problem:
                return json.dumps({"kind": problem.kind, "message": str(problem)})

        answer = await self._entries.answer("places", ask)
        refused = json.loads(answer)
        if "kind" in refused:
            raise Refused(RefusalKind(refused["kind"]), refused["message"])
        return msgspec.json.decode(answer, type=PlaceList)


def _goal(number: int, waypoint: Waypoint, known: PlaceList | None) -> GoalAsked:
    x_m, y_m, heading_rad = waypoint.x_m, waypoint.y_m, waypoint.heading_rad
    if waypoint.place is not None and known is not None:
        place = next((each for each in known.places if each.name == waypoint.place), None)
        if place is None:
            names = ", ".join(each.name for each in known.places) or "none"
            told = f"the map {known.map!a} has no place {waypoint.place!a}; there are: {names}"
            raise Refused(RefusalKind.UNKNOWN_PLACE, told)
        x_m, y_m, heading_rad = place.x_m, place.y_m, place.heading_rad
    return GoalAsked(number, x_m or 0.0, y_m or 0.0, heading_rad, waypoint.tolerance_m)
