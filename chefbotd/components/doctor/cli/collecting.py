"""Collects the events of a robot for a while, with the latest values as a snapshot."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Collection, Iterable
from typing import Any

from msgspec import Struct, field

from chefbotd.client import Client, Event
from chefbotd.client.models import ScanData
from chefbotd.components.doctor.algorithms.lidar import ScanTaken
from chefbotd.components.doctor.algorithms.sensors import Attitude
from chefbotd.core.geometry import Pose2D

STALE_S = 1.0
"""The first event of a topic is its latest value, however old."""

QUEUE = 50_000
SNAPSHOT_S = 0.7
"""A lidar at 5 turns a second, and a board at 2 cycles a second, have told something by then."""


@contextlib.asynccontextmanager
async def collect_events(robot: Client, topics: Iterable[str]) -> AsyncIterator[list[Event[Any]]]:
    """A list that grows by every fresh event of these topics while the block lasts; unknown topics are left out."""
    available = [topic for topic in topics if f"topic.{topic}" in robot.hello.capabilities]
    events: list[Event[Any]] = []
    async with robot.subscribe(available, policy="ordered", queue_size=QUEUE) as subscription:

        async def keep() -> None:
            async for event in subscription:
                _keep_fresh(events, event)

        keeping = asyncio.create_task(keep())
        try:
            yield events
        finally:
            keeping.cancel()
            await asyncio.gather(keeping, return_exceptions=True)


def _keep_fresh(events: list[Event[Any]], event: Event[Any]) -> None:
    if event.age_s < STALE_S:
        events.append(event)


class Snapshot(Struct):
    """The robot at rest: where its wheels and its odometry are, how it lies, and what it sees."""

    position_rad: dict[str, float] = field(default_factory=dict)
    pose: Pose2D | None = None
    attitude: Attitude | None = None
    beams_m: dict[str, float | None] = field(default_factory=dict)
    scans: dict[str, ScanTaken] = field(default_factory=dict)


async def snapshot(robot: Client) -> Snapshot:
    """What is told within ``SNAPSHOT_S``."""
    async with collect_events(robot, ("wheels", "odometry", "imu", "ranges", "scan")) as events:
        await asyncio.sleep(SNAPSHOT_S)
    seen = Snapshot()
    for event in events:
        _see(seen, event)
    return seen


def _see(seen: Snapshot, event: Event[Any]) -> None:
    data = event.data
    match event.topic:
        case "wheels":
            seen.position_rad = dict(zip(data.name, data.position_rad, strict=True))
        case "odometry":
            seen.pose = Pose2D(data.x_m, data.y_m, data.heading_rad)
        case "imu":
            seen.attitude = attitude(data)
        case "ranges":
            seen.beams_m = {beam.sensor: beam.range_m for beam in data.ranges}
        case "scan":
            seen.scans[data.lidar] = scan(data)


def attitude(data: Any) -> Attitude:
    """An IMU's reading."""
    return Attitude(data.orientation, data.linear_acceleration_m_s2, data.heading_rad)


def scan(data: ScanData) -> ScanTaken:
    """A lidar's turn, with its bearings whether they are even or not."""
    count = len(data.range_mm)
    if data.bearing_step_rad is not None:
        bearings = [data.bearing_start_rad + data.bearing_step_rad * index for index in range(count)]
    else:
        bearings = [value / 1000 for value in data.bearing_mrad or (0,) * count]
    return ScanTaken(
        Pose2D(data.x_m, data.y_m, data.yaw_rad),
        tuple(bearings),
        tuple([value / 1000 for value in data.range_mm]),
    )


def of_topic(events: Collection[Event[Any]], topic: str) -> list[Event[Any]]:
    """The events of one topic, oldest first."""
    return [event for event in events if event.topic == topic]
