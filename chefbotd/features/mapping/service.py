"""The daemon's side of mapping: asks the worker's skill, publishes its results, and continues after a restart."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Final

import structlog
from msgspec.structs import asdict

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.commands import Refused
from chefbotd.core.events.mapping import MapChanged, MappingChanged, MapPoseUpdated
from chefbotd.core.geometry import Pose2D, PoseCovariance
from chefbotd.features.mapping.methods import MappingResult, MapSaved
from chefbotd.features.maps.grid_part import grid_event
from chefbotd.features.worker.service import WorkerService
from chefbotd.rpc.jobs import Progress
from chefbotd.worker.skills.mapping_messages import (
    FINISHED,
    GRID,
    SKILL,
    STATUS,
    TOLD,
    Discard,
    Finish,
    GetGrid,
    GetStatus,
    GridPart,
    MappingStatus,
    Pause,
    PoseFound,
    Resume,
    Start,
)

log = structlog.get_logger(component="mapping")

SHORT_S: Final = 20.0
"""For what is a moment's work in the worker, though it may be at something else."""

LONG_S: Final = 120.0
"""For what reads a large map, or between two steps of what matches all of it."""


class MappingService:
    """Whether a map is being made is remembered here, so that a worker that was killed is told to go on."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        feed: WorkerService,
        use_saved: Callable[[str], Awaitable[None]] | None = None,
    ) -> None:
        """``use_saved`` is called with the name of a map that was finished."""
        self._use_saved = use_saved
        self._bus, self._clock, self._feed, self._worker = bus, clock, feed, feed.worker
        self._status = MappingStatus("idle")
        self._has_to_resume = asyncio.Event()
        self._worker.add_listener(SKILL, self._take_told)
        self._worker.add_on_ready(self._has_to_resume.set)

    @property
    def is_mapping(self) -> bool:
        """Whether a map is being made, paused or not."""
        return self._status.state != "idle"

    async def start(self, name: str | None, *, unfinished: bool) -> MappingResult:
        """Begin, or go on."""
        return await self._ask(Start(name, unfinished), LONG_S)

    async def pause(self) -> MappingResult:
        """Take in no scans until started again."""
        return await self._ask(Pause(), SHORT_S)

    async def discard(self) -> MappingResult:
        """Forget the map that is being made, or was never finished."""
        return await self._ask(Discard(), SHORT_S)

    async def finish(self, name: str, progress: Progress) -> MapSaved:
        """Match all scans once more, and save the map."""
        answer = await self._worker.request(
            SKILL, Finish(name), deadline_s=LONG_S, on_progress=progress.report, settles=True
        )
        saved = FINISHED.decode(answer)
        self._publish(MappingStatus("idle"))
        await self._learn_status()  # what it saved on its own may be there still
        await self._use(saved.name)
        return MapSaved.of(saved)

    async def _use(self, name: str) -> None:
        """The map is saved; that it cannot be used right away is told in the log only."""
        try:
            if self._use_saved is not None:
                await self._use_saved(name)
        except Refused as problem:
            log.warning("the finished map cannot be loaded", map=name, reason=str(problem))

    async def grid(self) -> MapChanged:
        """The whole map that is being made, as it is now."""
        answer = await self._worker.request(SKILL, GetGrid(), deadline_s=SHORT_S)
        return grid_event(MapChanged, GRID.decode(answer))

    async def run(self) -> None:
        """Each time that a worker is ready, have it go on with the map, or ask whether one was never finished."""
        while True:
            await self._has_to_resume.wait()
            self._has_to_resume.clear()
            if self.is_mapping:
                await self._resume()
            else:
                await self._learn_status()

    async def _learn_status(self) -> None:
        """Ask the skill how it stands; a worker that is not there any more tells nothing."""
        with contextlib.suppress(Refused):
            await self._ask(GetStatus(), SHORT_S)

    async def _resume(self) -> None:
        status = self._status
        begun = status.keyframes > 0 or status.name is not None
        request = Resume(status.state == "paused", status.name) if begun else Start()
        try:
            await self._ask(request, LONG_S)
            log.info("mapping continues after a restart of the worker", state=self._status.state)
        except Refused as problem:
            log.error("mapping cannot continue after a restart of the worker", reason=str(problem))
            if self._worker.is_ready:  # else the next one is asked
                self._publish(MappingStatus("idle", reason=str(problem)))

    async def _ask(
        self, request: Start | Resume | Pause | Discard | GetStatus, deadline_s: float
    ) -> MappingResult:
        answer = await self._worker.request(SKILL, request, deadline_s=deadline_s)
        status = STATUS.decode(answer)
        self._publish(status)
        result = MappingResult.of(status)
        return result if result.warning else result.model_copy(update={"warning": None})

    def _take_told(self, body: bytes) -> None:
        """Raises ``msgspec.DecodeError`` for what the skill does not say."""
        told = TOLD.decode(body)
        match told:
            case PoseFound():
                self._bus.publish(self._pose_updated(told))
            case GridPart():
                self._bus.publish(grid_event(MapChanged, told))
            case MappingStatus():
                self._publish(told)

    def _publish(self, status: MappingStatus) -> None:
        if status.warning and status.warning != self._status.warning:
            log.warning("the unfinished map is damaged", state=status.state, warning=status.warning)
        if status.reason and not self._status.reason:
            log.warning("the unfinished map has a problem", reason=status.reason)
        self._status = status
        self._bus.publish(MappingChanged(self._clock.now_s(), **asdict(status)))

    def _pose_updated(self, found: PoseFound) -> MapPoseUpdated:
        map_from_base, steady_from_base = Pose2D(*found.map_from_base), Pose2D(*found.odometry)
        map_from_steady = map_from_base.compose(steady_from_base.inverse())
        return MapPoseUpdated(
            found.stamp_s,
            map_from_base,
            map_from_steady.compose(self._feed.steady_from_odom),
            PoseCovariance(*found.covariance),
            found.fit,
            found.state,
        )
