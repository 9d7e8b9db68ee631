"""Outlines that are drawn on a map: their points, and whether they are areas. Loads no numpy."""

from collections.abc import Sequence
from itertools import combinations
from typing import Annotated, Final, TypeAlias

from pydantic import Field

FARTHEST_M: Final = 1e6
"""From the origin of a map: farther is a slip of the finger."""

WALL_WIDTH_M: Final = 0.05
"""Of a drawn wall that says nothing of its width: a cell of most maps."""

Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
Point: TypeAlias = tuple[Coordinate, Coordinate]

LEAST_AREA_M2 = 1e-4
"""A square centimetre: less is a slip of the hand."""


def why_no_area(corners_m: Sequence[Point]) -> str:
    """What is wrong with an area of these corners; empty where nothing is."""
    edges = list(zip(corners_m, [*corners_m[1:], corners_m[0]], strict=True))
    doubled_m2 = sum(ax * by - bx * ay for (ax, ay), (bx, by) in edges)
    if abs(doubled_m2) < 2 * LEAST_AREA_M2 and not _crosses(edges):
        return "its corners lie on a line, so that there is nothing in it"
    if _crosses(edges):
        return "its edges cross, so that it is not clear what is in it; draw it as two zones"
    return ""


def _crosses(edges: Sequence[tuple[Point, Point]]) -> bool:
    """Whether two edges share a point that lies inside both."""
    return any(
        _side(a, b, c) * _side(a, b, d) < 0 and _side(c, d, a) * _side(c, d, b) < 0
        for (a, b), (c, d) in combinations(edges, 2)
    )


def _side(a: Point, b: Point, c: Point) -> float:
    """On which side of the line from a to b a point c lies: positive on the left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
