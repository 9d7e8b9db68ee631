"""The daemon's side of localization: which map the worker's skill is to use, and what it tells of the robot's pose."""

import asyncio
from typing import Final

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.mapping import (
    Alternative,
    LocalizationChanged,
    MapLoaded,
    MappingChanged,
    MapPoseUpdated,
    MapUnloaded,
)
from chefbotd.core.events.worker import WorkerReported
from chefbotd.core.geometry import Pose2D, PoseCovariance
from chefbotd.entries import entries_of
from chefbotd.features.driving.inner_driver import InnerDriver
from chefbotd.features.feature import Waiting
from chefbotd.features.localization.methods import LocalizationResult
from chefbotd.features.localization.turning import Turning
from chefbotd.features.worker.service import WorkerService
from chefbotd.rpc.jobs import Progress
from chefbotd.worker.requests import OnProgress
from chefbotd.worker.skills import navigation_messages as navigation
from chefbotd.worker.skills.localization_messages import (
    LOCATED,
    SKILL,
    Localize,
    Located,
    SetPose,
    UseMap,
    UseNone,
)
from chefbotd.worker.skills.navigation_messages import CheckMap

log = structlog.get_logger(component="localization")

SHORT_S: Final = 20.0
"""For what is a moment's work in the worker, though it may be at something else."""

LONG_S: Final = 60.0
"""For each step of making a large map ready."""

AWAY: Final = ("restarting", "unavailable", "stopped")

TOLD_EVERY_S: Final = 1.0
"""How often the state is told while nothing of it changes."""


class LocalizationService:
    """Keeps the skill at the map in use. While a map is being made, it rests: then SLAM tells the pose."""

    UNRECORDED = frozenset({"_reports"})

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        feed: WorkerService,
        driver: InnerDriver | None = None,
        *,
        turns_at_start: bool = False,
    ) -> None:
        """``driver`` drives as the source navigation; ``turns_at_start``: it may turn before it was ever asked to."""
        self._bus, self._clock, self._feed, self._worker = bus, clock, feed, feed.worker
        self._map: MapLoaded | None = None
        self._is_mapping = self._was_unloaded = False
        self._has_to_tell, self._has_told = asyncio.Event(), asyncio.Event()
        self._has_told.set()
        self._reports: list[OnProgress] = []
        self._problem = ""  # why the map cannot be used
        self._told: LocalizationChanged | None = None
        self._jumps = 0
        self._entries, self._turning = entries_of(clock), Turning(bus, clock, driver, self._report)
        self._may_turn = turns_at_start  # it has neither turned nor found itself yet
        self._waits: set[str] = set()  # requests that wait for a turn, by their tasks
        self._worker.add_listener(SKILL, self._take_told)
        self._worker.add_on_ready(self._has_to_tell.set)
        bus.add_handler(self._take_map, MapLoaded)
        bus.add_handler(self._take_unloaded, MapUnloaded)
        bus.add_handler(self._take_mapping, MappingChanged)
        bus.add_handler(self._take_worker, WorkerReported)

    async def set_pose(self, x_m: float, y_m: float, heading_rad: float) -> LocalizationResult:
        """The robot is about here."""
        return await self._ask(SetPose(x_m, y_m, heading_rad), SHORT_S)

    async def localize(self, progress: Progress, *, turn: bool) -> LocalizationResult:
        """Search everywhere, and turn once where that is not enough."""
        if not turn:
            return await self._ask(Localize(), SHORT_S)
        driver = self._turning.require()
        stops = driver.stops
        await self._ask(Localize(), SHORT_S)
        if driver.stops != stops:
            raise Refused(
                RefusalKind.STOPPED, "the robot was stopped after this turn was asked for; ask again"
            )
        self._turning.begin(is_asked=True)
        return await self._turned(progress)

    async def _turned(self, progress: Progress) -> LocalizationResult:
        """Wait for the end of the turn, which ends with whoever waits for it."""
        end, task = self._turning.begin(is_asked=False), self._entries.task
        self._waits.add(task)
        self._reports.append(progress.report)
        try:
            why = await asyncio.shield(end)
        except asyncio.CancelledError:
            self._turning.end("the request was given up")
            raise
        finally:
            self._waits.discard(task)
            self._reports.remove(progress.report)
        told = self._told
        state, name = ("unknown", None) if told is None else (told.state, told.map)
        return LocalizationResult(state=state, map=name, reason=why)

    def waiting(self) -> Waiting:
        """The requests that wait for the end of a turn, by their tasks."""
        return dict.fromkeys(self._waits, self._turned)

    async def made_ready(self, report: OnProgress) -> str:
        """Wait until the worker uses the map in use, if there is one; why it cannot, empty where it can."""
        self._reports.append(report)
        try:
            await self._has_told.wait()
        finally:
            self._reports.remove(report)
        return self._problem

    async def run(self) -> None:
        """Tell the skill which map to use: when that changes, and each time that a worker has become ready."""
        while True:
            await self._has_to_tell.wait()
            self._has_to_tell.clear()
            if self._worker.is_ready:
                await self._tell_map()
            if not self._has_to_tell.is_set():
                self._has_told.set()

    async def _tell_map(self) -> None:
        used, self._problem = None if self._is_mapping else self._map, ""
        try:
            if self._was_unloaded:  # the next map may have its name and version
                self._was_unloaded = False
                await self._ask(UseNone(), LONG_S)
            await self._ask(UseNone() if used is None else UseMap(used.name, used.version), LONG_S)
            if used is not None:
                checked = await self._worker.request(navigation.SKILL, CheckMap(), deadline_s=SHORT_S)
                self._problem = navigation.MAP_CHECKED.decode(checked).problem
        except Refused as problem:
            self._problem = str(problem)
            log.error("localization has no map", reason=self._problem)
            self._publish(self._clock.now_s(), state="unknown", name=None, reason=self._problem)

    def _report(self, done: float, total: float, text: str) -> None:
        for report in self._reports:
            report(done, total, text)

    async def _ask(
        self, request: UseMap | UseNone | SetPose | Localize, deadline_s: float
    ) -> LocalizationResult:
        told = await self._worker.request(SKILL, request, deadline_s=deadline_s, on_progress=self._report)
        answer = LOCATED.decode(told)
        self._take(answer)
        return LocalizationResult(state=answer.state, map=answer.map)

    # what happens

    def _take_map(self, event: MapLoaded) -> None:
        self._map = event
        self._has_told.clear()
        self._has_to_tell.set()

    def _take_unloaded(self, event: MapUnloaded) -> None:
        self._map, self._was_unloaded = None, True
        self._has_to_tell.set()

    def _take_mapping(self, event: MappingChanged) -> None:
        is_mapping = event.state != "idle"
        if is_mapping is not self._is_mapping:
            self._is_mapping = is_mapping
            self._has_to_tell.set()

    def _take_worker(self, event: WorkerReported) -> None:
        """Nobody finds the way while there is no worker: what was known is old."""
        if event.state in AWAY and self._told is not None and self._told.state != "unknown":
            why = f"the worker is {event.state}" + (f": {event.reason}" if event.reason else "")
            self._publish(event.stamp_s, state="unknown", name=None, reason=why)

    def _take_told(self, body: bytes) -> None:
        """Raises ``msgspec.DecodeError`` for what the skill does not say."""
        if not self._is_mapping:
            self._take(LOCATED.decode(body))

    def _take(self, told: Located) -> None:
        self._jumps += told.jumped
        alternatives = tuple(
            Alternative(Pose2D(x, y, heading), fit) for x, y, heading, fit in told.alternatives
        )
        self._publish(
            told.stamp_s, told.state, told.map, told.fit, alternatives, told.searched, reason=told.reason
        )
        if told.map_from_base is None:
            return
        pose, steady_from_base = Pose2D(*told.map_from_base), Pose2D(*told.odometry)
        map_from_steady = pose.compose(steady_from_base.inverse())
        self._bus.publish(
            MapPoseUpdated(
                told.stamp_s,
                pose,
                map_from_steady.compose(self._feed.steady_from_odom),
                PoseCovariance(*told.covariance),
                told.fit,
                told.state,
            )
        )

    def _publish(
        self,
        stamp_s: float,
        state: str,
        name: str | None,
        fit: float = 0.0,
        alternatives: tuple[Alternative, ...] = (),
        searched: float = 0.0,
        *,
        reason: str = "",
    ) -> None:
        """Tell how it stands if that has changed, or was told a while ago."""
        last = self._told
        now = LocalizationChanged(stamp_s, state, name, fit, alternatives, searched, self._jumps, reason)
        if last is not None:
            same = (last.state, last.map, last.jumps, last.reason) == (state, name, self._jumps, reason)
            if same and len(last.alternatives) == len(alternatives) and stamp_s - last.stamp_s < TOLD_EVERY_S:
                return
        self._told = now
        self._bus.publish(now)
        self._turn_or_not(now)

    def _turn_or_not(self, now: LocalizationChanged) -> None:
        """A turn ends when the robot knows where it is; one that never did turns by itself, where it may."""
        if now.state == "localized":
            self._may_turn = False
            self._turning.end("it knows where it is")
        elif self._may_turn and now.map is not None and now.state in ("searching", "lost"):
            self._may_turn = False
            try:
                self._turning.begin(is_asked=False)
            except Refused as refusal:
                log.info("the robot does not turn to find itself", reason=str(refusal))
