"""Compiles, or loads from the cache, all code of SLAM before the first scan."""

import math

import numpy as np

from chefbotd.components.mapping.algorithms.correlate import Window, search
from chefbotd.components.mapping.algorithms.occupancy import occupancy
from chefbotd.components.mapping.algorithms.parameters import SLAM
from chefbotd.components.mapping.algorithms.slam import step
from chefbotd.components.mapping.algorithms.state import Scan, start
from chefbotd.components.mapping.algorithms.surfaces import normals
from chefbotd.components.worker.compiled import release_libraries

BEAMS, RADIUS_M = 60, 2.0


def warm() -> None:
    """Take two scans of a round room through every compiled step, and give back the memory of libraries.

    This takes half a second from the cache, and half a minute without it. The solver of the pose graph, which is not
    compiled, is loaded with the first loop.
    """
    angles = math.tau / BEAMS * np.arange(BEAMS)
    points = (RADIUS_M * np.stack([np.cos(angles), np.sin(angles)], axis=1)).astype(np.float32)
    center, params, state = np.zeros(2), SLAM, start()
    scan = Scan(points, normals(points, center), center)
    for k in range(2):
        odometry = np.array([0.2 * k, 0.0, 0.0])
        state, _ = step(params, state, float(k), odometry, scan)
        search(state.active[0].grids, points, odometry, Window(1.0, 0.1))
    occupancy(state.nodes)
    release_libraries()
