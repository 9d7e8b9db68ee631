"""The daemon's side of navigation: goals to the worker's skill, and its wishes through the gate.

Which goals there are is decided here. When somebody ends one, that is told at once: a worker that hangs or dies neither
delays it nor takes it back. Goals that are left outlive the worker; the next one is told of them.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from types import NoneType
from typing import Final

import structlog
from msgspec import field
from msgspec.structs import asdict, astuple

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.maps.events import MapLoaded
from chefbotd.components.navigation import skill_requests as messages
from chefbotd.components.navigation.algorithms.arrival import ArrivalData
from chefbotd.components.navigation.algorithms.states import cancelled, cancelled_before, failed
from chefbotd.components.navigation.events import (
    ArrivalChanged,
    GoalCause,
    GoalList,
    GoalReport,
    GoalResult,
    PathChanged,
    PlanResult,
)
from chefbotd.components.navigation.goals import Destinations, Goals, GoalsState, Places
from chefbotd.components.navigation.handover import AWAY, Handover, HandoverState
from chefbotd.components.navigation.models import GoalParams, Waypoint
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.components.navigation.reporting import Reporting, ReportingState
from chefbotd.components.navigation.requests import (
    NOTHING_SHOWN,
    RequestQueue,
    RequestQueueState,
    ShownOnDemand,
)
from chefbotd.components.navigation.skill_requests import SKILL, NavigationRequest
from chefbotd.components.navigation.waiting_requests import Wait, WaitingRequests
from chefbotd.components.worker.service import WorkerService
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import ClientDisconnected, SafetyChanged
from chefbotd.core.events.robot import WorkerReported
from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import StatefulPart, replace
from chefbotd.core.sentence import Sentence, sentence_data
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.inputs import inputs_of
from chefbotd.rpc.method import Unserved
from chefbotd.rpc.session import Session
from chefbotd.safety.gate import not_armed, why_not_armed

log = structlog.get_logger(component="navigation")

SHORT_S: Final = 20.0
"""For what is a moment's work in the worker, though it may be at something else."""

ARMED: Final = "armed"
REPLACED: Final = cancelled(Sentence("navigation.replaced", "a new goal replaced it"))
NO_REQUEST: Final = Sentence("navigation.no_request", "the request that waited for it was cancelled")


class NavigationState(HandoverState):
    """The goals, what the worker has to be told of them, and what holds them up.

    ``waits`` are the requests that wait, by their tasks. ``stops`` is the number of stops that the goals know of.
    The goals are on ``map``; localization uses ``known_map``, or says why it uses none. ``paused`` says why the goals
    are paused, where somebody asked for that.
    """

    goals: GoalsState = field(default_factory=GoalsState)
    waits: dict[str, Wait] = {}
    orders: RequestQueueState = field(default_factory=RequestQueueState)
    reporting: ReportingState = field(default_factory=ReportingState)
    drives: bool = False
    shown: messages.Show = NOTHING_SHOWN
    stops: int = 0
    map: str | None = None
    known_map: str | None = None
    safety: SafetyChanged | None = None
    paused: str = ""
    is_taken_over: bool = False
    why_no_map: str = ""


class NavigationService(StatefulPart[NavigationState]):
    """``driver`` puts wishes through the gate. Somebody who takes over pauses the goals."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        worker_service: WorkerService,
        driver: InnerDriver,
        places: Places,
        section: NavigationSection,
    ) -> None:
        self._bus, self._clock, self._worker, self._driver = bus, clock, worker_service.worker, driver
        self.section, self._entries = section, inputs_of(clock)
        self._destinations = Destinations(places, self._entries)
        self._requests, self._goals = RequestQueue(), Goals()
        self._reporting = Reporting(bus, clock)
        self.waits = WaitingRequests(self._entries, self._goals, self._reporting, self._end_given_up)
        self.shown = ShownOnDemand(bus, worker_service.worker)
        self.memory = NavigationState(stops=driver.stops)
        self._handover = Handover(self._entries, self.memory, self._end_worker_lost)
        self.parts = {
            "goals": self._goals,
            "waits": self.waits,
            "orders": self._requests,
            "reporting": self._reporting,
            "drives": driver,
            "shown": self.shown,
            "due_s": self._handover.timer,
        }
        self._worker.add_listener(SKILL, messages.Stepped, self._take_stepped)
        bus.add_handler(self._take_safety, SafetyChanged)
        bus.add_handler(self._take_worker, WorkerReported)
        bus.add_handler(self._take_localization, LocalizationChanged)
        bus.add_handler(self._take_map, MapLoaded)
        bus.add_handler(self._take_client_left, ClientDisconnected)

    async def run(self) -> None:
        """Tell the skill what was ordered, one thing after the other."""
        while True:
            order = await self._entries.at_rest(self._requests.next())
            try:
                await self._ask(order)
            except Refused as problem:
                log.warning(
                    "the worker cannot carry out an order for navigation",
                    order=type(order).__name__,
                    reason=str(problem),
                )
                if not isinstance(order, messages.NavigateTo) or not self._goals.active:
                    continue
                if problem.kind is RefusalKind.WORKER_UNAVAILABLE:  # the next one is told
                    self.memory.must_tell_goals = True
                else:
                    self._end_goals("fault", str(problem), GoalCause.REFUSED)

    async def _ask(self, request: NavigationRequest) -> None:
        with self._saying_why_no_map():
            await self._worker.request(SKILL, request, NoneType, deadline_s=SHORT_S)

    @contextmanager
    def _saying_why_no_map(self) -> Iterator[None]:
        """Where the worker has no map, its refusal says what became of the one that was in use."""
        try:
            yield
        except Refused as refused:
            if refused.kind is not RefusalKind.NO_MAP_LOADED or not self.memory.why_no_map:
                raise
            raise Refused(
                refused.kind,
                Sentence(
                    "navigation.no_map_because",
                    "{refusal} ({why})",
                    refusal=refused,
                    why=self.memory.why_no_map,
                ),
            ) from refused

    # what is asked

    async def navigate_to(
        self, waypoints: list[Waypoint], params: GoalParams, session: Session
    ) -> Sequence[int]:
        """Accept goals; their numbers. Queued behind a paused one, they wait with it.

        Goals of an id that is known are those of then: nothing begins, and they are this client's from now on.
        """
        numbers: Sequence[int] = () if params.goal_id is None else self._goals.of_id(params.goal_id)
        begins, stop_number = not numbers, self._driver.stop_number
        if begins:
            self._require_armed()
            self._end_if_stopped()
            numbers = self._goals.reserve(len(waypoints), params.goal_id)
        for number in numbers:
            self._goals.set_client(number, session.number if params.ends_with_client else None)
        if begins:
            await self._accept(numbers, waypoints, params, session, stop_number)
        return numbers

    async def _accept(
        self,
        numbers: Sequence[int],
        waypoints: list[Waypoint],
        params: GoalParams,
        session: Session,
        stop_number: int,
    ) -> None:
        is_told = False
        try:
            await self._requests.all_sent()  # or a cancel that waits for a busy worker would end these goals
            goals = await self._destinations.goals(numbers, waypoints)
            self._goals.require_room(len(goals))
            self._driver.begin(stop_number, "this goal was sent")
            self._goals.add(goals)
            is_told = True
            await self._ask(messages.NavigateTo(tuple(goals), params.queue))
        except BaseException:
            self._goals.forget(numbers)
            if is_told:
                self._tell_which_are_left()
            raise
        self._accepted(numbers, str(session), queue=params.queue)

    def _require_armed(self) -> None:
        safety = self.memory.safety
        if safety is not None and safety.mode != ARMED:
            raise not_armed(safety.mode, safety.reason)

    def _accepted(self, numbers: Sequence[int], by: str, *, queue: bool) -> None:
        self.memory.map = self.memory.known_map
        self._handover.forget_losses()
        before = [number for number in self._goals.active if number < numbers[0]]
        if not queue:
            for number in reversed(before):
                self._end(GoalResult(number, "cancelled", REPLACED, GoalCause.REPLACED, by))
        if not queue or not before:
            self.memory.paused = ""
            if self.memory.is_taken_over:
                self._requests.put(_pause(self._why_taken_over()))

    def result(self, goals: Sequence[int]) -> GoalResult:
        """How these have ended, if they have."""
        return self._goals.result(goals)

    def active_goals(self) -> GoalList:
        """The goals that have not ended."""
        return self._goals.active_goals()

    def report(self, number: int | None, goal_id: str | None) -> GoalReport:
        """What became of a goal, or of those of an id; raises ``Refused`` where nobody remembers it."""
        numbers = (number or 0,) if goal_id is None else self._goals.of_id(goal_id)
        if not numbers:
            raise Refused(
                RefusalKind.UNKNOWN_GOAL,
                Sentence(
                    "navigation.unknown_goal_id",
                    "no goal with the id {goal_id!a} is remembered",
                    goal_id=goal_id,
                ),
            )
        result = self._goals.result(numbers)
        left = [number for number in numbers if number in self._goals.active]
        state = "ended" if result.end else self._reporting.state_of(left[0]) if left else "accepting"
        goal_id = goal_id or self._goals.id_of(numbers[-1])
        return GoalReport(**asdict(replace(result, goal_id=goal_id)), state=state)

    async def plan_to(self, waypoint: Waypoint) -> PlanResult:
        """What would be driven."""
        (goal,) = await self._destinations.goals([0], [waypoint])
        request = messages.PlanTo(goal)
        with self._saying_why_no_map():
            return await self._worker.request(SKILL, request, PlanResult, deadline_s=SHORT_S)

    def cancel(self, reason: str, cause: GoalCause, by: str = "") -> None:
        """End all goals; the robot comes to rest at once, whatever the worker is at."""
        self._driver.let_go()
        self._end_goals("cancelled", reason, cause, by)

    def pause(self, by: str) -> None:
        """Stand until ``resume``; without a goal nothing happens."""
        self._driver.let_go()
        if self._goals.active:
            self.memory.paused = Sentence("navigation.paused_by", "paused by {by}", by=by)
            self._requests.put(_pause(self.memory.paused))

    def resume(self) -> None:
        """Go on, as soon as nobody else drives."""
        self._end_if_stopped()
        self.memory.paused = ""
        self._driver.begin(self._driver.stop_number, Sentence("navigation.asked_for", "this was asked for"))
        if not self.memory.is_taken_over:
            self._requests.put(messages.Resume())

    def _end_if_stopped(self) -> None:
        """A stop ends the goals also while nothing is wished: the robot waits, plans, is paused, or has no worker."""
        if self._driver.stops != self.memory.stops:
            self.memory.stops = self._driver.stops
            by = self._driver.stopped_by or "somebody"
            self.cancel(
                source_stopped(self._driver.source, by),
                GoalCause.STOPPED,
                by,
            )

    # what the worker tells

    def _take_stepped(self, stepped: messages.Stepped) -> None:
        self._end_if_stopped()
        has_failed = any(ended.end not in ("reached", "cancelled") for ended in stepped.ended)
        follows = GoalCause.EARLIER_GOAL if has_failed else GoalCause.REPLACED
        for ended in reversed(stepped.ended):  # the one that has ended the others is reported last, and stays
            self._end(replace(ended, cause=follows) if ended.end == "cancelled" else ended)
        if stepped.arrival is not None:
            self._revise_arrival(stepped.arrival, stepped.stamp_s)
        if stepped.path is not None:
            self._bus.publish(PathChanged(*astuple(stepped.path), stamp_s=stepped.stamp_s))
        data = stepped.now
        is_active = data.goal in self._goals.active
        if is_active or data.goal is None:
            self._reporting.report(data.state, data.goal, data.reason, data.distance_m, data.time_s)
        if stepped.twist is None or self.memory.paused or not is_active:
            self._driver.let_go()
        else:
            self._drive(stepped.twist, stepped.stamp_s)

    def _revise_arrival(self, data: ArrivalData, stamp_s: float) -> None:
        """A goal that was reached may not have been, since the pose was wrong: say so to whoever listens or asks."""
        log.warning("arrival", goal=data.goal, arrival=str(data.arrival), reason=data.reason)
        self._goals.note_arrival(data)
        self._reporting.revise(data.goal, data.reason)
        self._bus.publish(ArrivalChanged(*astuple(data), stamp_s=stamp_s))

    def _drive(self, twist: Twist2D, wished_s: float) -> None:
        try:
            self._driver.drive(twist, wished_s)
        except Unserved as held:
            self.cancel(held.words, GoalCause.CONTROL_LOST, str(held.details.get("holder", "")))
        except Refused as refusal:
            is_stopped = refusal.kind is RefusalKind.STOPPED
            end, cause = ("cancelled", GoalCause.STOPPED) if is_stopped else ("fault", GoalCause.REFUSED)
            self._driver.let_go()
            by = self._driver.stopped_by if is_stopped else ""
            self._end_goals(end, _why_refused(refusal), cause, by)

    # what happens

    def _take_safety(self, event: SafetyChanged) -> None:
        self.memory.safety = event
        if event.mode == ARMED:
            self._end_if_stopped()
        elif self._goals.active:
            self._driver.let_go()
            self._end_goals("fault", why_not_armed(event.mode, event.reason), GoalCause.NOT_ARMED)
        is_taken_over = self._driver.gives_way_to(event.source)
        if is_taken_over is not self.memory.is_taken_over:
            self.memory.is_taken_over = is_taken_over
            self._give_way_or_go_on()

    def _give_way_or_go_on(self) -> None:
        if not self._goals.active:
            return
        if self.memory.is_taken_over:
            why = self._why_taken_over()
            if not self.section.resume_after_takeover:
                self.memory.paused = self.memory.paused or why
            self._requests.put(_pause(why))
        else:
            self._requests.put(_pause(self.memory.paused) if self.memory.paused else messages.Resume())

    def _why_taken_over(self) -> str:
        source = None if self.memory.safety is None else self.memory.safety.source
        driver = source or Sentence("navigation.another_source", "another source")
        if self.section.resume_after_takeover:
            return Sentence("navigation.taken_over", "paused, because {source} has control", source=driver)
        return Sentence(
            "navigation.taken_over_until",
            "paused, because {source} has control; it goes on when somebody resumes it",
            source=driver,
        )

    def _take_worker(self, event: WorkerReported) -> None:
        if event.state not in AWAY or not self._goals.active:
            return
        self._driver.let_go()
        was_told = not self.memory.must_tell_goals
        if not self._handover.wait(event):
            return
        if was_told:
            self._bus.publish(PathChanged(stamp_s=self._clock.now_s()))
        why = Sentence(
            "navigation.waits_for_worker", "waits until its worker is back: {why}", why=event.reason
        )
        self._reporting.report("paused", next(iter(self._goals.active)), why)

    def _end_worker_lost(self, why: str) -> None:
        self._end_goals("fault", why, GoalCause.WORKER_LOST)

    def _take_map(self, event: MapLoaded) -> None:
        """Goals on a map that gets another name are on the same map."""
        if event.renamed_from is not None and event.renamed_from == self.memory.map:
            self.memory.map = event.name

    def _take_localization(self, event: LocalizationChanged) -> None:
        """A worker that is back has its map, or has none any more: tell it of the goals that are left."""
        self.memory.known_map, self.memory.why_no_map = event.map, "" if event.map else event.reason
        self._end_if_stopped()
        if not self.memory.must_tell_goals or not self._worker.is_ready:
            return
        self._handover.wait_no_more()
        if event.map != self.memory.map:
            why = Sentence(
                "navigation.other_map",
                "the goals are on the map {map!a}, which is no longer in use",
                map=self.memory.map or "",
            )
            if event.reason:
                why = Sentence("navigation.because", "{what}: {why}", what=why, why=event.reason)
            self._end_goals("fault", why, GoalCause.MAP_CHANGED)
            return
        self._requests.put(messages.NavigateTo(tuple(self._goals.active.values()), queue=False))
        if self.memory.paused or self.memory.is_taken_over:
            self._requests.put(_pause(self.memory.paused or self._why_taken_over()))

    # how goals end

    def _take_client_left(self, event: ClientDisconnected) -> None:
        """The goals end that are to end with this client."""
        goals = list(self._goals.active)
        self._end_those_of(
            event.client,
            goals,
            Sentence("navigation.client_left", "its client has left"),
            GoalCause.CLIENT_LEFT,
        )

    def _end_given_up(self, client: int, goals: Sequence[int]) -> None:
        """The goals end whose request was cancelled."""
        self._end_those_of(client, goals, NO_REQUEST, GoalCause.REQUEST_CANCELLED)

    def _end_those_of(self, client: int, goals: Iterable[int], why: str, cause: GoalCause) -> None:
        """Of these goals, the first that ends with a client ends, with those that were to follow."""
        of_client = [number for number in goals if self._goals.clients.get(number) == client]
        if of_client:
            self._end_goals("cancelled", why, cause, first=of_client[0])

    def _end_goals(
        self, end: str, why: str, cause: GoalCause, by: str = "", first: int | None = None
    ) -> None:
        """All goals end, or those from ``first`` on: the first of them so, and those that were to follow with it."""
        active = list(self._goals.active)
        ending = active if first is None else active[active.index(first) :]
        if not ending:
            return
        follows = cancelled(why) if end == "cancelled" else cancelled_before(ending[0], end)
        for number in reversed(ending[1:]):
            self._end(GoalResult(number, "cancelled", follows, GoalCause.EARLIER_GOAL, by))
        self._end(
            GoalResult(ending[0], end, cancelled(why) if end == "cancelled" else failed(why), cause, by)
        )
        self._tell_which_are_left()

    def _tell_which_are_left(self) -> None:
        left = tuple(self._goals.active)
        if not left:
            self._driver.let_go()
            self._handover.wait_no_more()
            self.memory.paused = ""
        if self._worker.is_ready:
            self._requests.put(messages.KeepGoals(left))

    def _end(self, ended: GoalResult) -> None:
        if self._goals.end(ended):
            self._handover.forget_losses()
            log.info("goal ended", goal=ended.goal, end=ended.end, reason=ended.reason)
            self._reporting.report(ended.end or "", ended.goal, ended.reason, cause=ended.cause)


def _pause(why: str) -> messages.Pause:
    data = sentence_data(why)
    return messages.Pause(why, json.dumps(data) if data else "")


def _why_refused(refusal: Refused) -> str:
    """Without what to do about it: of a stop only who has stopped the source."""
    words = refusal.words
    if isinstance(words, Sentence) and words.sentence_id == "driving.stopped_by":
        source, by = words.arguments["source"], words.arguments["stopped_by"]
        return source_stopped(str(source), str(by))
    return words


def source_stopped(source: str, by: str) -> Sentence:
    """Why a goal ends that somebody has stopped."""
    return Sentence("navigation.source_stopped", "{source} was stopped by {by}", source=source, by=by)
