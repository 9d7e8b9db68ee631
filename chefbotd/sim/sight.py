"""What a level beam at one height meets, and how the surface returns it."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from chefbotd.sim.arrays import Vector
from chefbotd.sim.rays import RayCaster, to_discs_m
from chefbotd.sim.scene import Scene
from chefbotd.sim.worlds.solids import Material
from chefbotd.sim_parameters.lidar import LidarFlaws

BRIGHT, DIM, GLINT = 200, 40, 120
"""Intensities of a plain surface, a black one and glass (assumed)."""


class Seen(NamedTuple):
    """For each beam what comes back: a range in metres, inf if nothing does, and an intensity."""

    range_m: Vector
    intensity: npt.NDArray[np.int64]


class Sight:
    """A scene as the beams of a lidar at this height see it, with the discs that move about in it."""

    def __init__(self, scene: Scene, height_m: float, flaws: LidarFlaws) -> None:
        edges, material = scene.slice(height_m)
        glass = material == Material.GLASS
        self._flaws = flaws
        self._material = material[~glass]
        self._opaque = RayCaster(edges[~glass], flaws.max_range_m)
        self._glass = RayCaster(edges[glass], flaws.max_range_m) if glass.any() else None

    def look(self, origins: Vector, bearings_rad: Vector, discs: Vector) -> Seen:
        """What beams see that leave from ``origins`` (B x 2) at rising or falling bearings of the world frame."""
        hits = self._opaque.cast(origins, bearings_rad)
        range_m, intensity = hits.range_m, np.full(len(bearings_rad), BRIGHT)
        if len(self._material):
            black = (hits.edge >= 0) & (self._material[hits.edge] == Material.BLACK)
            intensity[black] = DIM
            range_m = np.where(black & (range_m > self._flaws.black_range_m), np.inf, range_m)
        if len(discs):
            to_disc_m = to_discs_m(origins, bearings_rad, discs)
            nearer = to_disc_m < hits.range_m
            range_m, intensity[nearer] = np.where(nearer, to_disc_m, range_m), BRIGHT
        if self._glass is not None:
            pane = self._glass.cast(origins, bearings_rad)
            mirrors = (pane.range_m < range_m) & (pane.square >= self._flaws.glass_square)
            range_m, intensity[mirrors] = np.where(mirrors, pane.range_m, range_m), GLINT
        return Seen(range_m, intensity)
