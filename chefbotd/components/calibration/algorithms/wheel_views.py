"""What a lidar or the truth saw of a drive, as motions that the wheels are fitted to."""

from collections.abc import Sequence

import numpy as np

from chefbotd.components.calibration.algorithms.bundle import adjust_bundle
from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.rolling import Rolling, rests
from chefbotd.components.calibration.algorithms.scan_motion import Keyframe, Matched, keyframe, match_scans
from chefbotd.components.calibration.algorithms.wheel_fit import RecordedDrive, in_pieces
from chefbotd.components.calibration.algorithms.wheel_model import WheelModel
from chefbotd.core.events import TruthSimulated
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import ORIGIN
from chefbotd.core.poses import between, compose, row_of
from chefbotd.core.record import Record, replace
from chefbotd.perception.laser_scan import OdometryTrack, points_in_base

LEAST_STOPS = 6
SCANS_AT_MOST = 12
"""Turns of a stop that are taken together: more add little to a centimetre of noise over hundreds of beams."""

ALL_STOPS = 1000
MEMORY = 12
STEP_M, STEP_RAD = 0.25, 0.4
"""In motion, a scan is taken every so often."""

PIECES = (4, 16)
"""Scans over which the motion is compared, where the robot did not stop."""

TRUTH_PIECES_S, TRUTH_EVERY_S, TRUTH_SIGMA = (5.0, 20.0), 1.0, 1e-3


class LidarView(Record, frozen=True):
    """A drive as a lidar saw it: the motions, the lidar's poses, and how many of its scans were matched.

    ``range_offset_m`` is by how much the lidar reads too far; None where the scans do not say so.
    """

    drive: RecordedDrive
    matched: Matched
    is_stop_and_go: bool
    range_offset_m: float | None = None

    @property
    def share(self) -> float:
        """Of the scans, how many were matched, from 0 to 1."""
        return float(self.matched.is_good.mean())


def lidar_view(
    rolled: Rolling,
    track_m: float,
    radius_m: float,
    band_m: tuple[float, float],
    scans: Sequence[ScanMeasured],
    model: WheelModel,
    mount: Floats,
) -> LidarView | None:
    """The lidar's motions: from stop to stop, or where there are few, as it drove. None: there is too little of either.

    ``model`` and ``mount`` (3,) are what is thought of wheels and lidar so far: scans are searched near where they say,
    and corrected by them.
    """
    frames = _at_stops(rolled, rests(rolled, radius_m), band_m, scans)
    is_stop_and_go = len(frames) >= LEAST_STOPS
    if not is_stop_and_go:
        rolled, frames = _in_motion(rolled, track_m, band_m, scans, model, mount)
    if len(frames) < LEAST_STOPS:
        return None
    rows = np.array([frame.row for frame in frames])
    poses, totals = rolled.poses(model, track_m)[rows], rolled.totals(track_m)[rows]
    lidar_moved = between(mount, compose(between(poses[:-1], poses[1:]), mount))
    seen = match_scans(frames, lidar_moved, np.diff(totals, axis=0), ALL_STOPS if is_stop_and_go else MEMORY)
    offset_m = None
    if is_stop_and_go:
        seen, offset_m = _by_walls(frames, seen)
    return LidarView(
        _drive(rolled, rows, seen, is_stop_and_go=is_stop_and_go), seen, is_stop_and_go, offset_m
    )


def _by_walls(frames: Sequence[Keyframe], seen: Matched) -> tuple[Matched, float | None]:
    """The poses as the walls say, and the lidar's range offset if they say that; as they are where walls are few."""
    good = np.flatnonzero(seen.is_good)
    if len(good) < LEAST_STOPS:
        return seen, None
    begin = seen.poses[good[0]]
    bundle = adjust_bundle([frames[k] for k in good.tolist()], between(begin, seen.poses[good]))
    if bundle is None:
        return seen, None
    poses = seen.poses.copy()
    poses[good] = compose(begin, bundle.poses)
    return replace(seen, poses=poses), bundle.offset_m if bundle.is_believed else None


def _drive(rolled: Rolling, rows: np.ndarray, seen: Matched, *, is_stop_and_go: bool) -> RecordedDrive:
    good = np.flatnonzero(seen.is_good)
    if is_stop_and_go:
        i, j = np.arange(len(good) - 1), np.arange(1, len(good))
        motion, shares = between(seen.poses[good[i]], seen.poses[good[j]]), np.ones(len(i))
    else:
        i, j, motion, shares = in_pieces(seen.poses[good], PIECES, 1)
        shares = shares * len(good) / 4
    sigmas = np.hypot(seen.sigmas[good][i], seen.sigmas[good][j])
    left_m, right_m, rows = np.diff(rolled.left_m), np.diff(rolled.right_m), rows[good]
    return RecordedDrive("lidar", "", left_m, right_m, rows[i], rows[j], motion, sigmas, shares)


def _at_stops(
    rolled: Rolling,
    spans: Sequence[tuple[float, float]],
    band_m: tuple[float, float],
    scans: Sequence[ScanMeasured],
) -> list[Keyframe]:
    frames = []
    for begin_s, end_s in spans:
        inside = [one for one in scans if begin_s <= _began_s(one) and one.scan.stamp_s <= end_s]
        seen = [_points(band_m, one) for one in inside[-SCANS_AT_MOST:]]
        frame = keyframe(rolled.row(end_s), seen)
        if frame is not None:
            frames.append(frame)
    return frames


def _began_s(measured: ScanMeasured) -> float:
    after_s = measured.scan.after_s
    return measured.scan.stamp_s + float(after_s.min() if len(after_s) else 0.0)


STILL = OdometryTrack(np.zeros(1), np.zeros((1, 3)))


def _points(band_m: tuple[float, float], measured: ScanMeasured, track: OdometryTrack = STILL) -> Floats:
    """What a turn shows, (n, 2) in the lidar's frame at the time of its stamp; the track is that of the lidar."""
    return points_in_base(band_m, ORIGIN, measured.scan, track)


def _in_motion(
    rolled: Rolling,
    track_m: float,
    band_m: tuple[float, float],
    scans: Sequence[ScanMeasured],
    model: WheelModel,
    mount: Floats,
) -> tuple[Rolling, list[Keyframe]]:
    """Scans every so often, corrected for the motion by the wheels."""
    begin_s, end_s = rolled.stamp_s[0], rolled.stamp_s[-1]
    inside = [one for one in scans if begin_s <= _began_s(one) and one.scan.stamp_s <= end_s]
    rolled = rolled.at(np.array([one.scan.stamp_s for one in inside]))
    totals = rolled.totals(track_m)
    poses = compose(rolled.poses(model, track_m), mount)
    track, frames, last = OdometryTrack(rolled.stamp_s, poses), list[Keyframe](), np.full(2, -np.inf)
    for one in inside:
        row = rolled.row(one.scan.stamp_s)
        since = totals[row] - last
        if since[0] < STEP_M and since[1] < STEP_RAD:
            continue
        frame = keyframe(row, [_points(band_m, one, track)])
        if frame is not None:
            frames.append(frame)
            last = totals[row]
    return rolled, frames


def truth_view(rolled: Rolling, truth: Sequence[TruthSimulated]) -> RecordedDrive | None:
    """The robot's own motions as the truth has them; None where there is none of a drive."""
    inside = [one for one in truth if rolled.stamp_s[0] <= one.stamp_s <= rolled.stamp_s[-1]]
    if len(inside) < 2:
        return None
    stamps = np.array([one.stamp_s for one in inside])
    rolled = rolled.at(stamps)
    poses = np.array([row_of(one.world_from_base) for one in inside])
    cycle_s = float(np.median(np.diff(stamps)))
    lengths = [max(round(piece_s / cycle_s), 1) for piece_s in TRUTH_PIECES_S]
    i, j, motion, shares = in_pieces(poses, lengths, max(round(TRUTH_EVERY_S / cycle_s), 1))
    rows = np.searchsorted(rolled.stamp_s, stamps)
    sigmas = np.full((len(i), 3), TRUTH_SIGMA)
    return RecordedDrive(
        "truth", "", np.diff(rolled.left_m), np.diff(rolled.right_m), rows[i], rows[j], motion, sigmas, shares * len(i)
    )  # fmt: skip
