"""A building in three dimensions: upright faces and level slabs. Each sensor takes those that it can see."""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.crowd import Crowd
from chefbotd.components.simulation.world import World
from chefbotd.components.simulation.worlds.building import CEILING_M, Material, Solid
from chefbotd.core.geometry import ORIGIN, Pose2D
from chefbotd.core.record import Record


class Slab(Record, frozen=True, eq=False):
    """A level face: a convex polygon (N x 2, counter-clockwise) at a height."""

    corners: Vector
    height_m: float


class Scene(Record, frozen=True, eq=False):
    """Upright faces, one row each: ``edges`` (S x 4: x1, y1, x2, y2), between two heights, of a material; and slabs.

    ``start`` is where a robot starts if nothing else is configured.
    """

    edges: Vector
    bottom_m: Vector
    top_m: Vector
    material: npt.NDArray[np.int8]
    slabs: tuple[Slab, ...] = ()
    start: Pose2D = ORIGIN

    def below(self, height_m: float, crowd: Crowd | None = None) -> World:
        """The walls that a robot of this height can touch, and the people between them.

        Raises:
            ValueError: there are none.
        """
        return World(self.edges[self.bottom_m < height_m], crowd)

    def at(self, height_m: float, crowd: Crowd | None = None) -> World:
        """The walls that a level view at this height meets, glass included; all walls if it meets none."""
        edges, _ = self.slice(height_m)
        return World(edges if len(edges) else self.edges, crowd)

    def slice(self, height_m: float) -> tuple[Vector, npt.NDArray[np.int8]]:
        """The edges that a level beam at this height can meet, and the material of each."""
        met = (self.bottom_m <= height_m) & (height_m < self.top_m)
        return self.edges[met], self.material[met]


def of_walls(edges: Vector) -> Scene:
    """A scene of plain walls from floor to ceiling."""
    count = len(edges)
    heights = np.zeros(count), np.full(count, CEILING_M)
    return Scene(edges, *heights, np.full(count, Material.PLAIN, np.int8), start=ORIGIN)


def of_solids(solids: Iterable[Solid], start: Pose2D = ORIGIN) -> Scene:
    """A scene of prisms; a slab is their top, or the underside of one that hangs above the floor."""
    edges, bottoms, tops, materials, slabs = [], [], [], [], []
    for solid in solids:
        corners = solid.corners
        edges.append(np.hstack((corners, np.roll(corners, -1, axis=0))))
        bottoms += [solid.bottom_m] * len(corners)
        tops += [solid.top_m] * len(corners)
        materials += [solid.material] * len(corners)
        if solid.top_m < CEILING_M:
            slabs.append(Slab(corners, solid.top_m))
        if solid.bottom_m > 0:
            slabs.append(Slab(corners, solid.bottom_m))
    materials_of = np.array(materials, np.int8)
    return Scene(np.concatenate(edges), np.array(bottoms), np.array(tops), materials_of, tuple(slabs), start)
