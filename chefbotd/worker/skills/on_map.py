"""Checks whether a pose that a person sets is plausible on the map."""

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import Pose2D
from chefbotd.mapping.occupancy_grid import OccupancyGrid


def require_on_map(grid: OccupancyGrid, x_m: float, y_m: float) -> None:
    """Raises ``Refused`` for a place beside the map: no scan could confirm or deny it."""
    rows, columns = grid.percent.shape
    long_m, high_m = columns * grid.resolution_m, rows * grid.resolution_m
    at = grid.map_from_grid.inverse().compose(Pose2D(x_m, y_m))
    if 0.0 <= at.x_m <= long_m and 0.0 <= at.y_m <= high_m:
        return
    corners = [grid.map_from_grid.compose(Pose2D(x, y)) for x in (0.0, long_m) for y in (0.0, high_m)]
    xs_m, ys_m = [each.x_m for each in corners], [each.y_m for each in corners]
    told = (
        f"({x_m:.2f}, {y_m:.2f}) is not on the map, "
        f"which reaches from ({min(xs_m):.2f}, {min(ys_m):.2f}) to ({max(xs_m):.2f}, {max(ys_m):.2f})"
    )
    raise Refused(RefusalKind.OUT_OF_RANGE, told)
