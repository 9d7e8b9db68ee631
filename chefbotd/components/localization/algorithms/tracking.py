"""Tracks the pose: odometry, then the scan matched against the map, each with its covariance.

The match starts where the odometry leads. If the scan fits there as usual, it is only polished (Gauss-Newton); if not, a
window is searched: three sigmas of the prediction, and then a metre around. What a scan says of the pose is weighed
against the prediction as in a Kalman filter. Along a bare corridor a scan says nothing, and the covariance grows.
"""

import math
from typing import Final

import numpy as np

from chefbotd.components.localization.algorithms.agreement import Agreement, agreement
from chefbotd.components.mapping.algorithms.correlate import Window, search
from chefbotd.components.mapping.algorithms.local_map import LocalMap
from chefbotd.components.mapping.algorithms.parameters import SLAM
from chefbotd.components.mapping.algorithms.refine import Fit, Prior, polish
from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.poses import Floats, carried_covariance, compose, invert, turn_covariance, wrap
from chefbotd.core.record import Record, replace

LASER_NOISE_M: Final = SLAM.matching.laser_noise_m
ODOMETRY_M_PER_ROOT_M: Final = 0.1
ODOMETRY_M_PER_ROOT_RAD: Final = 0.03
ODOMETRY_RAD_PER_ROOT_RAD: Final = 0.1
ODOMETRY_RAD_PER_ROOT_M: Final = 0.05
MAX_JUMP_M: Final = SLAM.matching.max_jump_m
"""No odometry is believed that says more between two scans."""

MAP_SIGMA_M: Final = 0.012
MAP_SIGMA_RAD: Final = 0.004
"""One sigma of the map's own errors, which more beams do not average out."""

NORMAL_SIGMA_RAD: Final = 0.1
"""One sigma of a surface's direction in the map: what a wall tells along itself is less than this."""

LEAST_FIT: Final = 0.55
"""A fit below is one of a wrong pose, or of a map that is no longer true."""

MIN_OVERLAP: Final = SLAM.matching.min_overlap
"""With less of the scan on known ground, it says nothing about where it is."""

SUSPICIOUS_DROP: Final = SLAM.matching.suspicious_drop
"""A fit that is so much worse than lately has the pose looked for further around."""

BETTER_FIT: Final = SLAM.matching.better_share
"""What is found a metre around must fit so much better."""

WHEEL_SLIP_FIT: Final = SLAM.matching.wheel_slip_share
WHEEL_SLIP_WINDOW_M: Final = SLAM.matching.wheel_slip_window_m
WHEEL_SLIP_WINDOW_RAD: Final = SLAM.matching.wheel_slip_window_rad
POLISH_WITHIN_M: Final = 0.08
POLISH_WITHIN_RAD: Final = 0.08
"""A prediction that is surer than this needs no search."""

MAX_WINDOW_M: Final = 1.5
MAX_WINDOW_RAD: Final = 1.0


PENALTY = 0.01
"""What a pose one sigma off the prediction loses in score."""

CAPTURE = 0.3
"""A match of a search that scores less is none."""

LEAST_WINDOW_M, LEAST_WINDOW_RAD = 0.15, 0.15


class PoseEstimate(Record, frozen=True):
    """A pose (x, y, heading) with its covariance (3, 3), in ``map``."""

    pose: Floats
    covariance: Floats


class TrackedPose(Record, frozen=True):
    """Where the robot is and how the scan agrees there; ``moved`` tells a pose found away from the prediction.

    ``matched`` is whether the scan was used. If it was not, the estimate is the prediction.
    """

    estimate: PoseEstimate
    agreement: Agreement
    matched: bool
    moved: bool = False


def motion_noise(moved: Floats) -> Floats:
    """The covariance (3, 3) of such a motion, in the frame it began in, where odometry does not tell its own."""
    way_m, turn_rad = math.hypot(moved[0], moved[1]), abs(float(moved[2]))
    place = ODOMETRY_M_PER_ROOT_M**2 * way_m + ODOMETRY_M_PER_ROOT_RAD**2 * turn_rad
    turn = ODOMETRY_RAD_PER_ROOT_RAD**2 * turn_rad + ODOMETRY_RAD_PER_ROOT_M**2 * way_m
    return np.diag([place, place, turn])


def predict_pose(last: PoseEstimate, moved: Floats, noise: Floats | None = None) -> PoseEstimate:
    """Where the robot is after such a motion, in the frame of the last pose; ``noise`` is the motion's covariance."""
    if math.hypot(moved[0], moved[1]) > MAX_JUMP_M:
        return last
    pose = compose(last.pose, moved)
    added = motion_noise(moved) if noise is None else noise
    grown = carried_covariance(last.covariance, pose[0] - last.pose[0], pose[1] - last.pose[1])
    return PoseEstimate(pose, grown + turn_covariance(added, float(last.pose[2])))


def track_pose(
    grids: LocalMap,
    expected: PoseEstimate,
    scan: Scan,
    usual_fit: float = 1.0,
    *,
    may_search: bool = True,
) -> TrackedPose:
    """The scan matched against the map about the prediction; ``may_search`` allows a look further around."""
    track = _near(grids, expected, scan)
    at_least = max(usual_fit - SUSPICIOUS_DROP, LEAST_FIT)
    if may_search and track.agreement.fit < at_least and track.agreement.overlap >= MIN_OVERLAP:
        for elsewhere in (_in_window(grids, expected, scan), _around(grids, expected, scan)):
            if elsewhere is not None and elsewhere.agreement.fit >= track.agreement.fit + BETTER_FIT:
                track = elsewhere
                break
    if track.agreement.fit < LEAST_FIT or track.agreement.overlap < MIN_OVERLAP:
        return TrackedPose(expected, track.agreement, matched=False)
    return track


def _near(grids: LocalMap, expected: PoseEstimate, scan: Scan) -> TrackedPose:
    sigma_m, sigma_rad = sigmas(expected.covariance)
    if sigma_m > POLISH_WITHIN_M or sigma_rad > POLISH_WITHIN_RAD:
        track = _in_window(grids, expected, scan)
        if track is not None:
            return track
    return _polish_pose(grids, expected, expected.pose, scan)


def sigmas(covariance: Floats) -> tuple[float, float]:
    """The largest sigma of the place in any direction (m), and that of the heading (rad)."""
    middle, half = (covariance[0, 0] + covariance[1, 1]) / 2, (covariance[0, 0] - covariance[1, 1]) / 2
    largest = middle + math.hypot(half, covariance[0, 1])
    return math.sqrt(max(largest, 0.0)), math.sqrt(max(float(covariance[2, 2]), 0.0))


def _in_window(grids: LocalMap, expected: PoseEstimate, scan: Scan) -> TrackedPose | None:
    """Search three sigmas of the prediction."""
    sigma_m, sigma_rad = sigmas(expected.covariance)
    half_m, half_rad = max(3 * sigma_m, LEAST_WINDOW_M), max(3 * sigma_rad, LEAST_WINDOW_RAD)
    window = Window(
        min(half_m, MAX_WINDOW_M),
        min(half_rad, MAX_WINDOW_RAD),
        PENALTY * 9 / half_m**2,
        PENALTY * 9 / half_rad**2,
    )
    match = search(grids, scan.points, expected.pose, window, above=CAPTURE)
    return None if match is None else _polish_pose(grids, expected, match.pose, scan)


def _around(grids: LocalMap, expected: PoseEstimate, scan: Scan) -> TrackedPose | None:
    """Search a metre around, whatever the odometry says: the wheels slipped, or the robot was pushed."""
    window = Window(WHEEL_SLIP_WINDOW_M, WHEEL_SLIP_WINDOW_RAD)
    match = search(grids, scan.points, expected.pose, window, above=CAPTURE)
    if match is None:
        return None
    vague = np.diag([WHEEL_SLIP_WINDOW_M**2, WHEEL_SLIP_WINDOW_M**2, WHEEL_SLIP_WINDOW_RAD**2])
    at = PoseEstimate(match.pose, vague)
    track = _polish_pose(grids, at, match.pose, scan)
    sound = track.agreement.fit >= WHEEL_SLIP_FIT and track.agreement.overlap >= 2 * MIN_OVERLAP
    return replace(track, moved=True) if sound else None


def _polish_pose(grids: LocalMap, expected: PoseEstimate, begin: Floats, scan: Scan) -> TrackedPose:
    information = invert(expected.covariance + 1e-8 * np.eye(3))
    fit = polish(grids, scan.points, scan.facing, begin, Prior(expected.pose, information), LASER_NOISE_M)
    estimate = fuse_match(expected, fit, information)
    return TrackedPose(estimate, agreement(grids, estimate.pose, scan), matched=True)


def fuse_match(expected: PoseEstimate, fit: Fit, information: Floats) -> PoseEstimate:
    """The prediction, of this information, corrected by the match: as far as the scan says something, and no further."""
    off = np.array([*(fit.pose[:2] - expected.pose[:2]), wrap(fit.pose[2:] - expected.pose[2:])[0]])
    noise = np.array([MAP_SIGMA_M**2, MAP_SIGMA_M**2, MAP_SIGMA_RAD**2])
    covariance, shift = np.empty((3, 3)), np.empty(3)
    pretended = math.sin(NORMAL_SIGMA_RAD) ** 2
    _fuse(information, fit.information, pretended, noise, off, covariance, shift)
    pose = expected.pose + shift
    return PoseEstimate(np.array([pose[0], pose[1], wrap(pose[2:])[0]]), covariance)


@kernel
def _fuse(
    prior: Floats,
    measured: Floats,
    pretended: float,
    noise: Floats,
    off: Floats,
    covariance: Floats,
    shift: Floats,
) -> None:
    """Fill ``covariance`` and ``shift``: the prior's information and the match's, less what only noise seems to say.

    A wall whose direction is not known exactly seems to tell something along itself, too: that share ``pretended`` of
    what all surfaces tell counts in no direction. ``noise`` are the variances of the map's own errors.
    """
    scan_information, spread = np.empty((3, 3)), np.empty((3, 3))
    xx, xy, yy = measured[0, 0], measured[0, 1], measured[1, 1]
    middle, half = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy)
    turn = 0.5 * math.atan2(2 * xy, xx - yy)
    along = math.sqrt(max(middle + half - pretended * 2 * middle, 0.0) / max(middle + half, 1e-9))
    across = math.sqrt(max(middle - half - pretended * 2 * middle, 0.0) / max(middle - half, 1e-9))
    cos, sin = math.cos(turn), math.sin(turn)
    scale = np.eye(3)
    scale[0, 0] = along * cos * cos + across * sin * sin
    scale[1, 1] = along * sin * sin + across * cos * cos
    scale[0, 1] = scale[1, 0] = (along - across) * cos * sin
    _product(scale, measured, spread)
    _product(spread, scale, scan_information)
    for k in range(3):
        scan_information[k, k] += 1e-6
    _invert(scan_information, spread)
    for k in range(3):
        spread[k, k] += noise[k]
    _invert(spread, scan_information)
    _invert(prior + scan_information, covariance)
    for r in range(3):
        shift[r] = 0.0
        for c in range(3):
            for k in range(3):
                shift[r] += covariance[r, c] * scan_information[c, k] * off[k]


@kernel
def _product(a: Floats, b: Floats, into: Floats) -> None:
    for r in range(3):
        for c in range(3):
            into[r, c] = a[r, 0] * b[0, c] + a[r, 1] * b[1, c] + a[r, 2] * b[2, c]


@kernel
def _invert(a: Floats, into: Floats) -> None:
    """The inverse of a symmetric positive definite matrix of three rows, by its cofactors; it is symmetric exactly."""
    into[0, 0] = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
    into[0, 1] = a[0, 2] * a[2, 1] - a[0, 1] * a[2, 2]
    into[0, 2] = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    into[1, 1] = a[0, 0] * a[2, 2] - a[0, 2] * a[2, 0]
    into[1, 2] = a[0, 2] * a[1, 0] - a[0, 0] * a[1, 2]
    into[2, 2] = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    determinant = a[0, 0] * into[0, 0] + a[1, 0] * into[0, 1] + a[2, 0] * into[0, 2]
    for r in range(3):
        for c in range(r, 3):
            into[r, c] /= determinant
            into[c, r] = into[r, c]
