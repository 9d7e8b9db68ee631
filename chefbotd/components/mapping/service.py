"""The daemon's side of mapping: asks the worker's skill, publishes its results, and continues after a restart."""

import contextlib
from collections.abc import Awaitable, Callable
from typing import Final

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.mapping.models import (
    TOPICS,
    FinishMappingParams,
    StartMappingParams,
    mapping_data,
)
from chefbotd.components.mapping.skill_requests import (
    SKILL,
    Discard,
    Finish,
    GetGrid,
    GetStatus,
    PauseMapping,
    ResumeMapping,
    Start,
)
from chefbotd.components.maps.events import MapChanged, MappingChanged, MappingData, MapSaved
from chefbotd.components.worker.service import WorkerService
from chefbotd.core.commands import Refused
from chefbotd.core.events.robot import MapPoseUpdated
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.features.feature import Feature, Service
from chefbotd.inputs import StatefulEvent, inputs_of
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import NoParams
from chefbotd.rpc.parameters import Role

log = structlog.get_logger(component="mapping")

SHORT_S: Final = 20.0
"""The time-out of short work in the worker, which may be busy with something else."""

LONG_S: Final = 120.0
"""The time-out of reading a large map, and between two steps of matching it."""


class MappingState(MutableState):
    """The skill's last report, and whether a new worker has to continue the map."""

    status: MappingChanged
    has_to_resume: bool = False


class MappingService(StatefulPart[MappingState]):
    """It remembers whether a map is being made, so that a new worker continues it."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        worker_service: WorkerService,
        use_saved: Callable[[str], Awaitable[None]] | None = None,
    ) -> None:
        """``use_saved`` is called with the name of a map that was finished."""
        self._use_saved = use_saved
        self._bus, self._clock, self._worker_service, self._worker = (
            bus,
            inputs_of(clock),
            worker_service,
            worker_service.worker,
        )
        self._has_to_resume = StatefulEvent()
        self.memory, self.parts = (
            MappingState(MappingChanged(stamp_s=0.0)),
            {"has_to_resume": self._has_to_resume},
        )
        self._worker.add_listener(SKILL, MappingChanged, self._publish_status)
        self._worker.add_listener(
            SKILL, MapPoseUpdated, lambda event: bus.publish(worker_service.in_odom(event))
        )
        self._worker.add_listener(SKILL, MapChanged, bus.publish)
        self._worker.add_on_ready(self._has_to_resume.set)

    @property
    def is_mapping(self) -> bool:
        """Whether a map is being made, paused or not."""
        return self.memory.status.state != "idle"

    @method(role=Role.DRIVE, moves=False)
    async def start_mapping(
        self, caller: Caller, params: StartMappingParams, progress: ProgressReporter
    ) -> MappingData:
        """Begin a map, continue a saved one by its name, or continue after a pause."""
        return await self._ask_skill(Start(params.name, params.unfinished), LONG_S)

    @method(role=Role.DRIVE, moves=False)
    async def pause_mapping(
        self, caller: Caller, params: NoParams, progress: ProgressReporter
    ) -> MappingData:
        """Pause mapping until start_mapping is sent."""
        return await self._ask_skill(PauseMapping(), SHORT_S)

    @method(role=Role.DRIVE, moves=False)
    async def finish_mapping(
        self, caller: Caller, params: FinishMappingParams, progress: ProgressReporter
    ) -> MapSaved:
        """Match all scans once more, save the map under a name, and end; reports progress."""
        saved = await self._worker.request(
            SKILL, Finish(params.name), MapSaved, deadline_s=LONG_S, on_progress=progress.report, settles=True
        )
        self._publish_status(MappingChanged(stamp_s=self._clock.now_s()))
        await self._learn_status()  # what it saved on its own may be there still
        await self._use(saved.name)
        return saved

    @method(role=Role.DRIVE, moves=False)
    async def discard_mapping(
        self, caller: Caller, params: NoParams, progress: ProgressReporter
    ) -> MappingData:
        """End without saving, and forget the map that was never finished; saved maps stay."""
        return await self._ask_skill(Discard(), SHORT_S)

    async def _use(self, name: str) -> None:
        """Use the saved map. If it cannot be used now, only the log says so."""
        try:
            if self._use_saved is not None:
                await self._use_saved(name)
        except Refused as problem:
            log.warning("the finished map cannot be loaded", map=name, reason=str(problem))

    async def grid(self) -> MapChanged:
        """The whole map that is being made, as it is now."""
        return await self._worker.request(SKILL, GetGrid(), MapChanged, deadline_s=SHORT_S)

    async def run(self) -> None:
        """Each time a worker is ready, let it continue the map, or ask for an unfinished one."""
        while True:
            await self._clock.at_rest(self._has_to_resume.wait())
            self._has_to_resume.clear()
            if self.is_mapping:
                await self._resume()
            else:
                await self._learn_status()

    async def _learn_status(self) -> None:
        """Ask the skill for its state; a worker that has died does not answer."""
        with contextlib.suppress(Refused):
            await self._ask_skill(GetStatus(), SHORT_S)

    async def _resume(self) -> None:
        status = self.memory.status
        begun = status.keyframes > 0 or status.name is not None
        paused = status.state == "paused"
        request = ResumeMapping(paused, status.name) if begun else Start(paused=paused)
        try:
            await self._ask_skill(request, LONG_S)
            log.info("mapping continues after a restart of the worker", state=self.memory.status.state)
        except Refused as problem:
            log.error("mapping cannot continue after a restart of the worker", reason=str(problem))
            if self._worker.is_ready:  # else the next one is asked
                self._publish_status(MappingChanged(stamp_s=self._clock.now_s(), reason=problem.words))

    async def _ask_skill(
        self, request: Start | ResumeMapping | PauseMapping | Discard | GetStatus, deadline_s: float
    ) -> MappingData:
        status = await self._worker.request(SKILL, request, MappingChanged, deadline_s=deadline_s)
        self._publish_status(status)
        return mapping_data(status)

    def _publish_status(self, status: MappingChanged) -> None:
        if status.warning and status.warning != self.memory.status.warning:
            log.warning("the unfinished map is damaged", state=status.state, warning=status.warning)
        if status.reason and not self.memory.status.reason:
            log.warning("the unfinished map has a problem", reason=status.reason)
        self.memory.status = status
        self._bus.publish(status)


def mapping(service: MappingService) -> Feature:
    """SLAM in the worker, over the service that asks it."""
    return Feature(
        "mapping",
        services=(Service("mapping", service.run, in_steps=True),),
        methods=methods_of(service),
        topics=TOPICS,
        parts={"mapping": service},
    )
