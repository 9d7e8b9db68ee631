"""Fits the wheels' parameters, and the mount of what saw the motion, to measured motions between two times.

What saw it is a lidar, whose mount is found too (Censi, Franchi, Marchionni and Oriolo, "Simultaneous calibration of
odometry and sensor parameters for mobile robots", IEEE Transactions on Robotics 29(2), 2013), or a motion capture
system, whose yaw is off by a constant in each drive.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.calibration.algorithms.least_squares import Floats, Solution, loss, solve
from chefbotd.components.calibration.algorithms.wheel_model import (
    NOMINAL,
    PLAY_SIGMA_M,
    WheelModel,
    dead_reckon,
    flanks,
)
from chefbotd.core.poses import between, compose, wrap
from chefbotd.core.record import Record, replace

Indices = NDArray[np.int64]

PLAY = 7
"""The place of the play among the parameters, after those of ``WheelFit``."""

TRAVEL_M2_PER_M, TURN_RAD2_PER_RAD = 6e-7, 2.5e-5
"""How wheels on a hard floor scatter: 30 runs of the OptiOdom recordings."""

SPIN_SIGMA = 0.02
"""How much the track is expected to depend on the share of spin: drives that do not show it leave it at zero."""

WORSE = 1.1
"""A richer model may make no kind of drive so much worse, when it was fitted without that kind."""


class RecordedDrive(Record, frozen=True):
    """A drive and what was seen of it.

    ``left_m`` and ``right_m`` (n,): how far the sides rolled in each step with the configured radii. Between the steps
    ``first`` and ``last`` (m,) the sensor moved by ``motion`` (m, 3), as seen from where it was, with the standard
    deviations ``sigmas`` (m, 3) in m and rad. ``shares`` (m,) are how much each motion counts. Drives of one ``kind``
    consist of the same motions.
    """

    name: str
    kind: str
    left_m: Floats
    right_m: Floats
    first: Indices
    last: Indices
    motion: Floats
    sigmas: Floats
    shares: Floats


class WheelFit(Record, frozen=True):
    """The parameters with their covariance: left, right, track, spin, then x, y and yaw of the mount.

    Those that were not fitted have a variance of zero. ``play_m`` is how far a side's encoders turn in vain, at the rim,
    when its direction changes; the covariance has its share of what is not known of it.
    """

    model: WheelModel
    mount: Floats
    covariance: Floats
    is_determined: bool
    play_m: float = 0.0

    @property
    def sigmas(self) -> Floats:
        """The standard deviations of the parameters."""
        sigmas: Floats = np.sqrt(np.diag(self.covariance))
        return sigmas

    def deviation(self, slope: Sequence[float]) -> float:
        """The standard deviation of what changes by ``slope`` (7,) with the parameters."""
        row = np.array(slope)
        return math.sqrt(max(float(row @ self.covariance @ row), 0.0))


def fit(
    track_m: float,
    drives: Sequence[RecordedDrive],
    *,
    mount: Floats | None = None,
    start: WheelModel = NOMINAL,
    is_rich: bool = False,
    knows_wheels: bool = False,
    has_play: bool = False,
) -> WheelFit:
    """The parameters that explain the motions best, from ``start`` on.

    ``mount`` (3,) is where a sensor is thought to be; it is fitted too. Without it the motions are the robot's own, but
    for a yaw of each drive. ``is_rich`` fits how the track depends on the share of spin. Who ``knows_wheels`` has
    the mount alone fitted. ``has_play`` fits the play between encoders and wheels, too: without it, radii of a robot
    that drives to and fro come out too small.
    """
    of_wheels = [] if knows_wheels else [0, 1, 2, *([3] if is_rich else [])]
    columns = of_wheels + ([4, 5, 6] if mount is not None else [])
    columns += [PLAY] if has_play else []
    placed = np.zeros(3) if mount is None else mount
    whole = np.array([start.left, start.right, start.track, start.spin, *placed, 0.0])
    in_play = [(flanks(drive.left_m), flanks(drive.right_m)) for drive in drives] if has_play else []
    whitenings = [_whitening(track_m, drive, mount) for drive in drives]

    def residuals(values: Floats) -> Floats:
        parameters = whole.copy()
        parameters[columns] = values
        model, seen_from = (
            WheelModel(*parameters[:4].tolist()),
            parameters[4:PLAY] if mount is not None else None,
        )
        rolled = (
            [_without(*one, parameters[PLAY]) for one in zip(drives, in_play, strict=True)]
            if in_play
            else drives
        )
        off = [difference(track_m, model, drive, seen_from) for drive in rolled]
        return np.concatenate([_white(one, by) for one, by in zip(whitenings, off, strict=True)])

    free = np.full(len(whole), np.inf)
    free[3], free[PLAY] = SPIN_SIGMA, PLAY_SIGMA_M
    shares = np.concatenate([drive.shares for drive in drives])
    solution = solve(
        residuals, whole[columns], prior_sigmas=free[columns], shares=shares, groups=_groups(drives)
    )
    return _make_fit(solution, whole, columns)


def _make_fit(solution: Solution, whole: Floats, columns: list[int]) -> WheelFit:
    whole[columns] = solution.values
    covariance = np.zeros((len(whole), len(whole)))
    covariance[np.ix_(columns, columns)] = solution.covariance
    whole[6] = wrap(whole[6:PLAY])[0]
    model = WheelModel(*whole[:4].tolist())
    without = covariance[:PLAY, :PLAY]
    return WheelFit(model, whole[4:PLAY].copy(), without, solution.is_determined, float(whole[PLAY]))


def without_play(drive: RecordedDrive, play_m: float) -> RecordedDrive:
    """The drive with what its wheels rolled, if its encoders turn by so much in vain when a direction changes."""
    return _without(drive, (flanks(drive.left_m), flanks(drive.right_m)), play_m)


def _without(drive: RecordedDrive, sides: tuple[Floats, Floats], play_m: float) -> RecordedDrive:
    left, right = (np.diff(flank) * play_m / 2 for flank in sides)
    return replace(drive, left_m=drive.left_m - left, right_m=drive.right_m - right)


def difference(track_m: float, model: WheelModel, drive: RecordedDrive, mount: Floats | None) -> Floats:
    """What the wheels say less what was seen (m, 3), in the sensor's frame; without a mount, at the best yaw."""
    poses = dead_reckon(model, track_m, drive.left_m, drive.right_m)
    rolled = between(poses[drive.first], poses[drive.last])
    seen = drive.motion
    if mount is None:
        seen = _align_frames(seen, rolled, drive.sigmas)
    else:
        rolled = between(mount, compose(rolled, mount))
    off = rolled - seen
    off[:, 2] = wrap(off[:, 2])
    return off


def _align_frames(seen: Floats, rolled: Floats, sigmas: Floats) -> Floats:
    """The motions in a frame that is turned so that they fit those of the wheels best."""
    weights = sigmas[:, 0] ** -2.0
    across = weights @ (seen[:, 0] * rolled[:, 1] - seen[:, 1] * rolled[:, 0])
    along = weights @ (seen[:, 0] * rolled[:, 0] + seen[:, 1] * rolled[:, 1])
    turned = compose(np.array([0.0, 0.0, math.atan2(across, along)]), seen)
    turned[:, 2] = seen[:, 2]
    return turned


def _whitening(track_m: float, drive: RecordedDrive, mount: Floats | None) -> Floats:
    """Matrices (m, 3, 3) that turn the differences into independent ones of standard deviation 1.

    Wheels scatter in their travel and in their turns. An error of heading swings what was driven after it: so place and
    heading at the end of a motion belong together. The sums over the steps of a motion are differences of running sums.
    """
    base = dead_reckon(NOMINAL, track_m, drive.left_m, drive.right_m)
    poses = compose(base, np.zeros(3) if mount is None else mount)
    way_m, turn_rad = (
        np.abs(drive.left_m) + np.abs(drive.right_m),
        np.abs(drive.right_m - drive.left_m) / track_m,
    )
    heading = TRAVEL_M2_PER_M * way_m / track_m**2 + TURN_RAD2_PER_RAD * turn_rad
    crosswise = np.stack([-poses[1:, 1], poses[1:, 0]], axis=1)
    none, once, twice, ahead = (
        _between(sums, drive)
        for sums in (
            heading,
            heading[:, None] * crosswise,
            heading[:, None, None] * crosswise[:, :, None] * crosswise[:, None, :],
            TRAVEL_M2_PER_M * way_m / 4,
        )
    )
    end = np.stack([-poses[drive.last, 1], poses[drive.last, 0]], axis=1)
    mixed = end[:, :, None] * once[:, None, :]
    covariance = np.zeros((len(end), 3, 3))
    covariance[:, :2, :2] = none[:, None, None] * end[:, :, None] * end[:, None, :] + twice
    covariance[:, :2, :2] -= mixed + mixed.transpose(0, 2, 1)
    covariance[:, :2, 2] = covariance[:, 2, :2] = none[:, None] * end - once
    covariance[:, 2, 2] = none
    covariance[:, [0, 1], [0, 1]] += ahead[:, None]
    turned = _rotations(poses[drive.first, 2])
    local = turned.transpose(0, 2, 1) @ covariance @ turned
    local[:, range(3), range(3)] += drive.sigmas**2
    if mount is None:  # the lag and the yaw of a truth swing the whole travel, and otherwise than wheels do
        swing_m = _between(way_m, drive) / 4
        local *= np.eye(3)
        local[:, [0, 1], [0, 1]] = (ahead + swing_m**2 * none)[:, None] + drive.sigmas[:, :2] ** 2
    whitening: Floats = np.linalg.inv(np.linalg.cholesky(local))
    return whitening


def _between(steps: Floats, drive: RecordedDrive) -> Floats:
    """The sums of the steps of each motion."""
    sums = np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)])
    total: Floats = sums[drive.last] - sums[drive.first]
    return total


def _rotations(heading_rad: Floats) -> Floats:
    """Matrices (m, 3, 3) that turn x and y, and leave a heading as it is."""
    turned = np.zeros((len(heading_rad), 3, 3))
    turned[:, 0, 0] = turned[:, 1, 1] = np.cos(heading_rad)
    turned[:, 1, 0] = np.sin(heading_rad)
    turned[:, 0, 1] = -turned[:, 1, 0]
    turned[:, 2, 2] = 1.0
    return turned


def _white(whitening: Floats, off: Floats) -> Floats:
    white: Floats = np.einsum("mij,mj->mi", whitening, off)
    return white


def _groups(drives: Sequence[RecordedDrive]) -> Indices | None:
    """Motions whose errors go together: those of one drive; of a single drive, each is by itself."""
    if len(drives) == 1:
        return None
    return np.repeat(np.arange(len(drives)), [len(drive.first) for drive in drives])


def needs_rich(track_m: float, drives: Sequence[RecordedDrive]) -> bool:
    """Whether the richer model predicts kinds of drives that it was not fitted to better than the plain one.

    Of each kind the others are asked. No kind may become much worse.
    """
    ordered = sorted(drives, key=lambda drive: drive.kind)
    kinds = [list(members) for _, members in groupby(ordered, key=lambda drive: drive.kind)]
    if len(kinds) < 2:
        return False
    costs = np.array(
        [[_unseen(track_m, drives, kind, is_rich) for is_rich in (False, True)] for kind in kinds]
    )
    plain, rich = costs.T
    return bool((rich <= WORSE * plain).all() and rich.sum() < plain.sum())


def _unseen(
    track_m: float, drives: Iterable[RecordedDrive], kind: list[RecordedDrive], is_rich: bool
) -> float:
    """The mean loss of drives that the model was not fitted to."""
    others = [drive for drive in drives if drive.kind != kind[0].kind]
    model = fit(track_m, others, is_rich=is_rich).model
    off = [
        _white(_whitening(track_m, drive, None), difference(track_m, model, drive, None)) for drive in kind
    ]
    return float(np.mean([drive.shares @ loss(one) for drive, one in zip(kind, off, strict=True)]))


def in_pieces(poses: Floats, lengths: Sequence[int], every: int) -> tuple[Indices, Indices, Floats, Floats]:
    """Motions between rows of ``poses`` (n, 3) that are so many rows apart: one from each ``every``th row on.

    A length of 0 is the way from the first row. Returns first, last, motion, and shares that make each length count as
    much as another.
    """
    end, shares = len(poses) - 1, [np.zeros(0)]
    first, last = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for length in (length for length in lengths if length < end):
        ends = np.arange(end, length, -every)
        first.append(ends - length if length else np.zeros_like(ends))
        last.append(ends)
        shares.append(np.full(len(ends), 1 / len(ends)))
    i, j = np.concatenate(first), np.concatenate(last)
    return i, j, between(poses[i], poses[j]), np.concatenate(shares)
