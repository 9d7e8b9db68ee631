"""Follows the wall to its left for a minute, by the lidar: ``python -m examples.wall``."""

import asyncio
import statistics
from collections.abc import Mapping
from typing import Any

import numpy as np

from chefbotd.client import Client
from chefbotd.core.geometry import Pose2D
from examples.program import run
from examples.scans import Array, points_of

WALL_M, FOLLOWED_S = 0.5, 60.0
SPEED_M_S, TURN_RAD_S = 0.2, 0.6
REACH_M, AHEAD_M = 1.0, 0.65
"""How near the points of the wall are, and at what distance something ahead makes it turn away."""


async def main(robot: Client) -> str:
    """Keep ``WALL_M`` from the wall, turn right in a corner, and left around the end of a wall."""
    distances = []
    ends_s = asyncio.get_running_loop().time() + FOLLOWED_S
    async with robot.subscribe("scan") as scans:
        async for scan in scans:
            points = points_of(scan.data)
            if (wall_m := distance_to_wall(points)) is not None:
                distances.append(wall_m)
            await robot.drive(*steer(points, wall_m))
            if asyncio.get_running_loop().time() > ends_s:
                break
    await robot.drive_for(0.0)
    if not distances:
        return "There was no wall to its left."
    return f"It kept {statistics.median(distances):.2f} m from the wall ({WALL_M} m asked)."


def steer(points: Array, wall_m: float | None) -> tuple[float, float]:
    """The speeds ahead and to the left."""
    ahead = points[(points[:, 0] > 0) & (np.abs(points[:, 1]) < 0.25), 0]
    if len(ahead) and ahead.min() < AHEAD_M:
        return 0.0, -TURN_RAD_S
    if wall_m is None:  # the wall has ended: around its end
        return SPEED_M_S, SPEED_M_S / WALL_M
    x, y = nearest_on_left(points)
    parallel_rad = float(np.arctan2(-x, y))  # 0 where the nearest point of the wall is straight to the left
    turn = 1.5 * parallel_rad + 2.0 * (wall_m - WALL_M)
    return SPEED_M_S, float(np.clip(turn, -TURN_RAD_S, TURN_RAD_S))


def distance_to_wall(points: Array) -> float | None:
    """To the nearest point of the left side; None where there is none within reach."""
    nearest = nearest_on_left(points)
    distance_m = float(np.hypot(*nearest))
    return distance_m if distance_m < REACH_M else None


def nearest_on_left(points: Array) -> Array:
    """The nearest point between 40 degrees and 140 degrees to the left."""
    angles = np.arctan2(points[:, 1], points[:, 0])
    left = points[(angles > 0.7) & (angles < 2.44)]
    if not len(left):
        return np.array([0.0, np.inf])
    nearest: Array = left[np.argmin(np.hypot(left[:, 0], left[:, 1]))]
    return nearest


def simulated(world: str, seed: int) -> Mapping[str, Any]:
    """In the flat's living room."""
    return {"start": Pose2D(2.6, 2.3, 1.6)}


if __name__ == "__main__":
    run(main, simulated)
