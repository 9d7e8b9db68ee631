"""The Jackal's recording (robot_localization's test2), as it is and with what may go wrong: wheels, and a tilted IMU.

The end is known from that package's own filters only: the EKF's is what is compared with, in 3-D.
"""

import csv
import gzip
import json
import math
import random
from pathlib import Path

import numpy as np

from chefbotd.core.events.robot import ImuMeasured
from chefbotd.core.geometry import Pose2D
from chefbotd.motion.fused_odometry import FusedOdometry
from chefbotd.motion.odometry import FusionParameters

FOLDER = Path(__file__).parents[2] / "shared" / "data" / "robot_localization"
TRACK_M = 0.376
"""Of a Jackal, by its maker's drawings. Only the turn by the wheels depends on it, which is not believed anyway."""

LATE_S = 0.2
CASES = ("as recorded", "30 % of the IMU lost", "5 % yaw outliers", "3 % wheel spikes", "yaw 200 ms late")

PARAMETERS = FusionParameters(
    heading_noise_rad=0.005,
    gyro_noise_rad_per_root_s=5e-3,
    gyro_scale_sigma=1e-3,
    track_sigma=0.5,
    project_tilt=True,
    max_acceleration_m_s2=25.0,
)
"""Its wheels change their speed by 17 m/s² in a sample of 20 ms. The gyroscope's noise has the tilt's share in it."""

Row = dict[str, float]


def read(path: Path) -> list[Row]:
    """The rows of a compressed table."""
    with gzip.open(path, "rt") as file:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]


def expected(folder: Path) -> tuple[float, float, float]:
    """Where the EKF of robot_localization ends."""
    ekf = json.loads((folder / "expected.json").read_text())["ekf"]
    return ekf["final_x_m"], ekf["final_y_m"], ekf["final_z_m"]


def estimate(folder: Path, case: str, seed: int = 1) -> list[tuple[float, float, float, float, float]]:
    """The trajectory: time, x, y, z, heading. ``case`` is what goes wrong."""
    chance = random.Random(seed)
    wheels, imu = read(folder / "odom.csv.gz"), read(folder / "imu.csv.gz")
    fused = FusedOdometry(
        PARAMETERS, track_width_m=TRACK_M, travel_variance=1e-3, turn_variance=0.1, is_skid_steer=True
    )
    fused.move_to(Pose2D(0.0, 0.0, imu[0]["yaw_rad"]))
    trajectory, readings = [], iter(_readings(imu, case, chance))
    reading, cycle_s = next(readings, None), (wheels[-1]["t_s"] - wheels[0]["t_s"]) / (len(wheels) - 1)
    fused.add_travel(wheels[0]["t_s"] - cycle_s / 2, 0.0, 0.0)
    for row in wheels:
        now_s = row["t_s"] + cycle_s / 2  # a speed is that in the middle of its cycle
        while reading is not None and reading.stamp_s <= now_s:
            fused.add_imu(reading)
            reading = next(readings, None)
        travel_m, bend_m = row["vx_mps"] * cycle_s, row["wz_radps"] * TRACK_M / 2 * cycle_s
        if case.startswith("3 %") and chance.random() < 0.03:
            travel_m += chance.choice((-1, 1)) * chance.uniform(1, 5) * cycle_s
        state = fused.add_travel(now_s, travel_m - bend_m, travel_m + bend_m)
        trajectory.append((now_s, state.x_m, state.y_m, state.climb_m, state.odom_from_base.heading_rad))
    return trajectory


def _readings(imu: list[Row], case: str, chance: random.Random) -> list[ImuMeasured]:
    """The IMU's readings; a late yaw has the stamp of when it is handed over, as on a board whose queue is full."""
    readings = []
    late = 0 if "late" not in case else round(LATE_S / ((imu[-1]["t_s"] - imu[0]["t_s"]) / (len(imu) - 1)))
    for k, row in enumerate(imu):
        if case.startswith("30 %") and chance.random() < 0.3:
            continue
        heading_rad = imu[max(k - late, 0)]["yaw_rad"]
        if case.startswith("5 %") and chance.random() < 0.05:
            heading_rad += chance.choice((-1, 1)) * chance.uniform(0.3, math.pi)
        readings.append(
            ImuMeasured(
                stamp_s=row["t_s"],
                arrival_s=row["t_s"],
                orientation=(row["qx"], row["qy"], row["qz"], row["qw"]),
                heading_rad=heading_rad,
                angular_velocity_rad_s=(row["wx_radps"], row["wy_radps"], row["wz_radps"]),
            )
        )
    return readings


def errors(folder: Path, seeds: int) -> dict[str, list[float]]:
    """How far from the EKF's end each case ends (m, in 3-D), for each seed."""
    end = np.array(expected(folder))
    return {
        case: [
            float(np.linalg.norm(np.array(estimate(folder, case, seed)[-1][1:4]) - end))
            for seed in range(1, (seeds if "%" in case else 1) + 1)
        ]
        for case in CASES
    }
