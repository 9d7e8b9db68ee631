"""The interface of a planner: goals and paths, and the rules for every path."""

from typing import Final, Protocol

import numpy as np

from chefbotd.components.navigation.algorithms.costmap import Costmap
from chefbotd.components.navigation.algorithms.grid import Floats, GridFrame
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.core.record import Record

SPACING_M: Final = 0.05
"""The points of a path are so far apart."""

ESCAPE_M: Final = 0.4
"""A robot that stands too near to an obstacle may leave through blocked cells for at most this distance."""


class Goal(Record, frozen=True):
    """A pose in the map; without a heading any will do.

    ``tolerance_m`` allows the nearest free pose instead, if it is no farther away. ``max_speed_m_s`` holds on the way.
    """

    x_m: float
    y_m: float
    heading_rad: float | None = None
    tolerance_m: float = 0.0
    max_speed_m_s: float | None = None


class Path(Record, frozen=True):
    """Points (n, 2) in the grid's frame and the headings at them; its goal, and whether that is a substitute."""

    frame: GridFrame
    points_m: Floats
    heading_rad: Floats
    goal: Goal
    is_substitute: bool = False

    @property
    def length_m(self) -> float:
        """How long it is."""
        return float(np.hypot(*np.diff(self.points_m, axis=0).T).sum())

    @property
    def spacing_m(self) -> float:
        """How far its points are apart."""
        return max(self.length_m / max(len(self.points_m) - 1, 1), 1e-3)

    def away_m(self, place: Pose2D) -> float:
        """How far the nearest of its points is from a place of the grid's frame."""
        return float(np.hypot(self.points_m[:, 0] - place.x_m, self.points_m[:, 1] - place.y_m).min())

    def in_map(self) -> Floats:
        """Its points in the map."""
        return self.frame.to_map(self.points_m)


class NoPath(Record, frozen=True):
    """Why there is no path, as a sentence; the nearest free pose that can be reached, if there is one."""

    reason: str
    nearest: Pose2D | None = None
    only_for_now: bool = False
    """Without what was seen since the map was made there would be a path."""


class Planner(Protocol):
    """Finds the path from a pose of the map to a goal, or says why there is none.

    A path begins at the pose and ends at the goal. No point of it is in a blocked cell, but for the first ``ESCAPE_M``.
    A planner is a pure function: the same costs, pose and goal give the same path.
    """

    def __call__(self, outline: Footprint, costs: Costmap, start: Pose2D, goal: Goal, /) -> Path | NoPath:
        """Start and goal are poses in the map."""


def turn_rad(start: Pose2D, path: Path) -> float:
    """How far the robot turns before it can go: from its heading to the path's first."""
    pose = path.frame.pose_to_grid(start)
    ahead = path.heading_rad[min(4, len(path.heading_rad) - 1)]
    return abs(wrap_angle(float(ahead) - pose.heading_rad))
