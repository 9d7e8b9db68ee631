"""The calibration of wheels and lidar mount: simulated robots that are drawn at random, and a real log (Intel).

Each simulated robot is wrong in everything within ``sim.true``'s bounds ("imperfect"), each by another seed, and its
wheels slip at random. The step ``wheels`` is carried out in a furnished flat; then the robot drives a square of 4 m both
ways. Of the Intel log (``carmen.py``), the wheels are fitted to the motions that scan matching alone finds in the first
half, and judged by the relations of the second half.
"""

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median

import numpy as np
from structlog.testing import capture_logs

from benchmarks.carmen import Recording, recordings
from benchmarks.figures import Figure, Outcome
from chefbotd.clock import run_virtual
from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.scan_motion import Keyframe, keyframe, match_scans
from chefbotd.components.calibration.algorithms.wheel_fit import RecordedDrive, fit, in_pieces
from chefbotd.components.calibration.algorithms.wheel_model import NOMINAL, WheelModel, dead_reckon
from chefbotd.components.calibration.algorithms.wheel_views import MEMORY, PIECES
from chefbotd.components.calibration.events import Status
from chefbotd.core.poses import between, wrap
from examples.calibrate import Calibrated, calibrate

FOLDER = Path(__file__).parents[2] / "shared" / "data" / "carmen"
SEEDS, QUICK_SEEDS = 20, 2
LEFT, RIGHT, TRACK = (f"chassis.{key}_multiplier" for key in ("left_radius", "right_radius", "track"))
MOUNT = tuple(f"lidar.lidar.mount_{key}" for key in ("x_m", "y_m", "yaw_rad"))
TARGETS = {"ratio": 0.05, "track": 0.1, "size": 0.1, "mount": 2.0, "mount yaw": 0.1}
UNITS = {"ratio": "%", "track": "%", "size": "%", "mount": "mm", "mount yaw": "deg"}
CHEFBOT_TRACK_M = 0.3
LOG = "intel-dense"
TRACK_M = 0.5
"""Of the wheels that odometry is turned back into. Any will do: only poses were logged."""

LOG_BAND_M = (0.1, 20.0)
LOG_SIGMAS = (0.03, 0.03, 0.01)
"""What matching leaves open over one to four centimetres (m, m, rad)."""

PLACE, HEADING = 0.15, 0.25


def run(*, quick: bool = False, folder: Path = FOLDER) -> Outcome:
    """Calibrate each robot, and the log if it is in the folder."""
    faults, robots = list[str](), list[Calibrated]()
    for seed in range(1, 1 + (QUICK_SEEDS if quick else SEEDS)):
        robot = _calibrated(seed)
        (result,) = robot.results
        if result.status is Status.PASSED:
            robots.append(robot)
        else:
            faults.append(f"seed {seed}: {result.status}, {result.reason}")
    log = next((one for one in recordings(folder) if one.name == LOG), None) if folder.is_dir() else None
    figures = (*_wheels(robots), *_squares(robots), *(_log(log) if log is not None else ()))
    remarks = tuple(_remark(robot) for robot in robots)
    skipped = () if log is not None else (f"the log is skipped: no {LOG} in {folder}",)
    return Outcome(figures, remarks=remarks + skipped, faults=tuple(faults))


def _calibrated(seed: int) -> Calibrated:
    with tempfile.TemporaryDirectory() as out, capture_logs():
        doing = calibrate(seed, Path(out), lambda text: None, compares=False, steps=("wheels",))
        return run_virtual(doing)


def _off(robot: Calibrated) -> dict[str, float]:
    """How far off everything is, in the units of ``UNITS``."""
    after = {estimate.key: estimate.after for estimate in robot.results[0].estimates}
    true = robot.true
    ratio = after[LEFT] / after[RIGHT] / (true[LEFT] / true[RIGHT])
    size = (after[LEFT] + after[RIGHT]) / (true[LEFT] + true[RIGHT])
    x_m, y_m, yaw_rad = (after[key] - true[key] for key in MOUNT)
    return {
        "ratio": 100 * abs(ratio - 1),
        "track": 100 * abs(after[TRACK] / true[TRACK] - 1),
        "size": 100 * abs(size - 1),
        "mount": 1e3 * math.hypot(x_m, y_m),
        "mount yaw": math.degrees(abs(yaw_rad)),
    }


def _wheels(robots: Sequence[Calibrated]) -> list[Figure]:
    if not robots:
        return []
    off = [_off(robot) for robot in robots]
    figures = [
        Figure(f"{name} off, {what}", value([one[name] for one in off]), UNITS[name], target)
        for name, target in TARGETS.items()
        for what, value in (("median", median), ("worst", max))
    ]
    sigmas = [
        abs(estimate.after - robot.true[estimate.key]) / estimate.sigma
        for robot in robots
        for estimate in robot.results[0].estimates
        if estimate.key in robot.true
    ]
    figures.append(Figure("off in standard deviations, root mean square", _rms(sigmas), "x"))
    figures.append(Figure("robot's time, longest", max(robot.robot_s for robot in robots), "s", 200.0))
    return figures


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(value**2 for value in values) / len(values))


def _squares(robots: Sequence[Calibrated]) -> list[Figure]:
    squares = [square for robot in robots for square in robot.after]
    if not squares:
        return []
    centimetres = [100 * one.distance_m for one in squares]
    degrees = [math.degrees(abs(one.heading_rad)) for one in squares]
    without = [_without_slip(robot) for robot in robots]
    slip = median(math.degrees(robot.slip_rad) for robot in robots)
    return [
        Figure("square of 4 m, odometry off, median", median(centimetres), "cm", 1.0),
        Figure("square of 4 m, odometry off, worst", max(centimetres), "cm", 2.5),
        Figure("square of 4 m, heading off, median", median(degrees), "deg", 0.5),
        Figure("square of 4 m, heading off, worst", max(degrees), "deg", 1.0),
        Figure(
            "square of 4 m without slip, odometry off, median", median(cm for cm, _ in without), "cm", 1.0
        ),
        Figure(
            "square of 4 m without slip, heading off, median", median(deg for _, deg in without), "deg", 0.5
        ),
        Figure("square of 4 m, heading off by random slip alone, one sigma", slip, "deg"),
    ]


def _without_slip(robot: Calibrated) -> tuple[float, float]:
    """The odometry's errors after the square if no wheel slips: by the calibrated and the true parameters (cm, deg).

    Of the two ways round, the mean.
    """
    after = {estimate.key: estimate.after for estimate in robot.results[0].estimates}
    calibrated, true = (
        WheelModel(values[LEFT], values[RIGHT], values[TRACK]) for values in (after, robot.true)
    )
    errors = []
    for sign in (1, -1):
        left_m, right_m = _square(true, sign)
        poses = [dead_reckon(model, CHEFBOT_TRACK_M, left_m, right_m)[-1] for model in (calibrated, true)]
        off = between(poses[1], poses[0])
        errors.append((100 * math.hypot(off[0], off[1]), math.degrees(abs(off[2]))))
    return (errors[0][0] + errors[1][0]) / 2, (errors[0][1] + errors[1][1]) / 2


def _square(true: WheelModel, sign: int) -> tuple[Floats, Floats]:
    """How far both sides roll, nominally, on a square of 4 m that is exact."""
    ahead, half = np.full(400, 0.01), np.full(100, sign * math.pi / 400 * CHEFBOT_TRACK_M * true.track)
    left = np.tile(np.concatenate([ahead, -half]), 4) / true.left
    right = np.tile(np.concatenate([ahead, half]), 4) / true.right
    return left, right


def _remark(robot: Calibrated) -> str:
    off = ", ".join(f"{name} {value:.3f} {UNITS[name]}" for name, value in _off(robot).items())
    return f"seed {robot.seed}: {off}"


def _log(log: Recording) -> list[Figure]:
    half = len(log.odometry) // 2
    left_m, right_m = _rolled(log)
    frames = [
        frame
        for row, ranges in zip(log.rows, log.ranges_m, strict=True)
        if row < half and (frame := _keyframe(log, row, ranges)) is not None
    ]
    rows = np.array([frame.row for frame in frames])
    steps = between(log.odometry[:-1], log.odometry[1:])
    totals = np.cumsum(np.stack([np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])], axis=1), axis=0)
    moved = between(log.odometry[rows[:-1]], log.odometry[rows[1:]])
    seen = match_scans(frames, moved, np.diff(np.vstack([np.zeros(2), totals])[rows], axis=0), MEMORY)
    good = np.flatnonzero(seen.is_good)
    i, j, motion, shares = in_pieces(seen.poses[good], PIECES, 1)
    sigmas = np.tile(LOG_SIGMAS, (len(i), 1))
    drive = RecordedDrive(
        log.name, "", left_m, right_m, rows[good][i], rows[good][j], motion, sigmas, shares * len(good) / 4
    )
    model = fit(TRACK_M, [drive]).model
    ours, raw = (_score(log, dead_reckon(one, TRACK_M, left_m, right_m), half) for one in (model, NOMINAL))
    name = "intel, fitted on its first half, the second's relations"
    return [
        Figure(f"{name}: place to raw", ours[0] / raw[0], "x", PLACE),
        Figure(f"{name}: heading to raw", ours[1] / raw[1], "x", HEADING),
        Figure(f"{name}: place, raw {raw[0]:.2f} m", ours[0], "m"),
        Figure(f"{name}: heading, raw {math.degrees(raw[1]):.1f} deg", math.degrees(ours[1]), "deg"),
    ]


def _rolled(log: Recording) -> tuple[Floats, Floats]:
    """How far both sides rolled from row to row, as arcs."""
    steps = between(log.odometry[:-1], log.odometry[1:])
    half_rad = steps[:, 2] / 2
    chord_m = steps[:, 0] * np.cos(half_rad) + steps[:, 1] * np.sin(half_rad)
    ahead_m, turning_m = chord_m / np.sinc(half_rad / math.pi), half_rad * TRACK_M
    return ahead_m - turning_m, ahead_m + turning_m


def _keyframe(log: Recording, row: int, ranges_m: Floats) -> Keyframe | None:
    used = (ranges_m > LOG_BAND_M[0]) & (ranges_m < LOG_BAND_M[1])
    bearing, ranges = log.bearings_rad[used], ranges_m[used]
    return keyframe(row, [np.stack([ranges * np.cos(bearing), ranges * np.sin(bearing)], axis=1)])


def _score(log: Recording, poses: Floats, begin: int) -> tuple[float, float]:
    """The mean errors of the relations between rows from ``begin`` on, in m and rad."""
    i, j = log.relations[:, 0].astype(int), log.relations[:, 1].astype(int)
    inside = (i >= begin) & (j >= begin)
    off = between(poses[i[inside]], poses[j[inside]]) - log.relations[inside, 2:5]
    return float(np.hypot(off[:, 0], off[:, 1]).mean()), float(np.abs(wrap(off[:, 2])).mean())
