"""Drives through the flat: what the SLAM makes of them, held against the truth."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.mapping.algorithms.finish import refine_graph
from chefbotd.components.mapping.algorithms.occupancy import occupancy
from chefbotd.components.mapping.algorithms.parameters import SlamParameters
from chefbotd.components.mapping.algorithms.slam import SlamReport, step
from chefbotd.components.mapping.algorithms.state import Scan, SlamState, start
from chefbotd.components.mapping.algorithms.surfaces import normals
from chefbotd.core.poses import compose, transform
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, to_walls_m

PARAMS = SlamParameters()
CENTER = np.zeros(2)
Points = NDArray[np.float32]


def scan_of(points: Points) -> Scan:
    """A scan seen from the robot's center."""
    return Scan(points, normals(points, CENTER), CENTER)


@dataclass
class Drive:
    """What came of a drive: the last state and all reports."""

    state: SlamState
    reports: list[SlamReport]

    def poses(self) -> Floats:
        """Where the graph, as it is in the end, puts each scan."""
        nodes = self.state.nodes
        places = {int(number): pose for number, pose in zip(nodes.number, nodes.map, strict=True)}
        for report in reversed(self.reports):
            for gone in report.forgotten:
                if gone.kept in places:
                    places[gone.number] = compose(places[gone.kept], gone.pose)
        return np.array([compose(places[r.node], r.node_from_base) for r in self.reports if r.node in places])

    def modes(self) -> list[str]:
        """The mode of each step."""
        return [str(report.mode) for report in self.reports]


def drive(
    odometry: Floats,
    seen: Callable[[int], Points],
    state: SlamState | None = None,
    finish: bool = True,
    params: SlamParameters = PARAMS,
) -> Drive:
    """Feed all scans; ``seen`` gives the points of each."""
    state, reports = state or start(), []
    for k, pose in enumerate(odometry):
        state, report = step(params, state, 0.1 * k, pose, scan_of(seen(k)))
        reports.append(report)
    return Drive(refine_graph(params, state) if finish else state, reports)


def off_m(poses: Floats, truth: Floats) -> Floats:
    """How far each pose of the map is from the truth; the map begins at the first true pose."""
    there = compose(truth[0], poses)
    off: Floats = np.hypot(there[:, 0] - truth[:, 0], there[:, 1] - truth[:, 1])
    return off


def walls_off_m(state: SlamState, truth: Floats, walls: Floats) -> Floats:
    """How far the centers of the occupied cells are from the true walls."""
    grid = occupancy(state.nodes)
    rows, columns = np.nonzero(grid.percent >= 65)
    origin = np.array([grid.map_from_grid.x_m, grid.map_from_grid.y_m])
    centers = np.stack([columns + 0.5, rows + 0.5], axis=1) * grid.resolution_m + origin
    return to_walls_m(walls, transform(truth[0], centers))
