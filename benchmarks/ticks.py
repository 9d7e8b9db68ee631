"""Recorded encoder ticks with motion-capture truth: runs from a folder, and what plain integration makes of them.

The folder is laid out like the OptiOdom subset: ``geometry.json`` and one ``*_run-NN.csv.gz`` per run, whose rows hold
the ticks of one cycle and the true pose of the axle's centre in the frame of row 0 (x ahead, y left, yaw unwrapped).
"""

import gzip
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from chefbotd.core.geometry import Pose2D, wrap_angle

DATE = len("DDMMYYYY")
COLUMNS = ("left_ticks", "right_ticks", "gt_x_m", "gt_y_m", "gt_yaw_rad")


@dataclass(frozen=True, slots=True)
class Geometry:
    """The robot that made the recordings."""

    wheel_diameter_m: float
    wheel_base_m: float
    ticks_per_revolution: float
    cycle_s: float

    @property
    def metres_per_tick(self) -> float:
        """Travel of the rim."""
        return math.pi * self.wheel_diameter_m / self.ticks_per_revolution


@dataclass(frozen=True, slots=True)
class Run:
    """One recording: ``ticks`` (n, 2: left, right) counted in each cycle, ``poses`` (n, 3) the truth at its end."""

    name: str
    ticks: npt.NDArray[np.int64]
    poses: npt.NDArray[np.float64]

    @property
    def truth(self) -> Pose2D:
        """The final pose; its heading is not wrapped."""
        return Pose2D(*self.poses[-1].tolist())

    @property
    def kind(self) -> str:
        """Runs of one kind on one day: ``square_23122020`` for ``square_231220200029_run-01``."""
        kind, _, session = self.name.partition("_run-")[0].partition("_")
        return f"{kind}_{session[:DATE]}"


def read_geometry(folder: Path) -> Geometry:
    """The geometry of the folder's robot."""
    values = json.loads((folder / "geometry.json").read_text())
    return Geometry(
        values["wheel_diameter_m"],
        values["wheel_base_m"],
        values["ticks_per_wheel_revolution"],
        values["cycle_s"],
    )


def read_runs(folder: Path) -> Iterator[Run]:
    """Every run, by name."""
    for path in sorted(folder.glob("*_run-*.csv.gz")):
        with gzip.open(path, "rt") as file:
            names = file.readline().strip().split(",")
            table = np.loadtxt(file, delimiter=",", usecols=[names.index(column) for column in COLUMNS])
        yield Run(path.name.partition(".")[0], table[:, :2].astype(np.int64), table[:, 2:])


def integrate(geometry: Geometry, ticks: npt.NDArray[np.int64]) -> Pose2D:
    """Exact arcs in plain numpy, all at once; nothing of chefbotd's odometry is used."""
    left_m, right_m = ticks.T * geometry.metres_per_tick
    turned_rad = (right_m - left_m) / geometry.wheel_base_m
    chord_m = (left_m + right_m) / 2 * np.sinc(turned_rad / math.tau)
    heading_rad = np.cumsum(turned_rad)
    along_rad = heading_rad - turned_rad / 2
    x_m, y_m = float(chord_m @ np.cos(along_rad)), float(chord_m @ np.sin(along_rad))
    return Pose2D(x_m, y_m, wrap_angle(float(heading_rad[-1])))


def apart(one: Pose2D, other: Pose2D) -> tuple[float, float]:
    """Metres and radians between two poses of the same frame."""
    distance_m = math.hypot(one.x_m - other.x_m, one.y_m - other.y_m)
    return distance_m, abs(wrap_angle(one.heading_rad - other.heading_rad))
