"""The accepted goals, in order, and the ends of the others; the pose of a goal that is the name of a place."""

import asyncio
import json
from bisect import insort
from collections.abc import Collection, Iterable, Sequence
from typing import Protocol

import msgspec

from chefbotd.components.maps.models import PlaceList
from chefbotd.components.maps.storage.places import describe_unknown
from chefbotd.components.navigation.algorithms.arrival import ArrivalData
from chefbotd.components.navigation.events import ActiveGoal, GoalCause, GoalList, GoalResult
from chefbotd.components.navigation.models import Waypoint
from chefbotd.components.navigation.skill_requests import GoalAsked
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.record import MutableState, StatefulPart, replace
from chefbotd.core.sentence import Sentence, sentence_data, sentence_of
from chefbotd.inputs import InputLog
from chefbotd.rpc.encoding import encode

MOST_ACTIVE, MOST_ENDED = 200, 400
NOT_ACCEPTED = "cancelled: it was not accepted"


class GoalsState(MutableState):
    """The goals that have not ended, and the ends of the others, in order, and the last number that was given.

    ``ids`` are the goals of each id that a client chose, ``clients`` the client with which a goal ends.
    """

    active: list[GoalAsked] = []
    ended: list[GoalResult] = []
    last_number: int = 0
    ids: dict[str, tuple[int, ...]] = {}
    clients: dict[int, int] = {}


class Goals(StatefulPart[GoalsState]):
    """Each goal from its number on: while it is accepted, while it is active, and how it has ended."""

    def __init__(self) -> None:
        self.memory = GoalsState()
        self._ends: dict[int, asyncio.Future[GoalResult]] = {}  # of those that have not ended

    def restore(self, state: GoalsState) -> None:
        """Restore this state; whoever waits for the end of an active goal begins to wait again."""
        super().restore(state)
        self._ends.clear()
        self.add(self.memory.active)

    @property
    def active(self) -> dict[int, GoalAsked]:
        """Those that the worker is to drive to, in order, by their numbers."""
        return {goal.number: goal for goal in self.memory.active}

    @property
    def clients(self) -> dict[int, int]:
        """By the numbers of active goals, the client with which each of them ends."""
        return self.memory.clients

    def reserve(self, count: int, goal_id: str | None) -> list[int]:
        """Numbers that no goal has had; until ``add`` or ``forget`` their goals are being accepted."""
        last = self.memory.last_number
        numbers = [last + index for index in range(1, count + 1)]
        self.memory.last_number += count
        for number in numbers:
            self._ends[number] = asyncio.get_running_loop().create_future()
        if goal_id is not None:
            self.memory.ids[goal_id] = tuple(numbers)
        return numbers

    def require_room(self, more: int) -> None:
        """Raises ``Refused`` where so many more would be too many."""
        if len(self.memory.active) + more > MOST_ACTIVE:
            why = Sentence(
                "navigation.too_many_goals",
                "at most {most} goals may wait at a time: {waiting} wait, got {more} more",
                most=MOST_ACTIVE,
                waiting=len(self.memory.active),
                more=more,
            )
            raise Refused(RefusalKind.OUT_OF_RANGE, why)

    def add(self, goals: Iterable[GoalAsked]) -> None:
        """Goals that the worker is to drive to."""
        active = self.active | {goal.number: goal for goal in goals}
        self.memory.active = list(active.values())
        for number in active.keys() - self._ends.keys():
            self._ends[number] = asyncio.get_running_loop().create_future()
        del self.memory.ended[:-MOST_ENDED]
        self._forget_ids()

    def forget(self, numbers: Collection[int]) -> None:
        """Goals that were not accepted; who asked for the same id meanwhile, and waits, is told."""
        for number in numbers:
            self._deactivate(number)
            if (end := self._ends.pop(number, None)) is not None:
                end.set_result(GoalResult(number, "cancelled", NOT_ACCEPTED, GoalCause.REFUSED))
        self.memory.ended = [end for end in self.memory.ended if end.goal not in numbers]
        self._forget_ids()

    def _forget_ids(self) -> None:
        """Forget the ids of goals that nobody remembers."""
        remembered = self._ends.keys() | {ended.goal for ended in self.memory.ended}
        self.memory.ids = {name: goals for name, goals in self.memory.ids.items() if goals[-1] in remembered}

    def _deactivate(self, number: int) -> bool:
        """Whether the goal was an active one until now."""
        before = self.memory.active
        self.memory.active = [goal for goal in before if goal.number != number]
        self.memory.clients.pop(number, None)
        return len(self.memory.active) < len(before)

    def end(self, ended: GoalResult) -> bool:
        """A goal has ended; False: it is none of the active ones."""
        if not self._deactivate(ended.goal):
            return False
        result = replace(ended, goal_id=self.id_of(ended.goal))
        insort(self.memory.ended, result, key=lambda end: end.goal)
        self._ends.pop(ended.goal).set_result(result)
        return True

    def note_arrival(self, data: ArrivalData) -> None:
        """What is thought now of a goal that was reached: ``get_goal`` tells it from now on."""
        self.memory.ended = [
            replace(end, arrival=data.arrival, off_m=data.off_m) if end.goal == data.goal else end
            for end in self.memory.ended
        ]

    def active_goals(self) -> GoalList:
        """Those that have not ended, in order."""
        return GoalList(
            tuple(
                ActiveGoal(goal.number, goal.x_m, goal.y_m, goal.heading_rad, self.id_of(goal.number))
                for goal in self.memory.active
            )
        )

    def set_client(self, number: int, client: int | None) -> None:
        """A goal that has not ended is to end with this client; None: with none."""
        self.memory.clients.pop(number, None)
        if client is not None and number in self._ends:
            self.memory.clients[number] = client

    def end_of(self, number: int) -> "asyncio.Future[GoalResult]":
        """What will have the goal's end; raises ``Refused`` for a goal that nobody remembers."""
        if (end := self._ends.get(number)) is not None:
            return end
        ended = self._ended(number)
        if ended is None:
            raise Refused(
                RefusalKind.UNKNOWN_GOAL,
                Sentence("navigation.unknown_goal", "no goal {number} is remembered", number=number),
            )
        end = asyncio.get_running_loop().create_future()
        end.set_result(ended)
        return end

    def _ended(self, number: int) -> GoalResult | None:
        return next((end for end in self.memory.ended if end.goal == number), None)

    def of_id(self, goal_id: str) -> tuple[int, ...]:
        """The goals of this id; none where it is not known, or was forgotten."""
        return self.memory.ids.get(goal_id, ())

    def id_of(self, number: int) -> str | None:
        """The id that a client chose for this goal."""
        return next((name for name, numbers in self.memory.ids.items() if number in numbers), None)

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
            raise Refused(
                msgspec.convert(refused["kind"], RefusalKind), sentence_of(refused["message"], refused)
            )
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
