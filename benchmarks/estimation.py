"""The estimator of odometry: is its covariance honest, does it see slip, and does it survive what recordings hold?

NEES is the normalized estimation error squared of (x, y, heading), the mean of 50 drives at each second (Bar-Shalom, Li
and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, 5.4). Half of a count's travel is added
to the covariance: what stands still has none. With ``out`` every trajectory is written, as CSV.
"""

import csv
import math
import random
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from benchmarks import jackal, slipping
from benchmarks.figures import Figure, Outcome
from chefbotd.core.events.robot import MotionAnomaly
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.motion import odometry as dead_reckoning
from chefbotd.motion.motion_filter import MotionEstimate
from chefbotd.motion.odometry import OdometryParameters

SEEDS = 50
DRIVE_S = 180.0
BOUNDS = {50: (2.36, 3.72), 10: (1.68, 4.70)}
"""The mean of so many NEES of three degrees of freedom lies between these with 95 % (chi square)."""

COUNT_VARIANCE = (0.5 / slipping.COUNTS_PER_M) ** 2
OUTSIDE_PERCENT = 10.0

SLIP_SECONDS = 2400.0
FOUND_WITHIN_S = 0.3
MISSED_PERCENT = 10.0
QUIET_HOURS = 5.0
EKF_M, CASE_M = 0.05, 0.138
ESTIMATE_US = 15.0
KINDS = {"rates": True, "headings": False}
"""What the board sends: the raw IMU, or its orientation."""


def run(*, quick: bool = False, folder: Path = jackal.FOLDER, out: Path | None = None) -> Outcome:
    """Everything; ``quick`` has fewer drives and hours."""
    seeds, hours = (10, 0.2) if quick else (SEEDS, QUIET_HOURS)
    figures: list[Figure] = []
    for kind, raw_imu in KINDS.items():
        figures += _consistency(kind, seeds, out, raw_imu=raw_imu)
        figures += _slips(kind, SLIP_SECONDS / 10 if quick else SLIP_SECONDS, raw_imu=raw_imu)
        figures.append(_false_alarms(kind, hours, raw_imu=raw_imu))
        figures.append(_cost(kind, raw_imu=raw_imu))
    recorded, remarks = _recorded(folder, 2 if quick else 10, out)
    return Outcome((*figures, *recorded), remarks=remarks)


def _nees(estimate: MotionEstimate, moment: slipping.Moment) -> float:
    covariance = np.reshape(estimate.pose_covariance.row_by_row, (3, 3)) + COUNT_VARIANCE * np.eye(3)
    off = np.array(
        [moment.x_m - estimate.x_m, moment.y_m - estimate.y_m, moment.heading_rad - estimate.heading_rad]
    )
    return float(off @ np.linalg.solve(covariance, off))


def _consistency(kind: str, seeds: int, out: Path | None, *, raw_imu: bool) -> list[Figure]:
    """NEES of calibrated robots, and how far off they are after the drive, beside the wheels alone."""
    rows, ends, by_wheels = [], [], []
    for seed in range(seeds):
        chance = random.Random(seed)
        odometry = slipping.fused(slipping.CALIBRATED)
        wheels, nees, trajectory = dead_reckoning.START, [], []
        parameters = OdometryParameters()
        robot = slipping.drawn(slipping.CALIBRATED, chance)
        for k, moment in enumerate(slipping.drive(robot, DRIVE_S, chance, raw_imu=raw_imu), 1):
            slipping.feed(odometry, moment)
            wheels = dead_reckoning.integrate(
                parameters, slipping.TRACK_M, wheels, moment.left_m, moment.right_m, Twist2D()
            )
            if k % round(1 / slipping.CYCLE_S) == 0:
                nees.append(_nees(odometry.estimate, moment))
                trajectory.append((moment.stamp_s, *_pose(odometry.estimate.odom_from_base), *_true(moment)))
        rows.append(nees)
        ends.append(math.hypot(trajectory[-1][1] - moment.x_m, trajectory[-1][2] - moment.y_m))
        by_wheels.append(
            math.hypot(wheels.odom_from_base.x_m - moment.x_m, wheels.odom_from_base.y_m - moment.y_m)
        )
        if out is not None:
            header = "t_s", "x_m", "y_m", "heading_rad", "true_x_m", "true_y_m", "true_heading_rad"
            _write(out / f"simulated_{kind}_{seed:02}.csv", header, trajectory)
    low, high = BOUNDS[seeds]
    mean = np.array(rows).mean(axis=0)
    outside = float(np.mean((mean < low) | (mean > high)) * 100)
    return [
        Figure(f"{kind}: times with a NEES beyond its 95 % bounds", outside, "%", OUTSIDE_PERCENT),
        Figure(f"{kind}: mean NEES (3 is right)", float(mean.mean()), ""),
        Figure(f"{kind}: off after {DRIVE_S:g} s, median of {seeds}", float(np.median(ends)), "m"),
        Figure(f"{kind}: the wheels alone, median", float(np.median(by_wheels)), "m"),
    ]


def _slips(kind: str, seconds: float, *, raw_imu: bool) -> list[Figure]:
    """How many slips of a driven wheel are not seen in time, by the share of its travel that is lost."""
    cases = {"half to all": (0.5, 1.0), "half": (0.5, 0.5), "a quarter": (0.25, 0.25)}
    targets = {"half to all": MISSED_PERCENT, "half": MISSED_PERCENT}
    return [
        Figure(
            f"{kind}: slips of {name} not found in {FOUND_WITHIN_S:g} s",
            _missed(shares, seconds, raw_imu=raw_imu),
            "%",
            targets.get(name),
        )
        for name, shares in cases.items()
    ]


def _missed(shares: tuple[float, float], seconds: float, *, raw_imu: bool) -> float:
    chance, odometry = random.Random(7), slipping.fused(slipping.CALIBRATED)
    robot = slipping.drawn(slipping.CALIBRATED, chance)
    slips = missed = 0
    awaited = False
    for moment in slipping.drive(robot, seconds, chance, raw_imu=raw_imu, slips=shares):
        slipping.feed(odometry, moment)
        since_s = moment.slipping_s
        if since_s is not None and since_s <= slipping.CYCLE_S * 1.5:
            slips, awaited = slips + 1, True
        if awaited and odometry.anomaly is MotionAnomaly.SLIP:
            awaited = False
        elif awaited and (since_s is None or since_s >= FOUND_WITHIN_S - 1e-9):
            missed, awaited = missed + 1, False
    return 100 * missed / max(slips, 1)


def _false_alarms(kind: str, hours: float, *, raw_imu: bool) -> Figure:
    chance, odometry = random.Random(99), slipping.fused(slipping.CALIBRATED)
    robot = slipping.drawn(slipping.CALIBRATED, chance)
    alarms, before = 0, MotionAnomaly.NONE
    for moment in slipping.drive(robot, hours * 3600, chance, raw_imu=raw_imu):
        slipping.feed(odometry, moment)
        alarms += odometry.anomaly is not MotionAnomaly.NONE and before is MotionAnomaly.NONE
        before = odometry.anomaly
    return Figure(f"{kind}: false alarms an hour, in {hours:g} h", alarms / hours, "", 1.0)


def _cost(kind: str, *, raw_imu: bool) -> Figure:
    """Processor time of a cycle: readings, wheels and all; the best of several rounds, as other programs only add."""
    chance = random.Random(3)
    robot = slipping.drawn(slipping.CALIBRATED, chance)
    moments = list(slipping.drive(robot, 50.0, chance, raw_imu=raw_imu))
    rounds = []
    for _ in range(7):
        odometry = slipping.fused(slipping.CALIBRATED)
        began_s = time.process_time()
        for moment in moments:
            for reading in moment.imu:
                odometry.add_imu(reading)
            odometry.add_travel(moment.stamp_s, moment.left_m, moment.right_m)
        rounds.append((time.process_time() - began_s) / len(moments))
    return Figure(f"{kind}: an estimate", min(rounds) * 1e6, "us", ESTIMATE_US)


def _recorded(folder: Path, seeds: int, out: Path | None) -> tuple[list[Figure], tuple[str, ...]]:
    if (folder / jackal.FOLDER.name).is_dir():  # the folder of all recordings
        folder = folder / jackal.FOLDER.name
    if not (folder / "expected.json").is_file():
        return [], (f"skipped: no recording in {folder}",)
    figures = []
    for case in jackal.CASES:
        errors = []
        for seed in range(1, (seeds if "%" in case else 1) + 1):
            trajectory = jackal.estimate(folder, case, seed)
            errors.append(math.dist(trajectory[-1][1:4], jackal.expected(folder)))
            if out is not None:
                name = f"jackal_{case.replace(' %', '_percent').replace(' ', '_')}_{seed:02}.csv"
                _write(out / name, ("t_s", "x_m", "y_m", "z_m", "heading_rad"), trajectory)
        worst = f", worst of {len(errors)}" if len(errors) > 1 else ""
        target = EKF_M if case == jackal.CASES[0] else CASE_M
        figures.append(Figure(f"Jackal, {case}: end to the EKF's in 3-D{worst}", max(errors), "m", target))
    return figures, ("the Jackal's end is compared in 3-D (x, y, z), with the IMU's tilt projected",)


def _pose(pose: Pose2D) -> tuple[float, float, float]:
    return pose.x_m, pose.y_m, pose.heading_rad


def _true(moment: slipping.Moment) -> tuple[float, float, float]:
    return moment.x_m, moment.y_m, math.remainder(moment.heading_rad, math.tau)


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[float]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)
