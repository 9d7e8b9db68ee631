"""Laser and odometry recordings of real buildings: read, and a trajectory scored by relations.

The score is that of Burgard et al. ("A Comparison of SLAM Algorithms Based on a Graph of Relations", IROS 2009): a
relation says where row j of the odometry lies as seen from row i, and the error is the difference to what the
trajectory says. No rigid alignment can hide anything. Rows without a pose are carried by odometry.
"""

import gzip
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from chefbotd.core.poses import Floats, between, compose

OFFICIAL, PSEUDO = "relations.csv", "pseudo_relations.csv"


@dataclass(frozen=True, slots=True)
class Recording:
    """Odometry (row by row: x, y, heading), and the scans: their rows, and ranges along ``bearings_rad``.

    ``relations`` are rows of i, j, x, y, heading.
    """

    name: str
    odometry: Floats
    rows: tuple[int, ...]
    ranges_m: Floats
    bearings_rad: Floats
    relations: Floats
    is_official: bool
    is_dense: bool


@dataclass(frozen=True, slots=True)
class Score:
    """Mean and standard deviation of the errors of all relations, and the largest."""

    translation_m: float
    translation_std_m: float
    translation_max_m: float
    rotation_deg: float
    relations: int


def recordings(folder: Path) -> Iterator[Recording]:
    """Every recording in the folders of a folder, the dense scans of each before the sparse ones."""
    for place in sorted(path.parent for path in folder.glob("*/meta.json")):
        for name, is_dense in (("scans_dense.csv", True), ("scans.csv", False)):
            if _exists(place / name):
                yield _read(place, name, is_dense=is_dense)


def _read(place: Path, name: str, *, is_dense: bool) -> Recording:
    meta = json.loads((place / "meta.json").read_text(encoding="utf-8"))
    bearings = meta["angle_min"] + meta["angle_inc"] * np.arange(meta["beams"])
    lines = [line.split(",") for line in _text(place / name).splitlines()]
    at = 1 if is_dense else 2
    relations = OFFICIAL if _exists(place / OFFICIAL) else PSEUDO
    return Recording(
        f"{place.name}{'-dense' if is_dense else ''}",
        _numbers(place / "odom.csv")[:, 2:5],
        tuple(int(line[at]) for line in lines),
        np.array([line[at + 1 :] for line in lines], float),
        bearings,
        _numbers(place / relations),
        relations == OFFICIAL,
        is_dense,
    )


def score(recording: Recording, poses: Floats) -> Score:
    """How far the poses of the scans (in their order) are from the relations."""
    rows = np.array(recording.rows)
    first, second, told = recording.relations[:, 0], recording.relations[:, 1], recording.relations[:, 2:5]
    found = between(_at(recording, rows, poses, first), _at(recording, rows, poses, second))
    metres = np.hypot(found[:, 0] - told[:, 0], found[:, 1] - told[:, 1])
    turns = np.abs((found[:, 2] - told[:, 2] + np.pi) % (2 * np.pi) - np.pi)
    return Score(
        float(metres.mean()),
        float(metres.std()),
        float(metres.max()),
        float(np.degrees(turns.mean())),
        len(metres),
    )


def _at(recording: Recording, rows: np.ndarray, poses: Floats, wanted: Floats) -> Floats:
    """The poses of odometry rows: that of the last scan before, and odometry from there."""
    row = wanted.astype(int)
    base = np.maximum(np.searchsorted(rows, row, side="right") - 1, 0)
    return compose(poses[base], between(recording.odometry[rows[base]], recording.odometry[row]))


def _exists(path: Path) -> bool:
    return path.exists() or path.with_name(f"{path.name}.gz").exists()


def _text(path: Path) -> str:
    if path.exists():
        return path.read_text(encoding="utf-8")
    return gzip.decompress(path.with_name(f"{path.name}.gz").read_bytes()).decode()


def _numbers(path: Path) -> Floats:
    """The rows of a CSV file with a heading."""
    return np.array([line.split(",") for line in _text(path).splitlines()[1:]], float)
