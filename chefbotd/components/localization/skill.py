"""The skill that localizes on a stored map, scan by scan, and keeps the pose for the next run."""

from collections.abc import Callable, Generator, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chefbotd.components.localization import skill_requests as requests
from chefbotd.components.localization.algorithms.branch_and_bound import pyramid
from chefbotd.components.localization.algorithms.doubt import doubt_sentence
from chefbotd.components.localization.algorithms.localizer import LocalizationReport, advance_search, step
from chefbotd.components.localization.algorithms.searching import LocalizationMap
from chefbotd.components.localization.algorithms.state import (
    HAS_POSE,
    Localization,
    Odometry,
    PoseState,
    localize,
    on_another_grid,
    set_pose,
)
from chefbotd.components.localization.algorithms.surface_map import surface_map
from chefbotd.components.localization.algorithms.warm import warm
from chefbotd.components.localization.edited_map import EditedMap, ReadEdits, edited_map, stored_edits
from chefbotd.components.localization.events import Alternative, LocalizationChanged
from chefbotd.components.localization.pose_file import PoseFile, PoseOnDisk, SavedPose, require_on_map
from chefbotd.components.localization.skill_requests import POSE_FILE, LocalizationSkillParameters
from chefbotd.components.mapping.algorithms.mount_check import MountCheck, check_scan, mount_problem
from chefbotd.components.mapping.aligned_scans import AlignedScan, ScanAligner, Silence, pose_of, pose_updated
from chefbotd.components.maps.storage.contents import read_grid
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.worker.skill import Job, JobStep, Struct
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.poses import Floats, compose
from chefbotd.core.record import replace
from chefbotd.core.sentence import Sentence, join_sentences

if TYPE_CHECKING:  # it would load asyncio, 7 MB
    from chefbotd.clock import Clock

KEPT_ANEW_M, KEPT_ANEW_RAD = 0.02, 0.02

ReadGrid = Callable[[str], OccupancyGrid]
"""The cells of a stored map; raises ``Refused``."""


def stored_grids(folder: Path) -> ReadGrid:
    """Those of the store in this folder."""
    store = MapStore(folder, 1)
    return lambda name: read_grid(store, name)


def _made_ready(grid: OccupancyGrid) -> Generator[JobStep, None, LocalizationMap]:
    """A map made ready, in steps; raises ``ValueError``."""
    yield JobStep(1.0, 3.0, "finding its walls")
    surfaces = surface_map(grid)
    yield JobStep(2.0, 3.0, "preparing the search")
    return LocalizationMap(surfaces, pyramid(surfaces))


class LocalizationSkill:
    """One map at a time."""

    def __init__(
        self,
        parameters: bytes,
        clock: "Clock",
        read_map: ReadGrid | None = None,
        pose_file: PoseFile | None = None,
        read_edits: ReadEdits | None = None,
    ) -> None:
        self._parameters = LocalizationSkillParameters.model_validate_json(parameters)
        self._read_map = read_map or stored_grids(self._parameters.folder)
        if read_edits is None:
            read_edits = stored_edits(self._parameters.folder) if read_map is None else lambda _: None
        self._read_edits = read_edits
        self._pose_file = pose_file or PoseOnDisk(self._parameters.folder / POSE_FILE)
        self._clock = clock
        self._aligner = ScanAligner(self._parameters.lidars)
        self._within: LocalizationMap | None = None
        self._map: tuple[str, int] | None = None
        self._now = Localization()
        self._mount = MountCheck()
        self._silence = Silence(self._parameters.lidars)
        self._reason, self._jumps = "", 0
        self._sought = ""  # why it was told to search
        self._kept: Floats | None = None
        self._keep_at_s = float("-inf")
        self.edited: EditedMap | None = None
        self.report: LocalizationReport | None = None
        self.seen: AlignedScan | None = None

    @property
    def used(self) -> tuple[str, int] | None:
        """The map in use, and its version: another object each time that it was asked for.

        ``edited`` has its cells, another object each time that they were changed; ``report`` and ``seen`` are of the
        last scan.
        """
        return self._map

    @property
    def has_freed_map(self) -> bool:
        """Whether the grids of the map in use are gone, because those of another are being made."""
        return self._map is not None and self._within is None

    @property
    def problem(self) -> str:
        """Why no pose may be believed, however well the scans fit; empty: there is no such reason."""
        problem = mount_problem(self._mount, self._parameters.lidars)
        return f"{problem}; mend that, then have the robot find itself" if problem else ""

    def warm(self) -> None:
        """Load, or compile, all that localization needs."""
        warm()

    # what is measured

    def take_scan(self, scan: ScanMeasured) -> Iterable[Struct]:
        """A turn of a lidar by which the robot finds its way."""
        if scan.lidar in self._parameters.lidars:
            self._silence.scan_s[scan.lidar] = self._clock.now_s()
            if self._within is not None:
                self._aligner.add_scan(scan)
        return self._follow_what_is_aligned()

    def take_odometry(self, odometry: OdometryUpdated) -> Iterable[Struct]:
        """Where the robot is by odometry."""
        self._silence.odometry_s = self._clock.now_s()
        self._aligner.add_odometry(odometry)
        return self._follow_what_is_aligned()

    def _follow_what_is_aligned(self) -> Iterator[Struct]:
        while self._within is not None:
            aligned = self._aligner.next_aligned(self._clock.now_s())
            if aligned is None:
                return
            yield from self._followed(self._within, aligned)

    def _followed(self, map_: LocalizationMap, aligned: AlignedScan) -> Iterator[Struct]:
        odometry = Odometry(aligned.odometry, aligned.odometry_covariance)
        self._now, report = step(
            map_,
            self._now,
            aligned.stamp_s,
            odometry,
            aligned.scan,
            auto_search=self._parameters.localization.auto_search,
        )
        self.report, self.seen = report, aligned
        self._jumps += report.jumped
        if report.state is PoseState.LOCALIZED:
            self._sought = ""
        estimate = report.map_from_base if report.state in HAS_POSE else None
        self._mount = check_scan(self._mount, aligned.odometry, None if estimate is None else estimate.pose)
        return self._located(report)

    # what has its own time

    def step(self, now_s: float) -> Iterable[Struct]:
        """Go on with a search between two scans; keep the pose now and then."""
        yield from self._follow_what_is_aligned()
        changed = self._silence.has_changed(now_s, is_awaited=self._within is not None)
        if changed and (
            self._silence.leaves_nothing or not self._silence.problem
        ):  # else the next scan says it
            yield self._standing()
        if self._within is None:
            return
        self._now = advance_search(self._within, self._now)
        if now_s >= self._keep_at_s:
            self._keep_at_s = now_s + self._parameters.localization.save_period_s
            self._keep()

    def _keep(self) -> None:
        """Keep the pose, if there is one that may be believed, and another than was kept last."""
        estimate = self._now.estimate
        if (
            self._map is None
            or self._now.state is not PoseState.LOCALIZED
            or estimate is None
            or self.problem
        ):
            return
        pose = estimate.pose
        if self._kept is not None:
            off = np.abs(pose - self._kept)
            if max(off[0], off[1]) < KEPT_ANEW_M and off[2] < KEPT_ANEW_RAD:
                return
        name, version = self._map
        x, y, heading = pose.tolist()
        covariance = tuple(float(value) for value in estimate.covariance.ravel())
        kept = SavedPose(map=name, version=version, x_m=x, y_m=y, heading_rad=heading, covariance=covariance)
        self._reason = self._pose_file.write(kept)
        self._kept = pose.copy()

    def close(self) -> None:
        """The daemon ends: keep the pose."""
        self._keep()

    # what is asked

    def handle(self, body: bytes) -> Struct | Job:
        """One request."""
        match requests.REQUEST.decode(body):
            case requests.UseMap() as request:
                return self._using(request.name, request.version, request.renamed_from)
            case requests.UseEdits():
                return self._redrawn()
            case requests.UseNone():
                self._keep()
                self._rest()
            case requests.SetPose() as request:
                self._require_map()
                if self.edited is not None:
                    require_on_map(self.edited.grid, request.x_m, request.y_m)
                pose = np.array([request.x_m, request.y_m, request.heading_rad])
                self._now, self._mount = set_pose(self._now, pose), MountCheck()
            case _:  # Localize
                self._require_map()
                self._now, self._mount = localize(self._now), MountCheck()
        return self._standing()

    def _using(self, name: str, version: int, renamed_from: str | None) -> Job:
        """Make a map ready, in steps; one that is ready stays as it is, with its pose."""
        if self._within is not None and self._map in ((name, version), (renamed_from, version)):
            self._map, self._kept = (name, version), None
            return (yield from self._redrawn())
        if self._map is not None and self._map[0] not in (name, renamed_from):
            self._free()
        try:
            yield JobStep(0.0, 3.0, "reading the map")
            stored, edited, map_ = self._read_map(name), None, None
            while edited is None or map_ is None or edited.content != self._read_edits(name):
                edited = edited_map(stored, self._read_edits(name))
                map_ = yield from _made_ready(edited.grid)
        except (ValueError, Refused) as problem:
            self._keep()
            self._rest()
            kind = problem.kind if isinstance(problem, Refused) else RefusalKind.MAP_UNREADABLE
            raise Refused(
                kind,
                Sentence(
                    "localization.unusable_map",
                    "the map {map!r} cannot be used for localization: {why}",
                    map=name,
                    why=problem,
                ),
            ) from problem
        self._change_to(name, version, edited, map_, renamed_from)
        return self._standing()

    def _redrawn(self) -> Job:
        """Find the way by the map in use as it is edited now; its pose stays, and so does the map until then."""
        try:
            while (before := self.edited) is not None and self._within is not None and self._map is not None:
                content = self._read_edits(self._map[0])
                if content == before.content:
                    break
                edited = edited_map(before.stored, content)
                is_same = np.array_equal(edited.grid.percent, before.grid.percent)
                map_ = self._within if is_same else (yield from _made_ready(edited.grid))
                if self.edited is not before:
                    continue  # another one is in use meanwhile, or this one was edited again
                if is_same:
                    edited = replace(edited, grid=before.grid)
                else:
                    self._now = on_another_grid(self._now)
                self._within, self.edited = map_, edited
        except (ValueError, Refused) as problem:
            kind = problem.kind if isinstance(problem, Refused) else RefusalKind.MAP_UNREADABLE
            raise Refused(
                kind,
                Sentence(
                    "localization.used_as_before",
                    "the map is used as it was before it was edited: {why}",
                    why=problem,
                ),
            ) from problem
        return self._standing()

    def _free(self) -> None:
        """Forget the search's and the matching's grids before those of another map are made: both may be too much."""
        self._keep()
        self._within = self._kept = self.report = self.seen = None
        self._now = Localization()
        self._aligner.forget_scans()

    def _change_to(
        self, name: str, version: int, edited: EditedMap, map_: LocalizationMap, renamed_from: str | None
    ) -> None:
        """Find the way on another map, or version; the pose that was kept for it is tried first."""
        self._keep()
        self._rest()
        self._within, self._map, self.edited = map_, (name, version), edited
        kept = self._pose_file.read()
        if kept is not None and kept.map in (name, renamed_from):
            pose = np.array([kept.x_m, kept.y_m, kept.heading_rad])
            covariance = np.array(kept.loosened()).reshape(3, 3)
            self._now = set_pose(self._now, pose, covariance)

    def _rest(self) -> None:
        self._within = self._map = self._kept = self.edited = self.report = self.seen = None
        self._now, self._mount, self._reason, self._sought = Localization(), MountCheck(), "", ""
        self._aligner.forget_scans()

    def _require_map(self) -> None:
        if self._within is None:
            raise Refused(
                RefusalKind.NO_MAP_LOADED,
                Sentence(
                    "localization.no_map",
                    "no finished map is in use: load one, or finish the one in progress",
                ),
            )

    # what is published

    def _located(self, report: LocalizationReport) -> Iterator[Struct]:
        """How it stands with a scan, and the pose, where there is one, which follows the estimate smoothly."""
        odometry, estimate = self._now.odometry, report.map_from_base
        alternatives = tuple(Alternative(pose_of(one.estimate.pose), one.fit) for one in report.alternatives)
        yield replace(
            self._standing(),
            stamp_s=report.stamp_s,
            state=self._state_told(report.state),
            fit=report.fit,
            alternatives=alternatives,
            searched=report.searched,
        )
        if odometry is None or estimate is None or self.problem or report.map_from_odom is None:
            return
        pose, state = compose(report.map_from_odom, odometry.pose), self._state_told(report.state)
        name = self._map[0] if self._map else None
        yield pose_updated(
            report.stamp_s, pose, odometry.pose, estimate.covariance, report.fit, state, of_map=name
        )

    def _state_told(self, state: PoseState) -> str:
        """Without scans nobody is sure of a pose, and with a lidar that is turned nobody has one."""
        if self.problem:
            return str(PoseState.LOST)
        return str(
            PoseState.UNCERTAIN if self._silence.leaves_nothing and state is PoseState.LOCALIZED else state
        )

    def _reason_told(self) -> str:
        doubt = doubt_sentence(self._now)
        return join_sentences((self.problem, self._silence.problem, doubt or self._sought, self._reason))

    @property
    def misfits(self) -> bool:
        """Whether its pose is uncertain because the scans fit it worse than before."""
        return bool(doubt_sentence(self._now))

    def search_again(self, why: str) -> None:
        """Search the whole map for a pose that is uncertain, and because of which nothing goes on."""
        if self._now.state is PoseState.UNCERTAIN:
            self._now, self._sought = (
                localize(self._now),
                Sentence("localization.searched", "the whole map is searched: {why}", why=why),
            )

    def _standing(self) -> LocalizationChanged:
        """How it stands between two scans; ``jumps`` are those since the worker started."""
        state, name = self._state_told(self._now.state), self._map[0] if self._map else None
        return LocalizationChanged(
            self._clock.now_s(), state, name, 0.0, (), 0.0, self._jumps, self._reason_told()
        )
