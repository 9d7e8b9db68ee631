"""The accepted goals, in order, and the ends of the others; the pose of a goal that is the name of a place."""

import asyncio
import json
from collections.abc import Iterable, Sequence
from typing import Protocol

import msgspec

from chefbotd.components.maps.models import PlaceList
from chefbotd.components.maps.storage.places import describe_unknown
from chefbotd.components.navigation.algorithms.arrival import ArrivalData
from chefbotd.components.navigation.events import ActiveGoal, GoalCause, GoalList, GoalResult
from chefbotd.components.navigation.models import Waypoint
from chefbotd.components.navigation.skill_requests import GoalAsked
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence, sentence_data, sentence_of
from chefbotd.inputs import InputLog
from chefbotd.rpc.encoding import encode

MOST_ACTIVE, MOST_ENDED = 200, 400
NOT_ACCEPTED = "cancelled: it was not accepted"


class GoalsState(Record, frozen=True):
    """The goals that have not ended, in order, the ends of the others, and the last number that was given.

    ``ids`` are the goals of each id that a client chose, ``clients`` the client with which a goal ends.
    """

    active: list[GoalAsked]
    ended: list[GoalResult]
    last_number: int
    ids: dict[str, tuple[int, ...]] = {}
    clients: dict[int, int] = {}


class Goals:
    """``active`` are those that have not ended, by their numbers; ``clients`` those with which a goal ends."""

    def __init__(self) -> None:
        self.active: dict[int, GoalAsked] = {}
        self.clients: dict[int, int] = {}
        self._ends: dict[int, asyncio.Future[GoalResult]] = {}
        self._ids: dict[str, tuple[int, ...]] = {}
        self._last_number = 0

    def state(self) -> GoalsState:
        """Return the state of this part."""
        ended = [end.result() for end in self._ends.values() if end.done()]
        active = list(self.active.values())
        return GoalsState(active, ended, self._last_number, self._ids, self.clients)

    def restore(self, state: GoalsState) -> None:
        """Restore this state."""
        self.active, self._ends, self._last_number = {}, {}, state.last_number
        self._ids, self.clients = dict(state.ids), dict(state.clients)
        for ended in state.ended:
            self._ends[ended.goal] = asyncio.get_running_loop().create_future()
            self._ends[ended.goal].set_result(ended)
        self.add(state.active)

    def reserve(self, count: int, goal_id: str | None) -> list[int]:
        """Numbers that no goal has had; until ``add`` or ``forget`` their goals are being accepted."""
        numbers = [self._last_number + index for index in range(1, count + 1)]
        self._last_number += count
        for number in numbers:
            self._ends[number] = asyncio.get_running_loop().create_future()
        if goal_id is not None:
            self._ids[goal_id] = tuple(numbers)
        return numbers

    def require_room(self, more: int) -> None:
        """Raises ``Refused`` where so many more would be too many."""
        if len(self.active) + more > MOST_ACTIVE:
            why = Sentence(
                "navigation.too_many_goals",
                "at most {most} goals may wait at a time: {waiting} wait, got {more} more",
                most=MOST_ACTIVE,
                waiting=len(self.active),
                more=more,
            )
            raise Refused(RefusalKind.OUT_OF_RANGE, why)

    def add(self, goals: Iterable[GoalAsked]) -> None:
        """Goals that the worker is to drive to."""
        for goal in goals:
            self.active[goal.number] = goal
            if goal.number not in self._ends:
                self._ends[goal.number] = asyncio.get_running_loop().create_future()
        ended = [number for number, end in self._ends.items() if end.done()]
        for number in ended[: max(0, len(ended) - MOST_ENDED)]:
            del self._ends[number]
        self._ids = {name: goals for name, goals in self._ids.items() if goals[-1] in self._ends}

    def forget(self, numbers: Iterable[int]) -> None:
        """Goals that were not accepted; who asked for the same id meanwhile, and waits, is told."""
        for number in numbers:
            self.active.pop(number, None)
            self.clients.pop(number, None)
            end = self._ends.pop(number, None)
            if end is not None and not end.done():
                end.set_result(GoalResult(number, "cancelled", NOT_ACCEPTED, GoalCause.REFUSED))
        self._ids = {name: goals for name, goals in self._ids.items() if goals[-1] in self._ends}

    def end(self, ended: GoalResult) -> bool:
        """A goal has ended; False: it is none of the active ones."""
        if self.active.pop(ended.goal, None) is None:
            return False
        self.clients.pop(ended.goal, None)
        end = self._ends[ended.goal]
        if not end.done():
            end.set_result(replace(ended, goal_id=self.id_of(ended.goal)))
        return True

    def note_arrival(self, data: ArrivalData) -> None:
        """What is thought now of a goal that was reached: ``get_goal`` tells it from now on."""
        end = self._ends.get(data.goal)
        if end is not None and end.done():
            self._ends[data.goal] = asyncio.get_running_loop().create_future()
            self._ends[data.goal].set_result(replace(end.result(), arrival=data.arrival, off_m=data.off_m))

    def active_goals(self) -> GoalList:
        """Those that have not ended, in order."""
        return GoalList(
            tuple(
                ActiveGoal(goal.number, goal.x_m, goal.y_m, goal.heading_rad, self.id_of(goal.number))
                for goal in self.active.values()
            )
        )

    def set_client(self, number: int, client: int | None) -> None:
        """A goal that has not ended is to end with this client; None: with none."""
        self.clients.pop(number, None)
        end = self._ends.get(number)
        if client is not None and end is not None and not end.done():
            self.clients[number] = client

    def end_of(self, number: int) -> "asyncio.Future[GoalResult]":
        """What will have the goal's end; raises ``Refused`` for a goal that nobody remembers."""
        end = self._ends.get(number)
        if end is None:
            raise Refused(
                RefusalKind.UNKNOWN_GOAL,
                Sentence("navigation.unknown_goal", "no goal {number} is remembered", number=number),
            )
        return end

    def of_id(self, goal_id: str) -> tuple[int, ...]:
        """The goals of this id; none where it is not known, or was forgotten."""
        return self._ids.get(goal_id, ())

    def id_of(self, number: int) -> str | None:
        """The id that a client chose for this goal."""
        return next((name for name, numbers in self._ids.items() if number in numbers), None)

    def result(self, numbers: Sequence[int]) -> GoalResult:
        """How these have ended: the first that was not reached, or the last; without an end one has not ended."""
        for number in numbers:
            end = self.end_of(number)
            if not end.done():
                break
            if end.result().end != "reached" or number == numbers[-1]:
                return end.result()
        return GoalResult(goal=numbers[-1], goal_id=self.id_of(numbers[-1]))


class Places(Protocol):
    """Has the named places of maps."""

    async def places(self, of_map: str | None) -> PlaceList:
        """Those of a map; without one, of the map in use."""
        ...


class Destinations:
    """Looks places up as they are now: a place that is moved or deleted later changes no goal."""

    def __init__(self, places: Places, entries: InputLog) -> None:
        self._places, self._entries = places, entries

    async def goals(self, numbers: Sequence[int], waypoints: Sequence[Waypoint]) -> list[GoalAsked]:
        """The goals of these numbers; raises ``Refused`` where there is no such place. The places are read once."""
        places = None
        if any(waypoint.place is not None for waypoint in waypoints):
            places = await self._read_places()
        return [_goal(number, waypoint, places) for number, waypoint in zip(numbers, waypoints, strict=True)]

    async def _read_places(self) -> PlaceList:
        """Those of the map in use; where the disk has no answer, why not."""

        async def ask() -> str:
            try:
                return encode(await self._places.places(None)).decode()
            except Refused as problem:
                return json.dumps(
                    {"kind": problem.kind, "message": str(problem), **sentence_data(problem.words)}
                )

        answer = await self._entries.answer("places", ask)
        refused = json.loads(answer)
        if "kind" in refused:
            raise Refused(RefusalKind(refused["kind"]), sentence_of(refused["message"], refused))
        return msgspec.json.decode(answer, type=PlaceList)


def _goal(number: int, waypoint: Waypoint, places: PlaceList | None) -> GoalAsked:
    x_m, y_m, heading_rad = waypoint.x_m, waypoint.y_m, waypoint.heading_rad
    if waypoint.place is not None and places is not None:
        place = next((place for place in places.places if place.name == waypoint.place), None)
        if place is None:
            others = describe_unknown(waypoint.place, [place.name for place in places.places])
            why = Sentence(
                "navigation.unknown_place",
                "the map {map!a} has no place {place!a}; {others}",
                map=places.map,
                place=waypoint.place,
                others=others,
            )
            raise Refused(RefusalKind.UNKNOWN_PLACE, why)
        x_m, y_m, heading_rad = place.x_m, place.y_m, place.heading_rad
    return GoalAsked(
        number, x_m or 0.0, y_m or 0.0, heading_rad, waypoint.tolerance_m, waypoint.max_speed_m_s
    )
