"""Drives for a given time: repeats the command within the dead-man time, and always ends with zero.

Only our own motion ends by that. A stop would hold everybody else who drives, too.
"""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping

from chefbotd.cli.drive.control import release_source
from chefbotd.client import Client
from chefbotd.client.models import Driven, Limited, OdometryData, SimData, WheelsData, WheelSpeedsSet
from chefbotd.client.state import State
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D, wrap_angle
from chefbotd.core.record import Record

PERIOD_S = 0.05
"""20 Hz, ten times within the daemon's dead-man of 0.5 s."""

SETTLING_PATIENCE_S = 3.0
STILL_M_S = 0.002
STILL_RAD_S = 0.01
MOVED_SHARE = 0.1
"""A robot that covered less than this share of the allowed motion counts as not moved."""


class TravelledPath:
    """How far the robot went and turned (CCW positive) since ``start``. Poses must come at least twice a revolution."""

    def __init__(self, start: Pose2D) -> None:
        self.start = self.latest = start
        self.went_m = self.turned_rad = 0.0

    def add_pose(self, at: Pose2D) -> None:
        """Add the robot's present pose."""
        step = self.latest.inverse().compose(at)
        self.went_m += math.hypot(step.x_m, step.y_m)
        self.turned_rad += wrap_angle(step.heading_rad)
        self.latest = at

    @property
    def moved(self) -> Pose2D:
        """The end seen from the start; a full turn ends where it began."""
        return self.start.inverse().compose(self.latest)


class LimitReport(Record, frozen=True):
    """Why the daemon slowed a command.

    ``limited_by`` names the configured limit that the command exceeds, ``held_by`` whatever else slows the robot.
    """

    limited_by: str | None = None
    held_by: str | None = None

    def limit_line(self, allowed: str) -> str:
        """A line that names the exceeded limit and the allowed speed; empty when no limit was exceeded."""
        return "" if self.limited_by is None else f"Limited by {self.limited_by} to {allowed}.\n"

    @property
    def limit_suffix(self) -> str:
        """The likely reason why the robot did not move, to append to a sentence; may be empty."""
        return "" if self.held_by is None else f"; slowed by {self.held_by}"


class DrivenMotion(Record, frozen=True):
    """The velocity that the daemon allowed, and the motion that odometry measured."""

    allowed: Twist2D
    told: LimitReport
    seconds: float
    moved: Pose2D
    went_m: float
    turned_rad: float

    @property
    def happened(self) -> bool:
        """Whether the robot moved by at least ``MOVED_SHARE`` of what was allowed."""
        allowed_m = abs(self.allowed.linear_m_s) * self.seconds
        allowed_rad = abs(self.allowed.angular_rad_s) * self.seconds
        return self.went_m >= MOVED_SHARE * allowed_m and abs(self.turned_rad) >= MOVED_SHARE * allowed_rad


class DrivenWheels(Record, frozen=True):
    """The speed that the daemon allowed each wheel, and the speed of each wheel at the end, in rad/s."""

    allowed_rad_s: Mapping[str, float]
    told: LimitReport
    turned_rad_s: Mapping[str, float]

    @property
    def stuck(self) -> list[str]:
        """The wheels that turned slower than ``MOVED_SHARE`` of their allowed speed."""
        turned = self.turned_rad_s
        return [
            name
            for name, allowed in self.allowed_rad_s.items()
            if abs(turned.get(name, 0.0)) < MOVED_SHARE * abs(allowed)
        ]


async def drive_for(
    robot: Client, twist: Twist2D, seconds: float, report: Callable[[float], None]
) -> DrivenMotion:
    """Drive, telling ``report`` the seconds gone by, then command zero and wait until the robot stands.

    Zero is commanded on every exit: the end, an error, a cancellation. Raises the client's errors.
    """
    path = TravelledPath(pose(await odometry(robot)))
    answer: Driven | None = None
    limits = LimitReport()

    async def command() -> None:
        nonlocal answer, limits
        answer = await robot.drive(twist.linear_m_s, twist.angular_rad_s)
        state = await robot.get_state()
        limits = _limit_report(answer, state)
        path.add_pose(pose(_odometry(state)))

    try:
        await _repeat(command, seconds, report)
    finally:
        await release_source(robot)
    await _wait_for_standstill(robot, path)
    allowed = STANDING if answer is None else Twist2D(answer.linear_m_s, answer.angular_rad_s)
    return DrivenMotion(allowed, limits, seconds, path.moved, path.went_m, path.turned_rad)


async def turn_for(
    robot: Client, velocity_rad_s: Mapping[str, float], seconds: float, report: Callable[[float], None]
) -> DrivenWheels:
    """Turn wheels, telling ``report`` the seconds gone by, then command zero: how fast each turned before that.

    Zero is commanded on every exit. Raises the client's errors.
    """
    answer = WheelSpeedsSet(name=[], velocity_rad_s=[])

    async def command() -> None:
        nonlocal answer
        answer = await robot.set_wheel_velocities(velocity_rad_s)

    try:
        await _repeat(command, seconds, report)
        state = await robot.get_state()
    finally:
        await release_source(robot)
    turned = _by_name(state.wheels) if "wheels" in state.topics else {}
    return DrivenWheels(_by_name(answer), _limit_report(answer, state), turned)


def _limit_report(answer: Limited, state: State) -> LimitReport:
    return LimitReport(answer.limited_by, state.safety.limited_by)


def _by_name(speeds: WheelSpeedsSet | WheelsData) -> dict[str, float]:
    return dict(zip(speeds.name, speeds.velocity_rad_s, strict=True))


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


async def _wait_for_standstill(robot: Client, path: TravelledPath) -> None:
    loop = asyncio.get_running_loop()
    patience_ends_s = loop.time() + SETTLING_PATIENCE_S
    while True:
        await asyncio.sleep(PERIOD_S)
        reading = await odometry(robot)
        path.add_pose(pose(reading))
        if standing(reading) or loop.time() > patience_ends_s:
            return


async def odometry(robot: Client) -> OdometryData | None:
    """The latest reading of the topic ``odometry``, if there has been one."""
    return _odometry(await robot.get_state())


def _odometry(state: State) -> OdometryData | None:
    return state.odometry if "odometry" in state.topics else None


def standing(reading: OdometryData | None) -> bool:
    """Whether an odometry reading says that the robot stands."""
    return reading is None or (
        abs(reading.linear_m_s) < STILL_M_S and abs(reading.angular_rad_s) < STILL_RAD_S
    )


def pose(reading: OdometryData | SimData | None) -> Pose2D:
    """The pose in a reading; the origin when there is none."""
    return Pose2D() if reading is None else Pose2D(reading.x_m, reading.y_m, reading.heading_rad)
