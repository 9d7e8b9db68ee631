"""Saves the pose from one run to the next in a small file that is replaced at once; errors never raise."""

from pathlib import Path
from typing import Protocol

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import Pose2D
from chefbotd.localization.saved import NotASavedPose, SavedPose, from_text, to_text
from chefbotd.mapping.occupancy_grid import OccupancyGrid
from chefbotd.maps.disk import TEMPORARY, Disk


def require_on_map(grid: OccupancyGrid, x_m: float, y_m: float) -> None:
    """Raises ``Refused`` for a place beside the map: no scan could confirm or deny it."""
    rows, columns = grid.percent.shape
    long_m, high_m = columns * grid.resolution_m, rows * grid.resolution_m
    at = grid.map_from_grid.inverse().compose(Pose2D(x_m, y_m))
    if 0.0 <= at.x_m <= long_m and 0.0 <= at.y_m <= high_m:
        return
    corners = [grid.map_from_grid.compose(Pose2D(x, y)) for x in (0.0, long_m) for y in (0.0, high_m)]
    xs_m, ys_m = [corner.x_m for corner in corners], [corner.y_m for corner in corners]
    reason = (
        f"({x_m:.2f}, {y_m:.2f}) is not on the map, "
        f"which reaches from ({min(xs_m):.2f}, {min(ys_m):.2f}) to ({max(xs_m):.2f}, {max(ys_m):.2f})"
    )
    raise Refused(RefusalKind.OUT_OF_RANGE, reason)


LARGEST_BYTES = 10_000


class PoseFile(Protocol):
    """What keeps a pose."""

    def read(self) -> SavedPose | None:
        """What was kept; None where there is nothing that can be used."""
        ...

    def write(self, pose: SavedPose) -> str:
        """Keep it; what went wrong, empty if nothing did."""
        ...


class PoseOnDisk:
    """A file; a damaged one is as good as none."""

    def __init__(self, path: Path, disk: Disk | None = None) -> None:
        self._path, self._disk = path, disk or Disk()

    def read(self) -> SavedPose | None:
        """What was kept."""
        try:
            with self._path.open(encoding="utf-8") as file:
                return from_text(file.read(LARGEST_BYTES))
        except (OSError, UnicodeDecodeError, NotASavedPose):
            return None

    def write(self, pose: SavedPose) -> str:
        """Keep it: the old one is there until the new one is on the disk."""
        temporary = self._path.with_name(TEMPORARY + self._path.name)
        try:
            self._disk.make_folder(self._path.parent)
            self._disk.write(temporary, to_text(pose).encode())
            self._disk.rename(temporary, self._path)
        except OSError as error:
            return f"the pose cannot be saved: {error}"
        return ""
