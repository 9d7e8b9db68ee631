"""Compares each leg with the truth: its length and time, the closest approach, and the error at the goal."""

import math
from collections.abc import Sequence

import numpy as np
from msgspec import Struct, field

from chefbotd.components.navigation.algorithms.grid import distances_m
from chefbotd.components.navigation.algorithms.search import search
from chefbotd.components.navigation.algorithms.smooth import straighten_path
from chefbotd.components.navigation.algorithms.steering import FollowerLimits
from chefbotd.components.navigation.cli.view import Disc
from chefbotd.components.simulation.world import World
from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.core.occupancy_grid import FREE, OccupancyGrid
from chefbotd.core.record import Record

STILL_M = 1e-4
"""A robot that comes no nearer than this between two of the simulation's reports (25 a second) stands."""


class Leg(Record, frozen=True):
    """From where the robot stood to a place. ``end`` is the goal's, ``reason`` its sentence.

    ``closest_m`` is the least distance of the robot's outline from anything that it could bump into, as far as its own
    motion led there; ``closest_of_all_m`` counts also who walked up to it.
    """

    place: str
    end: str
    reason: str
    length_m: float
    shortest_m: float
    seconds: float
    ideal_s: float
    closest_m: float
    closest_of_all_m: float
    off_m: float
    off_rad: float
    touched: bool

    @property
    def failure(self) -> str | None:
        """Why this leg does not count as done."""
        if self.end != "reached":
            return f"{self.place}: {self.reason or self.end}"
        if self.touched:
            return f"{self.place}: it touched something"
        return None


class Truth(Struct):
    """What truly happens on a leg."""

    world: World
    radius_m: float
    length_m: float = 0.0
    closest_m: float = math.inf
    closest_of_all_m: float = math.inf
    touched: bool = False
    pose: Pose2D | None = None
    discs: tuple[Disc, ...] = field(default=())

    def begin_leg(self) -> None:
        """Count anew."""
        self.length_m, self.touched = 0.0, False
        self.closest_m = self.closest_of_all_m = math.inf

    def add_pose(self, pose: Pose2D, discs: Sequence[Disc], *, in_contact: bool) -> None:
        """The robot is here now, and these stand about.

        A distance from somebody is the robot's own where it is shorter than from where the robot was before.
        """
        here = (pose.x_m, pose.y_m)
        before = here if self.pose is None else (self.pose.x_m, self.pose.y_m)
        self.length_m += math.dist(before, here)
        self.pose, self.discs = pose, tuple(discs)
        apart = {disc: math.dist(here, disc[:2]) - disc[2] for disc in self.discs}
        own = [
            apart_m
            for disc, apart_m in apart.items()
            if math.dist(before, disc[:2]) - disc[2] > apart_m + STILL_M
        ]
        wall_m = self.world.clearance_m(here)
        self.closest_m = min([self.closest_m, *(distance_m - self.radius_m for distance_m in (wall_m, *own))])
        self.closest_of_all_m = min(
            [
                self.closest_of_all_m,
                self.closest_m,
                *(distance_m - self.radius_m for distance_m in apart.values()),
            ]
        )
        self.touched = self.touched or in_contact


def ended_leg(
    place: str, start: Pose2D, goal: Pose2D, end: tuple[str, str], seconds: float, truth: Truth, best: "Best"
) -> Leg:
    """The leg that ends here; ``end`` is the goal's, and its sentence."""
    end_pose = truth.pose or start
    shortest_m = best.length_m(start, goal)
    return Leg(
        place=place,
        end=end[0],
        reason=end[1],
        length_m=truth.length_m,
        shortest_m=shortest_m,
        seconds=seconds,
        ideal_s=best.seconds(start, goal, shortest_m),
        closest_m=truth.closest_m,
        closest_of_all_m=truth.closest_of_all_m,
        off_m=math.dist((end_pose.x_m, end_pose.y_m), (goal.x_m, goal.y_m)),
        off_rad=abs(wrap_angle(end_pose.heading_rad - goal.heading_rad)),
        touched=truth.touched,
    )


def standing_text(truth: Truth, goal: Pose2D) -> str:
    """Who stands where: the robot, and people and things, the nearest first, with their distance from its outline."""
    pose = truth.pose
    if pose is None:
        return "the simulator has not said where the robot stands"
    here = (pose.x_m, pose.y_m)
    away_m = math.dist(here, (goal.x_m, goal.y_m))
    text = f"the robot stands at ({pose.x_m:.2f}, {pose.y_m:.2f}), {away_m:.2f} m from the goal"
    apart = sorted((math.dist(here, disc[:2]) - disc[2] - truth.radius_m, disc) for disc in truth.discs)
    others = [f"({x_m:.2f}, {y_m:.2f}), {apart_m:.2f} m from it" for apart_m, (x_m, y_m, _) in apart]
    return f"{text}; people and things stand at {'; '.join(others)}" if others else text


class Best:
    """The shortest way for the robot's circle among walls and things, and the least time for it.

    People are left out: they cost time, and that is part of what is measured.
    """

    def __init__(self, grid: OccupancyGrid, things: Sequence[Disc], radius_m: float) -> None:
        self._grid, cell_m = grid, grid.resolution_m
        blocked = grid.percent != FREE
        rows, columns = np.indices(blocked.shape)
        for x_m, y_m, disc_m in things:
            at = grid.map_from_grid.inverse().compose(Pose2D(x_m, y_m))
            apart = np.hypot((columns + 0.5) * cell_m - at.x_m, (rows + 0.5) * cell_m - at.y_m)
            blocked |= apart < disc_m
        room_m = distances_m(blocked, cell_m) - cell_m / 2
        self._costs = np.where(room_m > radius_m, 1, np.inf).astype(np.float32)

    def length_m(self, start: Pose2D, goal: Pose2D) -> float:
        """In metres; infinite where there is no way."""
        cells = [self._cell(start), self._cell(goal)]
        costs = self._costs.copy()
        for cell in cells:
            costs[cell] = 1
        path = search(costs, *cells)
        if path is None:
            return math.inf
        corners = straighten_path(path.cells, costs, self._grid.resolution_m)
        grid_from_map = self._grid.map_from_grid.inverse()
        for k, pose in ((0, start), (-1, goal)):
            at = grid_from_map.compose(pose)
            corners[k] = at.x_m, at.y_m
        return float(np.hypot(*np.diff(corners, axis=0).T).sum())

    def _cell(self, pose: Pose2D) -> tuple[int, int]:
        at = self._grid.map_from_grid.inverse().compose(pose)
        return int(at.y_m / self._grid.resolution_m), int(at.x_m / self._grid.resolution_m)

    def seconds(self, start: Pose2D, goal: Pose2D, shortest_m: float) -> float:
        """At full speed all the way, and the turns towards the goal and there to its heading at full rate."""
        bearing = math.atan2(goal.y_m - start.y_m, goal.x_m - start.x_m)
        turns = abs(wrap_angle(bearing - start.heading_rad)) + abs(wrap_angle(goal.heading_rad - bearing))
        fastest = FollowerLimits()
        return shortest_m / fastest.max_speed_m_s + turns / fastest.max_turn_rad_s
