"""SLAM on recordings of real buildings, scored by relations, and in a simulated flat, against its walls.

Every recording in the folder is taken, whatever its name, with the same parameters. A scan's cost is processor time
of this process; compiling is done before. The flat's walls, lidar, odometry and driven tour are those of the tests.
"""

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from benchmarks.carmen import Recording, Score, recordings, score
from benchmarks.figures import Figure, Outcome
from chefbotd.components.mapping.algorithms.finish import refine_graph
from chefbotd.components.mapping.algorithms.parameters import SlamParameters
from chefbotd.components.mapping.algorithms.slam import SlamReport, step
from chefbotd.components.mapping.algorithms.state import Scan, SlamState, start
from chefbotd.components.mapping.algorithms.surfaces import Singles, normals
from chefbotd.components.mapping.algorithms.tracking import track_scan
from chefbotd.components.worker.compiled import release_libraries
from chefbotd.core.poses import Floats, between
from chefbotd.core.scan import LaserScan
from chefbotd.perception.laser_scan import usable
from tests.chefbotd.components.mapping.algorithms.slam.drives import Drive, off_m, walls_off_m
from tests.chefbotd.components.mapping.algorithms.slam.flat import (
    TOUR,
    Lidar,
    furnished_flat,
    odometry,
    poses_along,
)

FOLDER = Path(__file__).parents[2] / "shared" / "data" / "carmen"
BAND_M, SLAM = (0.05, 30.0), SlamParameters()
CENTER = np.zeros(2)
OFFICIAL_DENSE_M, OFFICIAL_SPARSE_M, PSEUDO_M, OFFICIAL_DEG = 0.030, 0.045, 0.10, 1.0
FRONT_END_MS, CORE_AT_10_HZ, WALLS_M, WALLS_P95_M, MEMORY_MB = 1.0, 0.08, 0.03, 0.06, 150
CLASSIC = {
    "intel-dense": "particle filter 0.043, graph 0.031",
    "intel": "",
    "aces": "raw 5.2",
    "edmonton": "raw 0.28",
}
QUICK_SCANS, SEEDS, QUICK_SEEDS, WARM_SCANS = 300, 10, 1, 120


@dataclass(frozen=True, slots=True)
class Run:
    """The last state, the reports, and processor seconds: of matching each scan, of each step, of the last touch."""

    state: SlamState
    reports: list[SlamReport]
    front_end_s: list[float]
    step_s: list[float]
    finish_s: float

    @property
    def poses(self) -> Floats:
        """Where each scan was, in the end."""
        return Drive(self.state, self.reports).poses()


def run(*, quick: bool = False, folder: Path = FOLDER, out: Path | None = None) -> Outcome:
    """The flat, and every recording (their beginnings, when quick); without recordings it says so."""
    figures, remarks = list(_flat(QUICK_SEEDS if quick else SEEDS)), []
    found = list(recordings(folder))
    for recording in found:
        done = _mapped(recording, QUICK_SCANS if quick else len(recording.rows))
        if out is not None:
            _write(out / f"{recording.name}.csv", recording, done.poses)
        if not quick:
            figures += _scored(recording, score(recording, done.poses))
        figures += _costs(recording.name, done)
        remarks.append(_told(recording, done))
    if not found:
        remarks.append(f"skipped the recordings: none in {folder}")
    return Outcome(tuple(figures), remarks=tuple(remarks))


def points_of(recording: Recording, scans: int) -> list[Singles]:
    """What the first scans show, in the robot's frame."""
    chosen = [
        usable(BAND_M, LaserScan(0.0, recording.bearings_rad, ranges, np.zeros_like(ranges)))
        for ranges in recording.ranges_m[:scans]
    ]
    directions = np.stack([np.cos(recording.bearings_rad), np.sin(recording.bearings_rad)], axis=1)
    return [
        (directions[good] * ranges[good, None]).astype(np.float32)
        for good, ranges in zip(chosen, recording.ranges_m[:scans], strict=True)
    ]


def _mapped(recording: Recording, scans: int) -> Run:
    """The recording, scan by scan."""
    points = points_of(recording, scans)
    rows = list(recording.rows[:scans])
    _run(points[:WARM_SCANS], recording.odometry[rows[:WARM_SCANS]])
    return _run(points, recording.odometry[rows])


def _run(points: list[Singles], odometry_poses: Floats) -> Run:
    state, reports, matching, seconds = start(), list[SlamReport](), list[float](), list[float]()
    last = odometry_poses[0]
    for k, (seen, pose) in enumerate(zip(points, odometry_poses, strict=True)):
        if k:
            matching.append(_match_s(state, between(last, pose), seen))
        last, began_s = pose, time.process_time()
        scan = Scan(seen, normals(seen, CENTER), CENTER)
        state, report = step(SLAM, state, float(k), pose, scan)
        seconds.append(time.process_time() - began_s)
        reports.append(report)
    began_s = time.process_time()
    state = refine_graph(SLAM, state)
    return Run(state, reports, matching, seconds, time.process_time() - began_s)


def _match_s(state: SlamState, moved: Floats, points: Singles) -> float:
    """What it costs to find a scan's normals and its pose: the front end without keeping anything."""
    began_s = time.process_time()
    scan, grids = Scan(points, normals(points, CENTER), CENTER), state.active[0].grids
    track_scan(SLAM.matching, grids, state.local_pose, moved, scan, state.usual_fit)
    return time.process_time() - began_s


def _flat(seeds: int) -> Iterable[Figure]:
    """The simulated flat: how far its map is from the true walls, for the worst of some seeds, and what it costs."""
    truth, walls = poses_along(TOUR), furnished_flat()
    medians, p95s, poses, open_loops = list[float](), list[float](), list[float](), 0
    matching, seconds = list[float](), list[float]()
    for seed in range(-1, seeds):
        lidar = Lidar(walls, seed + 1)
        done = _run([lidar.points(pose) for pose in truth], odometry(truth, seed + 1))
        if seed < 0:  # compiles, and warms caches
            continue
        off = walls_off_m(done.state, truth, walls)
        medians.append(float(np.median(off)))
        p95s.append(float(np.percentile(off, 95)))
        poses.append(float(off_m(done.poses, truth).max()))
        seconds += done.step_s
        matching += done.front_end_s
        open_loops += poses[-1] > 0.1
    yield Figure(f"flat, walls, median, worst of {seeds}", max(medians), "m", WALLS_M)
    yield Figure(f"flat, walls, p95, worst of {seeds}", max(p95s), "m", WALLS_P95_M)
    yield Figure(f"flat, largest error of a pose, worst of {seeds}", max(poses), "m")
    yield Figure("flat, drives with a loop left open", open_loops, "", 0)
    yield Figure("flat, matching 270 beams, median", 1e3 * float(np.median(matching)), "ms", FRONT_END_MS)
    yield Figure("flat, at 10 Hz, all of it", 10 * float(np.mean(seconds)), "core", CORE_AT_10_HZ)
    release_libraries()
    yield Figure("flat, memory of this process", psutil.Process().memory_info().rss / 1e6, "MB", MEMORY_MB)


def _scored(recording: Recording, found: Score) -> Iterable[Figure]:
    kind = "official" if recording.is_official else "pseudo"
    target = PSEUDO_M
    if recording.is_official:
        target = OFFICIAL_DENSE_M if recording.is_dense else OFFICIAL_SPARSE_M
    name, classic = f"{recording.name}, {found.relations} {kind} relations", CLASSIC.get(recording.name, "")
    yield Figure(name, found.translation_m, "m", target, classic)
    dense_and_official = recording.is_official and recording.is_dense
    yield Figure(
        f"{recording.name}, rotation", found.rotation_deg, "deg", OFFICIAL_DEG if dense_and_official else None
    )


def _costs(name: str, done: Run) -> Iterable[Figure]:
    target = FRONT_END_MS if name.endswith("-dense") else None
    yield Figure(f"{name}, matching a scan, median", 1e3 * float(np.median(done.front_end_s)), "ms", target)
    yield Figure(f"{name}, all of a step, mean", 1e3 * float(np.mean(done.step_s)), "ms")
    yield Figure(f"{name}, the last touch", done.finish_s, "s")


def _told(recording: Recording, done: Run) -> str:
    modes = [str(report.mode) for report in done.reports]
    counts = ", ".join(f"{mode} {modes.count(mode)}" for mode in sorted(set(modes)))
    loops = int(done.state.edges.loop.sum())
    fit = float(np.median([report.fit for report in done.reports]))
    return f"{recording.name}: {len(done.reports)} scans ({counts}), {loops} loops, fit {fit:.2f} (median)"


def _write(path: Path, recording: Recording, poses: Floats) -> None:
    """``k,x,y,theta`` (the number of the scan), or for dense scans ``row,x,y,theta`` (the row of the odometry)."""
    path.parent.mkdir(parents=True, exist_ok=True)
    keys = recording.rows if recording.is_dense else range(len(poses))
    lines = [
        f"{key},{x:.6f},{y:.6f},{heading:.6f}" for key, (x, y, heading) in zip(keys, poses, strict=False)
    ]
    heading = "row,x,y,theta" if recording.is_dense else "k,x,y,theta"
    path.write_text("\n".join([heading, *lines]) + "\n", encoding="utf-8")
