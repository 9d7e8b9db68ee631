"""What clients say of what is drawn on a map: outlines, and what was read before it is changed."""

from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import Field

from chefbotd.components.maps.outlines import WALL_WIDTH_M, Coordinate

CONFIRMED = Field(False, description="what it would do to the robot, to places or to the way there is meant")
WIDTH = Field(None, gt=0, le=5, description=f"of a wall; if none is given, {WALL_WIDTH_M} m", examples=[None])
PointPair = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]


def revision_field(what: str) -> Any:
    """The revision that a client has read of ``what``, in the plural."""
    return Field(
        None,
        max_length=64,
        description=f"of the {what} that were read; if they were changed meanwhile, the request is refused",
        examples=[None],
    )


def id_field(what: str) -> Any:
    """The id of ``what``, with its article."""
    return Field(min_length=1, max_length=64, description=f"{what}'s id")


def points_field(most: int) -> Any:
    """The points of an outline, so many at most."""
    return Field(
        min_length=2,
        max_length=most,
        description="at least three for an area",
        examples=[[[1.0, 2.0], [3.0, 2.0], [3.0, 2.8]]],
    )


def require_outline(kind: str, points_m: Sequence[object], width_m: float | None) -> None:
    """Raises ``ValueError`` for an area of two corners, and for one that has the width of a wall."""
    if kind != "wall" and len(points_m) < 3:
        raise ValueError(f"expected at least three corners for an area, got {len(points_m)}")
    if kind != "wall" and width_m is not None:
        raise ValueError("expected width_m for a wall alone")
