"""The daemon's side of localization: which map the worker's skill is to use, and what it tells of the robot's pose."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Final, TypeAlias

import structlog
from msgspec import field

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.localization.models import (
    TOPICS,
    LocalizationData,
    LocalizeParams,
    SetPoseParams,
    localization_data,
)
from chefbotd.components.localization.skill_requests import (
    SKILL,
    Localize,
    SetPose,
    UseMap,
    UseNone,
)
from chefbotd.components.localization.turning import Turning, TurningState
from chefbotd.components.maps.events import MapLoaded, MappingChanged, MapUnloaded
from chefbotd.components.worker.requests import OnProgress
from chefbotd.components.worker.service import WorkerService
from chefbotd.core.commands import Refused
from chefbotd.core.events.robot import POSE_ENDED, MapPoseUpdated, WorkerReported
from chefbotd.core.record import MutableState, StatefulPart, replace
from chefbotd.core.sentence import Sentence
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.features.feature import Feature, Service, Waiting
from chefbotd.inputs import StatefulEvent, inputs_of
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.parameters import Role

log = structlog.get_logger(component="localization")

SHORT_S: Final = 20.0
"""For what is a moment's work in the worker, though it may be at something else."""

CheckMap: TypeAlias = Callable[[], Awaitable[str]]
"""Says why the map in use is of no use, or nothing."""

LONG_S: Final = 60.0
"""For each step of making a large map ready."""

AWAY: Final = ("restarting", "unavailable", "stopped")

TOLD_EVERY_S: Final = 1.0
"""How often the state is published while nothing of it changes."""


def why_not_ready(state: str, reason: str) -> Sentence:
    """Why there is no pose while there is no worker."""
    if not reason:
        return Sentence("worker.not_ready", "the worker is {state}", state=state)
    return Sentence("worker.not_ready_because", "the worker is {state}: {reason}", state=state, reason=reason)


async def _find_nothing_wrong() -> str:
    return ""


class LocalizationState(MutableState):
    """The map in use, what of it the skill knows and has to know, and what was last published of the pose.

    ``renamed_from`` is the name of the map by which the worker knows it. ``problem`` is why the map cannot be used, and
    ``why_no_map`` why none is in use, where one was. ``jumps_before`` are those by the workers before this one.
    ``may_turn``: the robot has neither turned nor found itself yet. ``waits`` are the requests that wait for the end of
    a turn, by their tasks. ``pose`` is the one in the map in use.
    """

    turning: TurningState
    may_turn: bool
    map: MapLoaded | None = None
    renamed_from: str | None = None
    is_mapping: bool = False
    was_unloaded: bool = False
    has_to_tell: bool = False
    has_told: bool = True
    problem: str = ""
    latest: LocalizationChanged | None = field(default=None, name="told")
    jumps_before: int = 0
    waits: tuple[str, ...] = ()
    pose: MapPoseUpdated | None = None
    why_no_map: str = ""


class LocalizationService(StatefulPart[LocalizationState]):
    """Keeps the skill at the map in use. While a map is being made, it rests: then SLAM tells the pose.

    ``check_map`` says what others find wrong with the map in use.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        worker_service: WorkerService,
        driver: InnerDriver | None = None,
        *,
        turns_at_start: bool = False,
    ) -> None:
        """``driver`` drives as the source navigation; ``turns_at_start``: it may turn before it was ever asked to."""
        self._bus, self._clock, self._worker_service, self._worker = (
            bus,
            clock,
            worker_service,
            worker_service.worker,
        )
        self._entries, self._turning = inputs_of(clock), Turning(bus, clock, driver, self._report_progress)
        self._has_to_tell, self._has_told = StatefulEvent(), StatefulEvent()
        self._has_told.set()
        self.memory = LocalizationState(self._turning.memory, may_turn=turns_at_start)
        self.parts = {
            "turning": self._turning,
            "has_to_tell": self._has_to_tell,
            "has_told": self._has_told,
        }
        self._reports: list[OnProgress] = []
        self.check_map: CheckMap = _find_nothing_wrong
        self._worker.add_listener(SKILL, LocalizationChanged, self._take_told)
        self._worker.add_listener(SKILL, MapPoseUpdated, self._take_pose)
        self._worker.add_on_ready(self._take_ready)
        bus.add_handler(self._take_map, MapLoaded)
        bus.add_handler(self._take_unloaded, MapUnloaded)
        bus.add_handler(self._take_mapping, MappingChanged)
        bus.add_handler(self._take_worker, WorkerReported)

    @method(role=Role.DRIVE, moves=False)
    async def set_pose(
        self, caller: Caller, params: SetPoseParams, progress: ProgressReporter
    ) -> LocalizationData:
        """Set the robot's approximate pose in the map in use; the next scans confirm it, or it searches."""
        return await self._ask_skill(SetPose(params.x_m, params.y_m, params.heading_rad), SHORT_S)

    @method(role=Role.DRIVE, moves=True)
    async def localize(
        self, caller: Caller, params: LocalizeParams, progress: ProgressReporter
    ) -> LocalizationData:
        """Search the whole map for the robot's pose; the robot does not move, unless ``turn`` allows one turn."""
        if not params.turn:
            return await self._ask_skill(Localize(), SHORT_S)
        stop_number = self._turning.require().stop_number
        await self._ask_skill(Localize(), SHORT_S)
        self._turning.begin(stop_number)
        return await self._turned(progress)

    async def _turned(self, progress: ProgressReporter) -> LocalizationData:
        """Wait for the end of the turn, which ends with whoever waits for it."""
        end, task = self._turning.begin(), self._entries.task
        self.memory.waits = tuple(sorted({*self.memory.waits, task}))
        self._reports.append(progress.report)
        try:
            why = await asyncio.shield(end)
        except asyncio.CancelledError:
            self._turning.end("the request was given up")
            raise
        finally:
            self.memory.waits = tuple(other for other in self.memory.waits if other != task)
            self._reports.remove(progress.report)
        return replace(localization_data(self.memory.latest), reason=why)

    def waiting(self) -> Waiting:
        """The requests that wait for the end of a turn, by their tasks."""
        return dict.fromkeys(self.memory.waits, self._turned)

    async def made_ready(self, report: OnProgress) -> str:
        """Wait until the worker uses the map in use, if there is one; why it cannot, empty where it can."""
        self._reports.append(report)
        try:
            await self._has_told.wait()
        finally:
            self._reports.remove(report)
        return self.memory.problem

    async def run(self) -> None:
        """Tell the skill which map to use: when that changes, and each time that a worker has become ready."""
        while True:
            await self._entries.at_rest(self._has_to_tell.wait())
            self._has_to_tell.clear()
            if self._worker.is_ready:
                await self._tell_map()
            if not self._has_to_tell.is_set():
                self._has_told.set()

    async def _tell_map(self) -> None:
        used, self.memory.problem = None if self.memory.is_mapping else self.memory.map, ""
        renamed_from, self.memory.renamed_from = self.memory.renamed_from, None
        try:
            if self.memory.was_unloaded:  # the next map may have its name and version
                self.memory.was_unloaded = False
                await self._ask_skill(UseNone(), LONG_S)
            request = UseNone() if used is None else UseMap(used.name, used.version, renamed_from)
            await self._ask_skill(request, LONG_S)
            if used is not None:
                self.memory.problem = await self.check_map()
        except Refused as problem:
            self.memory.problem = str(problem)
            log.error("localization has no map", reason=self.memory.problem)
            self._publish_unknown(self._clock.now_s(), self.memory.problem)

    def _report_progress(self, done: float, total: float, text: str) -> None:
        for report in self._reports:
            report(done, total, text)

    def note_goal(self, *, has_goal: bool) -> None:
        """Know whether the robot has a goal: then it does not turn."""
        self._turning.note_goal(has_goal=has_goal)

    async def _ask_skill(
        self, request: UseMap | UseNone | SetPose | Localize, deadline_s: float
    ) -> LocalizationData:
        answer = await self._worker.request(
            SKILL, request, LocalizationChanged, deadline_s=deadline_s, on_progress=self._report_progress
        )
        return localization_data(self._publish_state(answer))

    # what happens

    def _take_map(self, event: MapLoaded) -> None:
        """The worker knows the first name of a map that was renamed twice since its last request."""
        before, self.memory.map, self.memory.why_no_map = self.memory.map, event, ""
        is_told = self.memory.renamed_from is None or before is None or before.name != event.renamed_from
        if event.renamed_from is None or is_told:
            self.memory.renamed_from = event.renamed_from
        if event.renamed_from is None and before is not None and before.name != event.name:
            self._end_pose(
                event.stamp_s,
                Sentence(
                    "localization.other_map",
                    "the map {map} is loaded in place of {before}",
                    map=event.name,
                    before=before.name,
                ),
            )
        self._has_told.clear()
        self._has_to_tell.set()

    def _take_unloaded(self, event: MapUnloaded) -> None:
        self.memory.map, self.memory.was_unloaded, self.memory.why_no_map = None, True, event.reason
        self._end_pose(
            event.stamp_s,
            event.reason or Sentence("localization.map_deleted", "the map {map} was deleted", map=event.name),
        )
        self._has_to_tell.set()

    def _take_mapping(self, event: MappingChanged) -> None:
        is_mapping = event.state != "idle"
        if is_mapping is not self.memory.is_mapping:
            self.memory.is_mapping = is_mapping
            self._has_to_tell.set()

    def _take_worker(self, event: WorkerReported) -> None:
        """Nobody finds the way while there is no worker: what was known is old."""
        if event.state in AWAY and self.memory.latest is not None and self.memory.latest.state != "unknown":
            why = why_not_ready(str(event.state), event.reason)
            self._publish_unknown(event.stamp_s, why)

    def _take_told(self, event: LocalizationChanged) -> None:
        if self.memory.is_mapping:
            return
        if self.memory.map is None and not event.reason:
            event = replace(event, reason=self.memory.why_no_map)
        self._publish_state(event)

    def _take_pose(self, event: MapPoseUpdated) -> None:
        """A pose in a map that is no longer in use is void: the worker was still at it."""
        names = () if self.memory.map is None else (self.memory.map.name, self.memory.renamed_from)
        if not self.memory.is_mapping and (event.map is None or event.map in names):
            self.memory.pose = replace(
                self._worker_service.in_odom(event),
                map=None if self.memory.map is None else self.memory.map.name,
            )
            self._bus.publish(self.memory.pose)

    def _end_pose(self, stamp_s: float, reason: str) -> None:
        """The pose in the map before ends at once; where the robot is in another one is not known yet."""
        if self.memory.pose is not None:
            self._bus.publish(replace(self.memory.pose, stamp_s=stamp_s, state=POSE_ENDED))
            self.memory.pose = None
        if self.memory.latest is not None and self.memory.latest.state != "unknown":
            self._publish_unknown(stamp_s, reason)

    def _take_ready(self) -> None:
        """A new worker counts its jumps from 0 on."""
        self.memory.jumps_before = self._jumps
        self._has_to_tell.set()

    @property
    def _jumps(self) -> int:
        return 0 if self.memory.latest is None else self.memory.latest.jumps

    def _publish_unknown(self, stamp_s: float, reason: str) -> None:
        jumps = self._jumps - self.memory.jumps_before
        self._publish_state(LocalizationChanged(stamp_s, "unknown", None, 0.0, (), 0.0, jumps, reason))

    def _publish_state(self, event: LocalizationChanged) -> LocalizationChanged:
        """Publish the state if it has changed, or was published a while ago; ``jumps`` are those of this worker."""
        last, now = self.memory.latest, replace(event, jumps=self.memory.jumps_before + event.jumps)
        if last is not None:
            same = (last.state, last.map, last.jumps, last.reason) == (
                now.state,
                now.map,
                now.jumps,
                now.reason,
            )
            same = same and len(last.alternatives) == len(now.alternatives)
            if same and now.stamp_s - last.stamp_s < TOLD_EVERY_S:
                return now
        self.memory.latest = now
        self._bus.publish(now)
        self._turn_or_not(now)
        return now

    def _turn_or_not(self, now: LocalizationChanged) -> None:
        """A turn ends when the robot knows where it is; one that never did turns by itself, where it may."""
        if now.state == "localized":
            self.memory.may_turn = False
            self._turning.end("it knows where it is")
        elif self.memory.may_turn and now.map is not None and now.state in ("searching", "lost"):
            self.memory.may_turn = False
            if self._turning.memory.was_stopped:
                log.info("the robot does not turn to find itself: it was stopped meanwhile; ask for a turn")
                return
            try:
                self._turning.begin()
            except Refused as refusal:
                log.info("the robot does not turn to find itself", reason=str(refusal))


def localization(service: LocalizationService) -> Feature:
    """Localization in the worker, over the service that asks it."""
    return Feature(
        "localization",
        services=(Service("localization", service.run, in_steps=True),),
        methods=methods_of(service),
        topics=TOPICS,
        parts={"localization": service},
        waiting=service.waiting,
        offers=service,
    )
