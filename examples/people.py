"""Counts the people around a robot that stands: what its lidar sees and its map has not: ``python -m examples.people``.

A lamp that was moved counts too, and who stands at a wall does not.
"""

import asyncio
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from chefbotd.client import Client
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OccupancyGrid
from examples.program import run
from examples.scans import Array, points_of

WATCHED_S = 10.0
CLEAR_M, GAP_M = 0.2, 0.3
"""A person's points are so far from all that the map has, and those of two persons so far from each other."""

FEWEST_POINTS, NARROWEST_M, WIDEST_M = 4, 0.1, 0.8


async def main(robot: Client) -> str:
    """The number that most of the scans show."""
    grid = (await robot.get_map()).grid()
    counts: Counter[int] = Counter()
    ends_s = asyncio.get_running_loop().time() + WATCHED_S
    async with robot.subscribe("scan") as scans:
        async for scan in scans:
            pose = (await robot.get_state()).map_pose
            points = in_map(points_of(scan.data), Pose2D(pose.x_m, pose.y_m, pose.heading_rad))
            counts[len(people_in(points[is_free(grid, points)]))] += 1
            if asyncio.get_running_loop().time() > ends_s:
                break
    ((number, times),) = counts.most_common(1)
    return f"{number} people, in {times} of {counts.total()} scans."


def in_map(points: Array, map_from_base: Pose2D) -> Array:
    """Points of the robot's frame, in the map's."""
    cos, sin = np.cos(map_from_base.heading_rad), np.sin(map_from_base.heading_rad)
    x, y = points.T
    return np.column_stack((map_from_base.x_m + cos * x - sin * y, map_from_base.y_m + sin * x + cos * y))


def is_free(grid: OccupancyGrid, points: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Whether the map has nothing but floor within ``CLEAR_M`` of each point (in a square)."""
    origin, reach = grid.map_from_grid, int(np.ceil(CLEAR_M / grid.resolution_m))
    cells = np.floor((points - (origin.x_m, origin.y_m)) / grid.resolution_m).astype(int)
    floor = np.pad(grid.percent, reach, constant_values=-1) == FREE
    steps = range(2 * reach + 1)
    rows, columns = np.clip(cells[:, 1], 0, None), np.clip(cells[:, 0], 0, None)
    inside = (rows < grid.percent.shape[0]) & (columns < grid.percent.shape[1])
    rows, columns = rows * inside, columns * inside
    return np.asarray(
        inside & np.all([floor[rows + dy, columns + dx] for dy in steps for dx in steps], axis=0)
    )


def people_in(points: Array) -> list[Array]:
    """The groups of points that may be a person; points of one turn, in its order."""
    if not len(points):
        return []
    groups = np.split(points, 1 + np.flatnonzero(np.hypot(*np.diff(points, axis=0).T) > GAP_M))
    if len(groups) > 1 and np.hypot(*(points[-1] - points[0])) <= GAP_M:  # over the seam of the turn
        groups = [np.concatenate((groups[-1], groups[0])), *groups[1:-1]]
    return [
        group
        for group in groups
        if len(group) >= FEWEST_POINTS and NARROWEST_M < np.hypot(*np.ptp(group, axis=0)) < WIDEST_M
    ]


def simulated(world: str, seed: int) -> Mapping[str, Any]:
    """In the living room, with two people who walk about in it, and one in the child's room."""
    people = [
        {"path_m": [(2.1, 3.4), (2.4, 3.4)], "speed_m_s": 0.4},
        {"path_m": [(3.3, 1.8), (3.3, 2.6)], "speed_m_s": 0.4},
        {"path_m": [(8.2, 5.9), (8.5, 5.9)], "speed_m_s": 0.4},
    ]
    return {"start": Pose2D(2.45, 2.6, 2.1), "overrides": {"sim.people": people}}


if __name__ == "__main__":
    run(main, simulated)
