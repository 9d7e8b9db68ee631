"""A lidar's motions between scans, by matching each scan with those around it.

At rest several turns are taken together, and no beam needs a correction for motion. In motion each turn is corrected by
the wheels, so a fit goes twice over the scans: with the parameters before, and with those that came of it.
"""

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.mapping.algorithms.correlate import Window, search
from chefbotd.components.mapping.algorithms.local_map import LocalMap, empty, insert_scan
from chefbotd.components.mapping.algorithms.refine import Fit, Prior, polish
from chefbotd.components.mapping.algorithms.surfaces import Singles, normals
from chefbotd.core.poses import between, compose, invert
from chefbotd.core.record import Record

NOISE_M = 0.01
"""The laser's noise: that of the data sheets' accuracy at short range."""

SENSOR = np.zeros(2)
Flags: TypeAlias = NDArray[np.bool_]

LEAST_POINTS = 60
SEARCHED = 250
"""Points that the search looks at: of all directions, also where several turns were taken together."""

FITS_SHARE = 0.8
"""A scan of which less lies on what was seen before was not matched."""

WINDOW_M, WINDOW_RAD = 0.1, 0.05
WINDOW_M_PER_M, WINDOW_RAD_PER_RAD = 0.2, 0.06
MOST_RAD = 0.5
"""How far a scan is searched from where the wheels say, and how much more by travel and by turn."""

FIRST, WIDE = 6, Window(0.5, math.pi, 0.02, 0.005)
"""The first scans are searched far from where the wheels say: a wheel may be wired backwards, the mount be wrong."""

ROUNDS = 3
WEAK = Prior(np.zeros(3), np.diag([1e-2, 1e-2, 1e-2]))


class Keyframe(Record, frozen=True):
    """Where a lidar looked: the ``row`` of the poses by the wheels, points (n, 2) and normals in the lidar's frame."""

    row: int
    points: Singles
    facing: Singles


class Matched(Record, frozen=True):
    """Poses (k, 3) of the lidar in the frame of the first, their standard deviations (k, 3), and which were matched.

    ``rms_m`` is how far the points are from the surfaces.
    """

    poses: Floats
    sigmas: Floats
    is_good: Flags
    rms_m: float


def keyframe(row: int, scans: Sequence[Floats]) -> Keyframe | None:
    """One of one or several scans (n, 2) from the same place; None where too little was seen."""
    singles = [scan.astype(np.float32) for scan in scans]
    points = np.concatenate(singles) if singles else np.empty((0, 2), np.float32)
    if len(points) < LEAST_POINTS:
        return None
    return Keyframe(row, points, np.concatenate([normals(scan, SENSOR) for scan in singles]))


def match_scans(frames: Sequence[Keyframe], rolled: Floats, totals: Floats, memory: int) -> Matched:
    """The lidar's poses. ``rolled`` (k - 1, 3) is how it moved says the wheels, ``totals`` (k - 1, 2) travel and turn.

    Each scan is matched with the ``memory`` scans before it, and then once more with as many before and after it.
    """
    poses, sigmas = np.zeros((len(frames), 3)), np.full((len(frames), 3), 1e-3)
    is_good = np.ones(len(frames), bool)
    grids = _with(empty(), frames[0], poses[0])
    since = np.zeros(2)
    for k in range(1, len(frames)):
        if k > memory:
            grids = _around(frames, poses, range(k - memory, k), is_good)
        guess, since = compose(poses[k - 1], rolled[k - 1]), since + totals[k - 1]
        fit = _match(grids, frames[k], guess, _windows(k, *since.tolist()))
        is_good[k] = fit is not None
        poses[k] = guess if fit is None else fit.pose
        if fit is None:
            continue
        since = np.zeros(2)
        if k <= memory:
            grids = _with(grids, frames[k], poses[k])
    for _ in range(ROUNDS):
        rms_m = _refine(frames, poses, sigmas, is_good, memory)
    return Matched(poses, sigmas, is_good, rms_m)


def _refine(frames: Sequence[Keyframe], poses: Floats, sigmas: Floats, is_good: Flags, memory: int) -> float:
    """Match each scan with those before and after it, in place; how far its points are from the surfaces."""
    is_small = len(frames) <= memory + 1
    grids = _around(frames, poses, range(len(frames)), is_good) if is_small else empty()
    moved, off_m = poses.copy(), []
    for k in np.flatnonzero(is_good).tolist():
        if not is_small:
            grids = _around(
                frames, poses, range(max(k - memory, 0), min(k + memory + 1, len(frames))), is_good
            )
        fit = polish(grids, frames[k].points, frames[k].facing, poses[k], _near(poses[k]), NOISE_M)
        moved[k] = fit.pose
        off_m.append(fit.rms_m)
        sigmas[k] = np.sqrt(np.diag(invert(fit.information + WEAK.information)))
    poses[:] = between(moved[0], moved)
    return math.sqrt(float(np.mean(np.square(off_m)))) if off_m else math.inf


def _near(pose: Floats) -> Prior:
    return Prior(pose, WEAK.information)


def _windows(k: int, way_m: float, turn_rad: float) -> tuple[Window, ...]:
    """Where to search, after so much travel and turn since the last scan that was matched."""
    if k <= FIRST:
        return (WIDE,)
    narrow = Window(
        WINDOW_M + WINDOW_M_PER_M * min(way_m, 1.0), min(WINDOW_RAD + WINDOW_RAD_PER_RAD * turn_rad, MOST_RAD)
    )
    return narrow, WIDE


def _match(grids: LocalMap, frame: Keyframe, guess: Floats, windows: Sequence[Window]) -> Fit | None:
    """The pose in the first window that has one at which the scan fits."""
    some = frame.points[np.linspace(0, len(frame.points) - 1, SEARCHED).astype(np.int64)]
    for window in windows:
        best = search(grids, some, guess, window, points_at_most=SEARCHED)
        if best is None:
            continue
        fit = polish(grids, frame.points, frame.facing, best.pose, _near(best.pose), NOISE_M)
        if fit.share >= FITS_SHARE and fit.inliers >= LEAST_POINTS / 2:
            return fit
    return None


def _around(frames: Sequence[Keyframe], poses: Floats, chosen: Sequence[int], is_good: Flags) -> LocalMap:
    grids = empty()
    for k in chosen:
        if is_good[k]:
            grids = _with(grids, frames[k], poses[k])
    return grids


def _with(grids: LocalMap, frame: Keyframe, pose: Floats) -> LocalMap:
    return insert_scan(grids, pose, SENSOR, frame.points, frame.facing)
