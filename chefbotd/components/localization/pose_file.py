"""The pose that is kept from one run to the next, in a small file that is replaced at once; errors never raise."""

import math
from pathlib import Path
from typing import Literal, Protocol, Self

from pydantic import Field, ValidationError, model_validator

from chefbotd.components.maps.storage.disk import TEMPORARY, Disk
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.parameters import Parameters
from chefbotd.core.sentence import Sentence
from chefbotd.storage import read_file

MOVED_M, MOVED_RAD = 0.1, 0.1
"""One sigma of how far a robot may have been nudged while nobody watched."""

MOST_M = 1e4


class NotASavedPose(ValueError):
    """Text that no saved pose is in; it says why."""


class SavedPose(Parameters):
    """Where the robot was on which version of which map, and the covariance over x, y and heading, row by row."""

    format: Literal[1] = 1
    map: str = Field(min_length=1)
    version: int = Field(ge=1)
    x_m: float = Field(ge=-MOST_M, le=MOST_M)
    y_m: float = Field(ge=-MOST_M, le=MOST_M)
    heading_rad: float = Field(ge=-math.tau, le=math.tau)
    covariance: tuple[float, ...] = Field(min_length=9, max_length=9)

    @model_validator(mode="after")
    def _is_a_covariance(self) -> Self:
        rows = [self.covariance[3 * k : 3 * k + 3] for k in range(3)]
        if any(not 0 <= rows[k][k] <= MOST_M for k in range(3)):
            raise ValueError(f"variances are from 0 to {MOST_M:g}, got {[rows[k][k] for k in range(3)]}")
        for i in range(3):
            for k in range(i):
                if abs(rows[i][k] - rows[k][i]) > 1e-9 or rows[i][k] ** 2 > rows[i][i] * rows[k][k] * (
                    1 + 1e-6
                ):
                    raise ValueError(
                        f"a covariance is symmetric and no variance is exceeded, got {self.covariance}"
                    )
        return self

    def loosened(self) -> tuple[float, ...]:
        """The covariance after a time in which the robot may have been moved a bit."""
        added = {0: MOVED_M**2, 4: MOVED_M**2, 8: MOVED_RAD**2}
        return tuple(value + added.get(k, 0.0) for k, value in enumerate(self.covariance))


def to_text(pose: SavedPose) -> str:
    """As it is kept."""
    return pose.model_dump_json() + "\n"


def from_text(text: str) -> SavedPose:
    """What was kept.

    Raises:
        NotASavedPose: the text is not what ``to_text`` makes.
    """
    try:
        return SavedPose.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "text"
        raise NotASavedPose(f"not a saved pose: {where}: {first['msg']}") from error


def require_on_map(grid: OccupancyGrid, x_m: float, y_m: float) -> None:
    """Raises ``Refused`` for a place beside the map: no scan could confirm or deny it."""
    rows, columns = grid.percent.shape
    long_m, high_m = columns * grid.resolution_m, rows * grid.resolution_m
    at = grid.map_from_grid.inverse().compose(Pose2D(x_m, y_m))
    if 0.0 <= at.x_m <= long_m and 0.0 <= at.y_m <= high_m:
        return
    corners = [grid.map_from_grid.compose(Pose2D(x, y)) for x in (0.0, long_m) for y in (0.0, high_m)]
    xs_m, ys_m = [corner.x_m for corner in corners], [corner.y_m for corner in corners]
    reason = Sentence(
        "localization.beside_map",
        "({x_m:.2f}, {y_m:.2f}) is not on the map, "
        "which reaches from ({left_m:.2f}, {low_m:.2f}) to ({right_m:.2f}, {high_m:.2f})",
        x_m=x_m,
        y_m=y_m,
        left_m=min(xs_m),
        low_m=min(ys_m),
        right_m=max(xs_m),
        high_m=max(ys_m),
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
            return from_text(read_file(self._path, LARGEST_BYTES).decode("utf-8"))
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
            return Sentence("localization.pose_not_saved", "the pose cannot be saved: {why}", why=error)
        return ""
