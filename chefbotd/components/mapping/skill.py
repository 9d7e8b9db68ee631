"""The skill that makes maps: SLAM scan by scan, published as poses and patches, saved regularly and at the end.

Every state of SLAM is a value. So a job that is given up leaves what was there, and a worker that is killed goes on
from the last state that it saved on its own.
"""

from collections.abc import Generator, Iterable, Iterator
from enum import StrEnum
from typing import TYPE_CHECKING, Final

from chefbotd.components.mapping import skill_requests as requests
from chefbotd.components.mapping.algorithms.finish import refining
from chefbotd.components.mapping.algorithms.live_map import MapUpdates, way_m
from chefbotd.components.mapping.algorithms.mount_check import MountCheck, check_scan, mount_problem
from chefbotd.components.mapping.algorithms.occupancy import occupancy
from chefbotd.components.mapping.algorithms.parameters import SLAM
from chefbotd.components.mapping.algorithms.saved import save_state
from chefbotd.components.mapping.algorithms.slam import step
from chefbotd.components.mapping.algorithms.state import SlamMode, SlamState, start
from chefbotd.components.mapping.algorithms.warm import warm
from chefbotd.components.mapping.aligned_scans import AlignedScan, ScanAligner, Silence, pose_updated
from chefbotd.components.mapping.map_files import MapFiles, StartState, StartStates, StoredMaps
from chefbotd.components.mapping.skill_requests import MappingSkillParameters
from chefbotd.components.maps.events import MappingChanged, MapSaved
from chefbotd.components.maps.storage.names import map_name
from chefbotd.components.worker.skill import Job, JobStep, Struct
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import MapPoseUpdated, OdometryUpdated
from chefbotd.core.poses import motion_covariance
from chefbotd.core.sentence import Sentence, join_sentences

if TYPE_CHECKING:  # it would load asyncio, 7 MB
    from chefbotd.clock import Clock


BUSY_SHARE: Final = 0.05
"""Publishing and saving each take no more of the time than this: a large map is published and saved less often."""


class MappingMode(StrEnum):
    """What the skill does."""

    IDLE = "idle"
    MAPPING = "mapping"
    PAUSED = "paused"
    FINISHING = "finishing"


class MappingSkill:
    """One map at a time."""

    def __init__(self, parameters: bytes, clock: "Clock", files: MapFiles | None = None) -> None:
        self._parameters = MappingSkillParameters.model_validate_json(parameters)
        self._clock = clock
        self._files = files or StoredMaps(self._parameters.folder, self._parameters.versions_kept)
        self._start_states = StartStates(self._files, self._parameters.session)
        self._aligner = ScanAligner(self._parameters.lidars)
        self._mode, self._reason, self._warning = MappingMode.IDLE, "", ""
        self._silence = Silence(self._parameters.lidars)
        self._name: str | None = None
        self._updates = MapUpdates(self._parameters.mapping.resolution_m)
        self._forget()

    def _forget(self) -> None:
        """No map is being made."""
        self._state: SlamState = start()
        self._updates.forget()
        self._scans = 0
        self._mount = MountCheck()
        self._last: AlignedScan | None = None
        self._saved_number = 0
        self._tell_at_s = self._save_at_s = float("-inf")
        self._aligner.forget_scans()

    def warm(self) -> None:
        """Load, or compile, all that SLAM needs."""
        warm()

    # what is measured

    def take_scan(self, scan: ScanMeasured) -> Iterable[Struct]:
        """A turn of a lidar of which the map is made."""
        if scan.lidar in self._parameters.lidars:
            self._silence.scan_s[scan.lidar] = self._clock.now_s()
            if self._mode is MappingMode.MAPPING:
                self._aligner.add_scan(scan)
        return self._map_what_is_aligned()

    def take_odometry(self, odometry: OdometryUpdated) -> Iterable[Struct]:
        """Where the robot is by odometry: also while no map is made, so that the first scan finds it."""
        self._silence.odometry_s = self._clock.now_s()
        self._aligner.add_odometry(odometry)
        return self._map_what_is_aligned()

    def _map_what_is_aligned(self) -> Iterator[Struct]:
        while self._mode is MappingMode.MAPPING:
            aligned = self._aligner.next_aligned(self._clock.now_s())
            if aligned is None:
                return
            yield self._mapped(aligned)

    def _mapped(self, aligned: AlignedScan) -> MapPoseUpdated:
        last = self._last
        noise = None
        if last is not None:
            before, after = last.odometry_covariance, aligned.odometry_covariance
            noise = motion_covariance(last.odometry, before, aligned.odometry, after)
        self._last = aligned
        self._state, report = step(SLAM, self._state, aligned.stamp_s, aligned.odometry, aligned.scan, noise)
        self._scans += 1
        fits = report.mode in (SlamMode.MAPPING, SlamMode.WHEEL_SLIP)
        self._mount = check_scan(self._mount, aligned.odometry, report.map_pose if fits else None)
        return pose_updated(
            aligned.stamp_s,
            report.map_pose,
            aligned.odometry,
            report.covariance,
            report.fit,
            str(report.mode),
            report.searched,
        )

    # what has its own time

    def step(self, now_s: float) -> Iterable[Struct]:
        """Map scans that odometry keeps waiting; tell what changed; save now and then."""
        yield from self._map_what_is_aligned()
        if self._silence.has_changed(now_s, is_awaited=self._mode is MappingMode.MAPPING):
            yield self._status()
        if self._mode is not MappingMode.MAPPING:
            return
        if now_s >= self._tell_at_s and self._updates.number != self._state.next_number:
            yield from self._tell_changes(now_s)
        if now_s >= self._save_at_s and self._saved_number != self._state.next_number:
            yield from self._autosaved(now_s)

    def _tell_changes(self, now_s: float) -> Iterator[Struct]:
        part = self._updates.changes(now_s, self._state)
        if part is not None:
            yield part
        yield self._status()
        took_s = self._clock.now_s() - now_s
        self._tell_at_s = now_s + max(self._parameters.mapping.publish_period_s, took_s / BUSY_SHARE)

    def _autosaved(self, now_s: float) -> Iterator[Struct]:
        try:
            self._files.autosave(
                self._updates.grid or occupancy(self._state.nodes), self._start_states.to_keep(self._state)
            )
            self._saved_number, self._reason = self._state.next_number, ""
        except Refused as problem:
            self._reason = str(problem)
            yield self._status()
        took_s = self._clock.now_s() - now_s
        self._save_at_s = now_s + max(self._parameters.mapping.autosave_period_s, took_s / BUSY_SHARE)

    def close(self) -> None:
        """The daemon ends: keep what it has of a map that is not finished."""
        if self._mode is not MappingMode.IDLE and self._saved_number != self._state.next_number:
            list(self._autosaved(self._clock.now_s()))

    # what is asked

    def handle(self, body: bytes) -> Struct | Job:
        """One request."""
        match requests.REQUEST.decode(body):
            case requests.Start() as request:
                return self._start(request)
            case requests.ResumeMapping() as request:
                return self._resume(request)
            case requests.PauseMapping():
                return self._pause()
            case requests.Finish() as request:
                return self._finish(request.name)
            case requests.Discard():
                return self._discard()
            case requests.GetStatus():
                return self._status()
            case _:  # GetGrid
                return self._whole_grid()

    def _start(self, request: requests.Start) -> MappingChanged:
        if self._mode is MappingMode.PAUSED and request.name in (None, self._name) and not request.unfinished:
            self._mode = MappingMode.MAPPING
            return self._status()
        if self._mode is not MappingMode.IDLE:
            reason = (
                Sentence("mapping.finishing", "the map is being finished")
                if self._mode is MappingMode.FINISHING
                else Sentence("mapping.making", "a map is being made already")
            )
            raise Refused(RefusalKind.ALREADY_MAPPING, reason)
        self._begin(self._start_states.asked_for(request.name, unfinished=request.unfinished), request.name)
        self._mode = MappingMode.PAUSED if request.paused else MappingMode.MAPPING
        return self._status()

    def _resume(self, request: requests.ResumeMapping) -> MappingChanged:
        beginning = self._start_states.unfinished()
        if beginning is None:
            self._reason = Sentence(
                "mapping.nothing_kept",
                "the worker ended, and nothing was kept of the map that was being made",
            )
            return self._status()
        self._begin(beginning, request.name)
        self._mode = MappingMode.PAUSED if request.paused else MappingMode.MAPPING
        self._saved_number = self._state.next_number
        return self._status()

    def _begin(self, beginning: StartState, name: str | None) -> None:
        self._forget()
        self._state, self._warning = beginning.state, beginning.warning
        self._name, self._reason = name, ""

    def _pause(self) -> MappingChanged:
        self._require_map()
        self._aligner.forget_scans()
        self._mode = MappingMode.PAUSED
        return self._status()

    def _discard(self) -> MappingChanged:
        if self._mode is MappingMode.FINISHING:
            raise Refused(
                RefusalKind.ALREADY_MAPPING,
                Sentence("mapping.finishing_cancel", "the map is being finished: cancel that first"),
            )
        self._files.discard_autosave()
        self._mode, self._name, self._reason, self._warning = MappingMode.IDLE, None, "", ""
        self._forget()
        return self._status()

    def _finish(self, name: str) -> Job:
        self._require_map()
        if not len(self._state.nodes):
            raise Refused(
                RefusalKind.NOT_MAPPING,
                Sentence(
                    "mapping.empty",
                    "the map is empty because no scan has arrived yet; check the topics of the lidar",
                ),
            )
        job = self._finishing(map_name(name), self._mode)
        next(
            job
        )  # from now on it is being finished: nothing else is done to the map before the job's first step
        return job

    def _finishing(self, name: str, before: MappingMode) -> Generator[JobStep, None, Struct]:
        """Match all scans once more, in a copy, and save it; whatever ends this early leaves the map as it was."""
        self._mode = MappingMode.FINISHING
        self._aligner.forget_scans()
        try:
            yield JobStep(0.0, 1.0, "")
            work = refining(SLAM, self._state)
            state = yield from _with_progress(work)
            yield JobStep(0.9, 1.0, "drawing the map")
            grid = occupancy(state.nodes, self._parameters.mapping.resolution_m)
            yield JobStep(0.95, 1.0, "saving the map")
            version = self._files.save(name, grid, save_state(state))
        except BaseException:
            self._mode = before
            raise
        status = self._status()
        self._mode, self._name, self._reason, self._warning = MappingMode.IDLE, None, "", ""
        self._forget()
        try:
            self._files.discard_autosave()
        except Refused as problem:  # the map is saved nevertheless
            self._reason = str(problem)
        return MapSaved(name, version, status.keyframes, status.loops, status.path_m)

    def _require_map(self) -> None:
        if self._mode in (MappingMode.IDLE, MappingMode.FINISHING):
            reason = (
                Sentence("mapping.finishing", "the map is being finished")
                if self._mode is MappingMode.FINISHING
                else Sentence("mapping.none", "no map is being made")
            )
            raise Refused(RefusalKind.NOT_MAPPING, reason)

    def _whole_grid(self) -> Struct:
        part = self._updates.whole(self._clock.now_s())
        if part is None:
            raise Refused(
                RefusalKind.NOT_MAPPING,
                Sentence("mapping.none_or_empty", "no map is being made, or it is still empty"),
            )
        return part

    # what is published

    def _status(self) -> MappingChanged:
        state, is_idle = self._state, self._mode is MappingMode.IDLE
        unfinished, warning = is_idle and self._files.has_autosave(), self._warning
        if is_idle:
            warning = self._start_states.warning(is_found=unfinished)
        return MappingChanged(
            stamp_s=self._clock.now_s(),
            state=str(self._mode),
            name=self._name,
            keyframes=len(state.nodes),
            loops=int(state.edges.loop.sum()),
            path_m=way_m(state),
            scans=self._scans,
            unfinished=unfinished,
            reason=join_sentences((self._silence.problem, self._mount_problem(), self._reason)),
            warning=warning,
        )

    def _mount_problem(self) -> str:
        problem = mount_problem(self._mount, self._parameters.lidars)
        return (
            Sentence("mapping.mend_mount", "{problem}; mend that, and begin the map again", problem=problem)
            if problem
            else ""
        )


def _with_progress(
    work: Generator[tuple[int, int], None, SlamState],
) -> Generator[JobStep, None, SlamState]:
    while True:
        try:
            done, total = next(work)
        except StopIteration as end:
            state: SlamState = end.value
            return state
        yield JobStep(0.9 * done / max(total, 1), 1.0, "matching all scans with each other")
