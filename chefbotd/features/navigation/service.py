"""The daemon's side of navigation: goals to the worker's skill, and its wishes through the gate.

A goal outlives the worker: the next one is told of it. What the robot is driven by meanwhile is the gate's matter alone.
"""

import asyncio
import json
from typing import Final, Protocol

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import SafetyChanged
from chefbotd.core.events.localization import LocalizationChanged
from chefbotd.core.events.navigation import CostmapChanged, NavigationChanged, ObstaclesSeen, PathChanged
from chefbotd.core.events.worker import WorkerReported
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.entries import entries_of
from chefbotd.features.driving.inner_driver import InnerDriver
from chefbotd.features.maps.methods import PlaceList
from chefbotd.features.navigation.goals import Goals
from chefbotd.features.navigation.methods import GoalResult, PlanResult, Waypoint
from chefbotd.features.navigation.orders import Orders
from chefbotd.features.worker.service import WorkerService
from chefbotd.navigation.section import NavigationSection
from chefbotd.rpc.jobs import Progress
from chefbotd.rpc.method import Unserved
from chefbotd.worker.skills import navigation_messages as messages
from chefbotd.worker.skills.navigation_messages import SKILL, GoalAsked, GoalEnded, NavigationRequest

log = structlog.get_logger(component="navigation")

SHORT_S: Final = 20.0
"""For what is a moment's work in the worker, though it may be at something else."""

TOLD_EVERY_S: Final = 0.5
ARMED: Final = "armed"
AWAY: Final = ("restarting", "unavailable", "stopped")


class Places(Protocol):
    """Who knows the named places."""

    async def places(self, of_map: str | None) -> PlaceList:
        """Those of a map; without one, of the map in use."""
        ...


class NavigationService:
    """``driver`` puts wishes through the gate. Somebody who takes over pauses the goals."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        feed: WorkerService,
        driver: InnerDriver,
        places: Places,
        section: NavigationSection,
    ) -> None:
        self._bus, self._clock, self._worker, self._driver = bus, clock, feed.worker, driver
        self._places, self.section, self._entries = places, section, entries_of(clock)
        self._orders = Orders()
        self._goals = Goals()
        self._stops = driver.stops  # that the goals know of
        self._map: str | None = None  # in which the goals are
        self._known_map: str | None = None  # that localization uses
        self._safety: SafetyChanged | None = None
        self._is_muted = self._is_taken_over = self._is_paused = self._must_tell_goals = False
        self._told: NavigationChanged | None = None
        self._progress: list[Progress] = []
        self._shows = messages.Show(costmap=False, obstacles=False)
        self._worker.add_listener(SKILL, self._take_told)
        self._worker.add_on_ready(self._tell_shown)
        bus.add_handler(self._take_safety, SafetyChanged)
        bus.add_handler(self._take_worker, WorkerReported)
        bus.add_handler(self._take_localization, LocalizationChanged)

    async def run(self) -> None:
        """Tell the skill what was ordered, one thing after the other."""
        while True:
            order = await self._orders.next()
            try:
                await self._ask(order)
            except Refused as problem:
                log.warning("navigation is not told", order=type(order).__name__, reason=str(problem))
                if isinstance(order, messages.NavigateTo):
                    self._end_all("fault", f"fault: {problem}")

    async def _ask(self, request: NavigationRequest) -> bytes:
        return await self._worker.request(SKILL, request, deadline_s=SHORT_S)

    # what is asked

    async def navigate_to(self, waypoints: list[Waypoint], *, queue: bool) -> list[int]:
        """Accept goals; their numbers."""
        self._require_armed()
        self._end_if_stopped()
        stops = self._stops
        await self._orders.all_told()  # or a cancel that waits for a busy worker would end these goals
        goals = [await self._goal(each) for each in waypoints]
        self._goals.require_room(len(goals))
        if self._driver.stops != stops:
            raise Refused(
                RefusalKind.STOPPED, "the robot was stopped after this goal was asked for; ask again"
            )
        request = messages.NavigateTo(tuple(goals), queue)
        self._goals.add(goals)
        self._driver.begin()
        self._is_muted = self._is_paused = False
        try:
            await self._ask(request)
        except BaseException:
            self._goals.forget([goal.number for goal in goals])
            raise
        self._map = self._known_map
        return [goal.number for goal in goals]

    def _require_armed(self) -> None:
        safety = self._safety
        if safety is not None and safety.mode != ARMED:
            kind = RefusalKind.ESTOPPED if safety.mode == "estopped" else RefusalKind.DISARMED
            raise Refused(kind, f"the robot is {safety.mode} ({safety.reason}); 'arm' comes first")

    async def _goal(self, waypoint: Waypoint) -> GoalAsked:
        x_m, y_m, heading_rad = waypoint.x_m, waypoint.y_m, waypoint.heading_rad
        if waypoint.place is not None:
            known = await self._known_places()
            place = next((each for each in known.places if each.name == waypoint.place), None)
            if place is None:
                names = ", ".join(each.name for each in known.places) or "none"
                told = f"the map {known.map!a} has no place {waypoint.place!a}; there are: {names}"
                raise Refused(RefusalKind.UNKNOWN_PLACE, told)
            x_m, y_m, heading_rad = place.x_m, place.y_m, place.heading_rad
        return GoalAsked(self._goals.next_number(), x_m or 0.0, y_m or 0.0, heading_rad, waypoint.tolerance_m)

    async def _known_places(self) -> PlaceList:
        """Those of the map in use; where the disk has no answer, why not."""

        async def ask() -> str:
            try:
                return (await self._places.places(None)).model_dump_json()
            except Refused as problem:
                return json.dumps({"kind": problem.kind, "message": str(problem)})

        answer = await self._entries.answer("places", ask)
        refused = json.loads(answer)
        if "kind" in refused:
            raise Refused(RefusalKind(refused["kind"]), refused["message"])
        return PlaceList.model_validate_json(answer)

    async def wait(self, goals: list[int], progress: Progress) -> GoalResult:
        """Wait for the end of these; that of the first that is not reached, or of the last."""
        ends = [self._goals.end_of(number) for number in goals]
        self._progress.append(progress)
        try:
            for end in ends:
                ended = await asyncio.shield(end)
                if ended.end != "reached":
                    break
        except asyncio.CancelledError:
            if any(number in self._goals.active for number in goals):
                self.cancel("the request that waited for it was given up")
            raise
        finally:
            self._progress.remove(progress)
        return GoalResult(goal=ended.number, end=ended.end, reason=ended.reason)

    async def plan_to(self, waypoint: Waypoint) -> PlanResult:
        """What would be driven."""
        answer = await self._ask(messages.PlanTo(await self._goal(waypoint)))
        told = messages.PLANNED.decode(answer)
        x_m, y_m, heading_rad = told.nearest or (None, None, None)
        return PlanResult(
            possible=told.possible,
            reason=told.reason,
            length_m=told.length_m if told.possible else None,
            time_s=told.time_s if told.possible else None,
            x_m=told.x_m,
            y_m=told.y_m,
            nearest_x_m=x_m,
            nearest_y_m=y_m,
            nearest_heading_rad=heading_rad,
        )

    def cancel(self, reason: str) -> None:
        """End all goals; the robot comes to rest at once, whatever the worker is at."""
        self._stand_still()
        if not self._goals.active:
            return
        if self._worker.is_ready and not self._must_tell_goals:
            self._orders.put(messages.CancelGoals(reason))
        else:
            self._end_all("cancelled", f"cancelled: {reason}")

    def pause(self) -> None:
        """Stand until ``resume``."""
        self._is_paused = True
        self._stand_still()
        self._orders.put(messages.Pause())

    def resume(self) -> None:
        """Go on."""
        self._end_if_stopped()
        self._is_paused = self._is_muted = False
        self._driver.begin()
        self._orders.put(messages.Resume())

    def _end_if_stopped(self) -> None:
        """A stop ends the goals also while nothing is wished: the robot waits, plans, is paused, or has no worker."""
        if self._driver.stops != self._stops:
            self._stops = self._driver.stops
            self.cancel(f"{self._driver.source} was stopped by {self._driver.stopped_by or 'somebody'}")

    def _stand_still(self) -> None:
        self._is_muted = True
        self._driver.let_go()

    # what people look at

    def show_costmap(self, wanted: bool) -> None:
        """Somebody looks at the costs, or nobody does any more."""
        self._shows = messages.Show(wanted, self._shows.obstacles)
        self._tell_shown()

    def show_obstacles(self, wanted: bool) -> None:
        """The same for the obstacles."""
        self._shows = messages.Show(self._shows.costmap, wanted)
        self._tell_shown()

    def _tell_shown(self) -> None:
        self._worker.tell(SKILL, self._shows)

    # what happens

    def _take_told(self, body: bytes) -> None:
        """Raises ``msgspec.DecodeError`` for what the skill does not say."""
        told = messages.TOLD.decode(body)
        match told:
            case messages.Stepped():
                self._take_stepped(told)
            case messages.CostsShown():
                self._bus.publish(_costmap_changed(told))
            case messages.ObstaclesShown():
                self._bus.publish(ObstaclesSeen(told.stamp_s, told.x_m, told.y_m, told.omitted, told.movers))

    def _take_stepped(self, told: messages.Stepped) -> None:
        self._end_if_stopped()
        for ended in told.ended:
            self._end(ended)
        if told.path is not None:
            self._bus.publish(PathChanged(told.stamp_s, *told.path))
        self._publish(told.state, told.goal, told.reason, told.distance_m, told.time_s)
        if told.twist is None or self._is_muted or not self._goals.active:
            self._driver.let_go()
        else:
            self._drive(Twist2D(*told.twist), told.stamp_s)

    def _drive(self, twist: Twist2D, wished_s: float) -> None:
        try:
            self._driver.drive(twist, wished_s)
        except Unserved as held:
            self._stand_still()
            self._orders.put(messages.CancelGoals(str(held)))
        except Refused as refusal:
            self._stand_still()
            was_stopped = refusal.kind is RefusalKind.STOPPED
            fails = messages.CancelGoals if was_stopped else messages.FailGoals
            self._orders.put(fails(str(refusal).partition(": do not")[0]))

    def _take_safety(self, event: SafetyChanged) -> None:
        self._safety = event
        if event.mode == ARMED:
            self._end_if_stopped()
        if not self._goals.active:
            self._is_taken_over = False
        elif event.mode != ARMED:
            self._stand_still()
            self._orders.put(messages.FailGoals(f"the robot is {event.mode}: {event.reason}"))
        elif event.source not in (None, self._driver.source):
            if not self._is_taken_over:
                self._is_taken_over = True
                self._orders.put(messages.Pause())
        elif self._is_taken_over:
            self._is_taken_over = False
            if self.section.resume_after_takeover and not self._is_paused:
                self._orders.put(messages.Resume())

    def _take_worker(self, event: WorkerReported) -> None:
        if event.state not in AWAY or not self._goals.active:
            return
        self._driver.let_go()
        if event.state == "unavailable":
            self._end_all("fault", f"fault: the worker cannot work here: {event.reason}")
        elif not self._must_tell_goals:
            self._must_tell_goals = True
            why = f"stands until its worker is back: {event.reason}"
            self._publish("paused", next(iter(self._goals.active)), why, None, None)

    def _take_localization(self, event: LocalizationChanged) -> None:
        """A worker that is back has its map: tell it of the goals that are left."""
        self._known_map = event.map
        self._end_if_stopped()
        if not self._must_tell_goals or event.map is None or not self._worker.is_ready:
            return
        self._must_tell_goals = False
        if event.map != self._map:
            self._end_all(
                "fault", f"fault: the goals are on the map {self._map!a}, which is not in use any more"
            )
            return
        self._orders.put(messages.NavigateTo(tuple(self._goals.active.values()), queue=False))
        if self._is_paused or self._is_taken_over:
            self._orders.put(messages.Pause())

    def _end_all(self, end: str, reason: str) -> None:
        self._must_tell_goals = False
        self._driver.let_go()
        for number in list(self._goals.active):
            self._end(GoalEnded(number, end, reason))

    def _end(self, ended: GoalEnded) -> None:
        if self._goals.end(ended):
            log.info("goal ended", goal=ended.number, end=ended.end, reason=ended.reason)
            self._publish(ended.end, ended.number, ended.reason, None, None)

    def _publish(
        self, state: str, goal: int | None, reason: str, distance_m: float | None, time_s: float | None
    ) -> None:
        """Tell what is new, and how far it is now and then; an end stays until the next goal."""
        last, now_s = self._told, self._clock.now_s()
        if state == "idle" and last is not None:
            return
        is_same = last is not None and (last.state, last.goal, last.reason) == (state, goal, reason)
        if last is not None and is_same and now_s - last.stamp_s < TOLD_EVERY_S:
            return
        self._told = now = NavigationChanged(now_s, state, goal, reason, distance_m, time_s)
        self._bus.publish(now)
        for progress in self._progress:
            progress.report(0.0, distance_m or 0.0, reason)


def _costmap_changed(part: messages.CostsShown) -> CostmapChanged:
    return CostmapChanged(
        part.stamp_s,
        part.map,
        part.revision,
        part.resolution_m,
        Pose2D(*part.origin),
        part.columns,
        part.rows,
        part.column,
        part.row,
        part.part_columns,
        part.part_rows,
        part.cells,
    )
