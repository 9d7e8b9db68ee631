"""Driving for a while: the command repeated against the daemon's dead-man, and a stop whatever happens."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from chefbotd.client import Client
from chefbotd.core.geometry import Pose2D, Twist2D, wrap_angle

PERIOD_S = 0.05
"""20 Hz, ten times within the daemon's dead-man of 0.5 s."""

SETTLING_PATIENCE_S = 3.0
STILL_M_S = 0.002
STILL_RAD_S = 0.01
MOVED_SHARE = 0.1
"""A robot that did less than this share of what was asked has not moved, for all its limits and ramps."""


@dataclass(slots=True)
class Way:
    """How far the robot went and turned (CCW positive) on its way, looked at more than twice in every turn."""

    start: Pose2D
    latest: Pose2D = field(init=False)
    went_m: float = 0.0
    turned_rad: float = 0.0

    def __post_init__(self) -> None:
        self.latest = self.start

    def look(self, at: Pose2D) -> None:
        """The robot is now here."""
        step = self.latest.inverse().compose(at)
        self.went_m += math.hypot(step.x_m, step.y_m)
        self.turned_rad += wrap_angle(step.heading_rad)
        self.latest = at

    @property
    def moved(self) -> Pose2D:
        """The end seen from the start; a full turn ends where it began."""
        return self.start.inverse().compose(self.latest)


@dataclass(frozen=True, slots=True)
class Drive:
    """What was asked for, and what odometry says happened: the end seen from the start, and the way there."""

    twist: Twist2D
    seconds: float
    moved: Pose2D
    went_m: float
    turned_rad: float

    @property
    def happened(self) -> bool:
        """Whether the robot moved at all, as far as it was asked to."""
        asked_m = abs(self.twist.linear_m_s) * self.seconds
        asked_rad = abs(self.twist.angular_rad_s) * self.seconds
        return self.went_m >= MOVED_SHARE * asked_m and abs(self.turned_rad) >= MOVED_SHARE * asked_rad


async def drive_for(robot: Client, twist: Twist2D, seconds: float, report: Callable[[float], None]) -> Drive:
    """Drive, telling ``report`` the seconds gone by, then stop and wait until the robot stands.

    The stop is sent on every way out: the end, an error, a cancellation. Raises the client's errors.
    """
    way = Way(pose(await odometry(robot)))

    async def command() -> None:
        await robot.drive(twist.linear_m_s, twist.angular_rad_s)
        way.look(pose(await odometry(robot)))

    try:
        await _repeat(command, seconds, report)
    finally:
        await robot.stop()
    await _settle(robot, way)
    return Drive(twist, seconds, way.moved, way.went_m, way.turned_rad)


async def turn_for(
    robot: Client, velocity_rad_s: Mapping[str, float], seconds: float, report: Callable[[float], None]
) -> dict[str, float]:
    """Turn wheels, telling ``report`` the seconds gone by, then stop: how fast each wheel turned before that.

    The stop is sent on every way out. Raises the client's errors.
    """
    try:
        await _repeat(lambda: robot.set_wheel_velocities(velocity_rad_s), seconds, report)
        reading = (await robot.get_state())["topics"].get("wheels", {}).get("data", {})
    finally:
        await robot.stop()
    return dict(zip(reading.get("name", ()), reading.get("velocity_rad_s", ()), strict=True))


async def _repeat(
    command: Callable[[], Awaitable[None]], seconds: float, report: Callable[[float], None]
) -> None:
    loop = asyncio.get_running_loop()
    began_s = loop.time()
    while (gone_s := loop.time() - began_s) < seconds:
        await command()
        report(gone_s)
        await asyncio.sleep(min(PERIOD_S, seconds - gone_s))
    report(seconds)


async def _settle(robot: Client, way: Way) -> None:
    loop = asyncio.get_running_loop()
    patience_ends_s = loop.time() + SETTLING_PATIENCE_S
    while True:
        await asyncio.sleep(PERIOD_S)
        reading = await odometry(robot)
        way.look(pose(reading))
        if standing(reading) or loop.time() > patience_ends_s:
            return


async def odometry(robot: Client) -> dict[str, Any]:
    """The latest reading of the topic ``odometry``; empty when there has been none yet."""
    state = await robot.get_state()
    reading: dict[str, Any] = state["topics"].get("odometry", {}).get("data", {})
    return reading


def standing(reading: dict[str, Any]) -> bool:
    """Whether an odometry reading says that the robot stands."""
    linear_m_s, angular_rad_s = reading.get("linear_m_s", 0.0), reading.get("angular_rad_s", 0.0)
    return bool(abs(linear_m_s) < STILL_M_S and abs(angular_rad_s) < STILL_RAD_S)


def pose(reading: dict[str, Any]) -> Pose2D:
    """The pose in a reading of ``odometry`` or ``sim``; the origin when there is none."""
    return Pose2D(reading.get("x_m", 0.0), reading.get("y_m", 0.0), reading.get("heading_rad", 0.0))
