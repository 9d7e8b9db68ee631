"""Compiles, or loads from the cache, all code of SLAM before the first scan."""

import math

import numpy as np

from chefbotd.core.compiled import release_libraries
from chefbotd.mapping.correlate import Window, search
from chefbotd.mapping.finish import refined
from chefbotd.mapping.occupancy import occupancy
from chefbotd.mapping.parameters import SlamParameters
from chefbotd.mapping.slam import step
from chefbotd.mapping.state import Scan, start
from chefbotd.mapping.surfaces import normals

BEAMS, RADIUS_M = 60, 2.0


def warm() -> None:
    """Take two scans of a round room through every step, and give back the memory of libraries.

    This takes half a second from the cache, and half a minute without it.
    """
    angles = math.tau / BEAMS * np.arange(BEAMS)
    points = (RADIUS_M * np.stack([np.cos(angles), np.sin(angles)], axis=1)).astype(np.float32)
    center, params, state = np.zeros(2), SlamParameters(), start()
    scan = Scan(points, normals(points, center), center)
    for k in range(2):
        odometry = np.array([0.2 * k, 0.0, 0.0])
        state, _ = step(params, state, float(k), odometry, scan)
        search(state.active[0].grids, points, odometry, Window(1.0, 0.1))
    occupancy(refined(params, state).nodes)
    release_libraries()
