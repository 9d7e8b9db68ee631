"""The robot's outline seen from above, and how far points are from it."""

import math
from functools import cached_property
from typing import TypeAlias

import numpy as np
from msgspec import Struct

from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.components.worker.compiled import kernel

Corner: TypeAlias = tuple[float, float]


class Footprint(Struct, frozen=True, dict=True):
    """A circle about the base frame's origin, or the corners (x, y) of a polygon in the base frame, in either order.

    Raises:
        ValueError: neither or both are given, or the origin is not inside the polygon.
    """

    radius_m: float | None = None
    corners_m: tuple[Corner, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what is no outline."""
        if (self.radius_m is None) == (not self.corners_m):
            got = f"{self.radius_m} and {self.corners_m}"
            raise ValueError(f"an outline has either radius_m or corners_m, got {got}")
        if self.corners_m and (len(self.corners_m) < 3 or clearance_m(self.hull, 0.0, 0.0, 0.0) >= 0):
            raise ValueError(
                f"corners_m are three or more around the origin of the base frame, got {self.corners_m}"
            )

    @cached_property
    def hull(self) -> Floats:
        """Corners (n, 2); a circle is its middle alone, and ``pad_m`` about it."""
        return np.array(self.corners_m or ((0.0, 0.0),), np.float64)

    @property
    def pad_m(self) -> float:
        """What is to be added all around the hull."""
        return self.radius_m or 0.0

    @cached_property
    def inner_radius_m(self) -> float:
        """The largest circle about the origin that is inside: nearer than this an obstacle always touches."""
        return -clearance_m(self.hull, self.pad_m, 0.0, 0.0)

    @cached_property
    def outer_radius_m(self) -> float:
        """The smallest circle about the origin that holds it: with so much room it can turn on the spot."""
        return float(np.hypot(self.hull[:, 0], self.hull[:, 1]).max()) + self.pad_m


@kernel
def clearance_m(hull: Floats, pad_m: float, x_m: float, y_m: float) -> float:
    """How far a point of the base frame is outside of the outline; negative inside."""
    n = hull.shape[0]
    if n == 1:
        return math.hypot(x_m - hull[0, 0], y_m - hull[0, 1]) - pad_m
    nearest, inside = math.inf, False
    for i in range(n):
        ax, ay = hull[i, 0], hull[i, 1]
        bx, by = hull[(i + 1) % n, 0], hull[(i + 1) % n, 1]
        ex, ey, px, py = bx - ax, by - ay, x_m - ax, y_m - ay
        share = min(max((px * ex + py * ey) / max(ex * ex + ey * ey, 1e-12), 0.0), 1.0)
        nearest = min(nearest, math.hypot(px - share * ex, py - share * ey))
        if (ay > y_m) != (by > y_m) and px < ex * py / ey:
            inside = not inside
    return (-nearest if inside else nearest) - pad_m


@kernel
def clearances_m(hull: Floats, pad_m: float, points_m: Floats) -> Floats:
    """The same of each of the points (n, 2)."""
    result = np.empty(points_m.shape[0])
    for i in range(points_m.shape[0]):
        result[i] = clearance_m(hull, pad_m, points_m[i, 0], points_m[i, 1])
    return result
