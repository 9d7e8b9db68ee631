"""Moving AI's grid maps and scenarios, gzipped or not: `type octile` maps, and problems with their optimal lengths.

Format: N. Sturtevant, "Benchmarks for Grid-Based Pathfinding", IEEE TCIAIG 4(2), 2012.
"""

import gzip
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FREE = ".GS"


@dataclass(frozen=True, slots=True)
class Problem:
    """Cells (row, column) of start and goal, and the length of the shortest path in cells; 0 for none."""

    start: tuple[int, int]
    goal: tuple[int, int]
    length: float


@dataclass(frozen=True, slots=True)
class Scenario:
    """A map's name, which of its cells are free (rows down), and its problems."""

    name: str
    free: NDArray[np.bool_]
    problems: tuple[Problem, ...]


def scenarios(folder: Path) -> Iterator[Scenario]:
    """All maps anywhere in a folder that have a scenario beside them."""
    for path in sorted([*folder.rglob("*.map"), *folder.rglob("*.map.gz")]):
        plain = path.with_suffix("") if path.suffix == ".gz" else path
        for beside in (plain.with_name(plain.name + ".scen"), plain.with_name(plain.name + ".scen.gz")):
            if beside.exists():
                yield Scenario(plain.stem, _free(_text(path)), tuple(_problems(_text(beside))))
                break


def _text(path: Path) -> str:
    data = path.read_bytes()
    return (gzip.decompress(data) if path.suffix == ".gz" else data).decode("ascii")


def _free(text: str) -> NDArray[np.bool_]:
    heading, rows = text.split("\nmap\n", 1)
    if not heading.startswith("type octile"):
        raise ValueError(f"a map begins with 'type octile', got {heading[:40]!r}")
    return np.array([[cell in FREE for cell in row] for row in rows.split()])


def _problems(text: str) -> Iterator[Problem]:
    for line in text.splitlines()[1:]:
        if line.strip():
            fields = line.split("\t")
            start_x, start_y, goal_x, goal_y = (int(field) for field in fields[4:8])
            yield Problem((start_y, start_x), (goal_y, goal_x), float(fields[8]))
