"""Drives a square and ends where it began, by odometry alone: ``python -m examples.square``."""

import math
from collections.abc import Mapping
from typing import Any

from chefbotd.client import Client
from chefbotd.client.models import OdometryData
from chefbotd.core.geometry import Pose2D, wrap_angle
from examples.program import run

SIDE_M, SPEED_M_S = 0.8, 0.25
NEAR_M, NEAR_RAD = 0.01, 0.01
"""The robot stops within these of a corner and of its direction."""


async def main(robot: Client) -> str:
    """Four sides, each towards a corner that is computed beforehand: so the errors do not add up."""
    start = (await robot.get_state()).odometry
    x_m, y_m, heading_rad = start.x_m, start.y_m, start.heading_rad
    for _ in range(4):
        x_m, y_m = x_m + SIDE_M * math.cos(heading_rad), y_m + SIDE_M * math.sin(heading_rad)
        await drive_to(robot, x_m, y_m, heading_rad)
        heading_rad += math.pi / 2
        await turn_to(robot, heading_rad)
    end = (await robot.get_state()).odometry
    off_m = math.dist((start.x_m, start.y_m), (end.x_m, end.y_m))
    return f"The square of {SIDE_M:g} m ended {100 * off_m:.0f} cm from its start, by odometry."


async def drive_to(robot: Client, x_m: float, y_m: float, heading_rad: float) -> None:
    """Drive along ``heading_rad`` until the point is beside the robot, and steer towards the line."""
    async with robot.subscribe("odometry") as events:
        async for event in events:
            here: OdometryData = event.data
            ahead_m = (x_m - here.x_m) * math.cos(heading_rad) + (y_m - here.y_m) * math.sin(heading_rad)
            left_m = (y_m - here.y_m) * math.cos(heading_rad) - (x_m - here.x_m) * math.sin(heading_rad)
            if ahead_m < NEAR_M:
                break
            off_rad = wrap_angle(heading_rad - here.heading_rad)
            await robot.drive(min(SPEED_M_S, ahead_m + 0.03), 2.0 * off_rad + 3.0 * left_m)
    await robot.drive_for(0.0)


async def turn_to(robot: Client, heading_rad: float) -> None:
    """Turn on the spot, the shorter way."""
    async with robot.subscribe("odometry") as events:
        async for event in events:
            off_rad = wrap_angle(heading_rad - event.data.heading_rad)
            if abs(off_rad) < NEAR_RAD:
                break
            await robot.drive(0.0, math.copysign(min(0.8, abs(off_rad) + 0.05), off_rad))
    await robot.drive_for(0.0)


def simulated(world: str, seed: int) -> Mapping[str, Any]:
    """In the middle of the flat's kitchen."""
    return {"start": Pose2D(5.7, 1.2, 0.0)}


if __name__ == "__main__":
    run(main, simulated)
