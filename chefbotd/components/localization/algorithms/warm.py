"""Compiles, or loads from the cache, all code of localization before the first scan."""

import numpy as np

from chefbotd.components.localization.algorithms.localizer import advance_search, step
from chefbotd.components.localization.algorithms.searching import localization_map
from chefbotd.components.localization.algorithms.state import (
    Localization,
    Odometry,
    PoseState,
    localize,
    set_pose,
)
from chefbotd.components.mapping.algorithms.correlate import Window, search
from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.components.mapping.algorithms.surfaces import normals
from chefbotd.components.worker.compiled import release_libraries
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid

SIDE, BEAMS = 60, 90


def warm() -> None:
    """Find the way in a small room, and give back the memory of libraries."""
    percent = np.zeros((SIDE, SIDE), np.int8)
    percent[[0, -1]] = percent[:, [0, -1]] = 100
    percent[10:20, 14:30] = 100
    within = localization_map(OccupancyGrid(0.05, Pose2D(-1.0, -1.2), percent))
    angles = np.linspace(0, 2 * np.pi, BEAMS, endpoint=False)
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1).astype(np.float32)
    center = np.zeros(2)
    scan = Scan(points, normals(points, center), center)
    now, odometry = localize(Localization()), Odometry(np.zeros(3))
    for k in range(3):
        now, _ = step(within, now, 0.1 * k, odometry, scan)
        now = advance_search(within, now)
    search(within.surfaces.grids, points, np.zeros(3), Window(1.0, 0.1))
    tracking = Localization(state=PoseState.UNCERTAIN)
    step(within, set_pose(tracking, np.zeros(3)), 0.0, odometry, scan)
    release_libraries()
