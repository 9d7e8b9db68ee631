"""Localization on recordings of real buildings: every other scan is mapped, and the others are localized."""

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.carmen import Recording
from benchmarks.figures import Figure
from benchmarks.slam import points_of
from chefbotd.components.localization.algorithms.localizer import LocalizationReport, advance_search, step
from chefbotd.components.localization.algorithms.searching import LocalizationMap, localization_map
from chefbotd.components.localization.algorithms.state import Localization, Odometry, PoseState
from chefbotd.components.mapping.algorithms.finish import refine_graph
from chefbotd.components.mapping.algorithms.occupancy import occupancy
from chefbotd.components.mapping.algorithms.parameters import SlamParameters
from chefbotd.components.mapping.algorithms.slam import step as slam_step
from chefbotd.components.mapping.algorithms.state import Scan, SlamState, start
from chefbotd.components.mapping.algorithms.surfaces import Singles, normals
from chefbotd.core.poses import Floats, between, compose
from tests.chefbotd.components.mapping.algorithms.slam.drives import Drive

SLAM = SlamParameters()
CENTER = np.zeros(2)
PERIOD_S = 0.5
"""Recorded times come in bursts; this is about what a robot at 0.7 m/s takes from one of these scans to the next."""

BETWEEN_SCANS = 8
"""Steps of a search for which there is time from one scan to the next: a fifth of it."""

P95_M, P95_DEG, SCAN_MS = 0.10, 2.0, 1.0


@dataclass(frozen=True, slots=True)
class Localized:
    """The reports of all scans that were not mapped, their errors (NaN where there is no pose), and seconds of each.

    ``off_m`` and ``off_deg`` are against SLAM over all, from the last mapped scan on. For ``rigid_m`` the two maps are
    laid on each other as a whole, so that what one of them is bent counts, too. ``within`` is the map; the scans
    ``points`` were taken at ``truth`` on it.
    """

    reports: list[LocalizationReport]
    off_m: Floats
    off_deg: Floats
    rigid_m: Floats
    step_s: list[float]
    within: LocalizationMap
    truth: Floats
    points: list[Singles]

    @property
    def found_at(self) -> int:
        """The number of the first scan with a pose; that of all scans if there is none."""
        return next(
            (k for k, report in enumerate(self.reports) if report.state is PoseState.LOCALIZED),
            len(self.reports),
        )

    @property
    def lost(self) -> int:
        """How many scans after that had no pose."""
        return int(np.isnan(self.off_m[self.found_at :]).sum())


def localized(recording: Recording, scans: int) -> Localized:
    """Map the even scans, and localize the odd ones on that map, against SLAM over all."""
    points = points_of(recording, scans)
    odometry = recording.odometry[list(recording.rows[:scans])]
    _, all_poses = _slam(points, odometry)
    half, half_poses = _slam(points[::2], odometry[::2])
    within = localization_map(occupancy(half.nodes))
    now, reports, seconds, poses = Localization(), list[LocalizationReport](), list[float](), list[Floats]()
    for k in range(1, len(points), 2):
        began_s = time.process_time()
        scan = _scan(points[k])
        now, report = step(within, now, PERIOD_S * k, Odometry(odometry[k]), scan)
        seconds.append(time.process_time() - began_s)
        for _ in range(BETWEEN_SCANS):
            now = advance_search(within, now)
        reports.append(report)
        there = report.map_from_base
        poses.append(np.full(3, np.nan) if there is None else there.pose)
    mapped = half_poses[: len(poses)]
    truth = compose(mapped, between(all_poses[::2][: len(poses)], all_poses[1::2]))
    error = between(truth, np.array(poses))
    rigid = between(all_poses[1::2], compose(_laid_on(half_poses, all_poses[::2]), np.array(poses)))
    off_m, rigid_m = (np.hypot(each[:, 0], each[:, 1]) for each in (error, rigid))
    off_deg = np.degrees(np.abs(error[:, 2]))
    return Localized(reports, off_m, off_deg, rigid_m, seconds, within, truth, points[1::2])


def _scan(points: Singles) -> Scan:
    return Scan(points, normals(points, CENTER), CENTER)


def _slam(points: list[Singles], odometry: Floats) -> tuple[SlamState, Floats]:
    """The map of these scans, and where each was."""
    state, reports = start(), []
    for k, (seen, pose) in enumerate(zip(points, odometry, strict=True)):
        state, report = slam_step(SLAM, state, float(k), pose, _scan(seen))
        reports.append(report)
    state = refine_graph(SLAM, state)
    return state, Drive(state, reports).poses()


def _laid_on(a: Floats, b: Floats) -> Floats:
    """``b_from_a`` that lays the places of one course on those of the other as well as can be (least squares)."""
    middle_a, middle_b = a[:, :2].mean(axis=0), b[:, :2].mean(axis=0)
    p, q = a[:, :2] - middle_a, b[:, :2] - middle_b
    turn = math.atan2((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum(), (p * q).sum())
    around = compose(np.array([0.0, 0.0, turn]), np.array([*-middle_a, 0.0]))
    return compose(np.array([*middle_b, 0.0]), around)


def figures(recording: Recording, found: Localized) -> list[Figure]:
    """What it reached; scans before the first pose do not count as lost."""
    known = ~np.isnan(found.off_m)
    off_m, off_deg = found.off_m[known], found.off_deg[known]
    if not len(off_m):
        return [Figure(f"{recording.name}, scans without a pose", len(found.reports), "", 0)]
    dense, name = recording.is_dense, recording.name
    return [
        Figure(f"{name}, error p95", float(np.percentile(off_m, 95)), "m", P95_M if dense else None),
        Figure(f"{name}, error p95", float(np.percentile(off_deg, 95)), "deg", P95_DEG if dense else None),
        Figure(f"{name}, error median", float(np.median(off_m)), "m"),
        Figure(f"{name}, largest error", float(off_m.max()), "m"),
        Figure(
            f"{name}, error p95, the maps laid on each other",
            float(np.percentile(found.rigid_m[known], 95)),
            "m",
        ),
        Figure(f"{name}, scans without a pose, once found", found.lost, "", 0 if dense else None),
        Figure(f"{name}, scans until it is found", found.found_at, ""),
        Figure(
            f"{name}, a scan, median", 1e3 * float(np.median(found.step_s)), "ms", SCAN_MS if dense else None
        ),
    ]


def told(recording: Recording, found: Localized) -> str:
    """A line about states and fit."""
    states = [str(report.state) for report in found.reports]
    counts = ", ".join(f"{state} {states.count(state)}" for state in sorted(set(states)))
    fits = [report.fit for report in found.reports if report.map_from_base is not None]
    share = (
        f"fit {np.median(fits):.2f} (median), {np.percentile(fits, 5):.2f} (worst 5 %)" if fits else "no fit"
    )
    return f"{recording.name}: {len(states)} scans ({counts}), {share}"


def write(path: Path, recording: Recording, found: Localized) -> None:
    """``row,x,y,theta``: the pose of each localized scan on the map, and its row of the odometry."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ["row,x,y,theta"]
    for k, report in enumerate(found.reports):
        if report.map_from_base is not None:
            x, y, heading = report.map_from_base.pose
            lines.append(f"{recording.rows[2 * k + 1]},{x:.6f},{y:.6f},{heading:.6f}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
