"""What the daemon tells, as ROS messages: they leave through a function. It knows no rclpy."""

import asyncio
import time
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from typing import Any, Final

import structlog

from chefbot_ros2.commands import Commands
from chefbot_ros2.diagnostics import ERROR, OK, WARN, diagnostic_array, status
from chefbot_ros2.map_messages import MapFromOdom, String, fixed_transforms, occupancy_grid, path
from chefbot_ros2.messages import MAP, NS, ODOM, TFMessage, frame_of, messages, stamped, transform
from chefbot_ros2.topic_events import events_of, pose_of
from chefbotd.client import CallError, ChefbotError, Client
from chefbotd.client.event import Event
from chefbotd.client.models import SafetyData
from chefbotd.core.geometry import Pose2D

log = structlog.get_logger("ros2")
Connect = Callable[[], AbstractAsyncContextManager[Client]]
Publish = Callable[[str, Any], None]
"""Takes a topic and its message."""

AGAIN_S, DIAGNOSTICS_S, CLOCK_S, MAP_S = 1.0, 1.0, 10.0, 2.0
PINGS: Final = 5
MEASURED: Final = ("odometry", "wheels", "imu", "ranges", "scan", "map_pose", "path")
STATES: Final = (
    "battery",
    "link",
    "worker",
    "lidars",
    "localization",
    "navigation",
    "mapping",
    "map",
)
NO_MAP: Final = {"no_map_loaded", "unknown_map", "worker_unavailable", "map_unreadable"}


class Session:
    """One after the other, connections to the daemon, each as the agent ``name``; ``run`` holds them until cancelled."""

    def __init__(
        self,
        connect: Connect,
        publish: Publish,
        name: str,
        version: str,
        commands: Commands | None = None,
        is_wanted: Callable[[str], bool] = lambda topic: True,
        on_safety: Callable[[SafetyData], None] = lambda safety: None,
    ) -> None:
        """``commands`` are asked on the same connection; what is measured is published on topics that are wanted.

        ``on_safety`` is told of each change of the gate.
        """
        self._connect, self._publish, self._name, self._version = connect, publish, name, version
        self._commands, self._is_wanted, self._on_safety = commands, is_wanted, on_safety
        self._robot: Client | None = None
        self.stop_number: int | None = None  # of the robot's last stop or fault, as far as it is known
        self._why = "not connected yet"
        self._latest: dict[str, Any] = {}
        self._has_new_map = asyncio.Event()
        self._forget()

    def _forget(self) -> None:
        """A new connection may be to another daemon, with another clock."""
        self._offset_ns = 0
        self._wheel_names: tuple[str, ...] = ()
        self._map_from_odom = MapFromOdom()
        self._frames: set[str] = set()
        self._static: list[Any] = []
        self._latest.clear()

    # connecting

    async def run(self) -> None:
        """Connect, and connect again when that is lost; diagnostics are published all the time."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._report())
            while True:
                try:
                    async with self._connect() as robot:
                        await self._work(robot)
                except* (ChefbotError, OSError, TimeoutError) as problems:
                    self._why = "; ".join(str(problem) for problem in problems.exceptions)
                    log.warning("no connection to the daemon", why=self._why)
                await asyncio.sleep(AGAIN_S)

    async def _work(self, robot: Client) -> None:
        self._forget()
        await robot.register_agent(self._name, self._version)
        self._offset_ns = await clock_offset_ns(robot)
        await self._describe(robot)
        offered = {name.removeprefix("topic.") for name in robot.hello.capabilities}
        try:
            async with asyncio.TaskGroup() as tasks:
                self._robot, self._why = robot, ""
                log.info("connected to the daemon", robot=robot.hello.robot)
                tasks.create_task(self._follow(robot, [topic for topic in MEASURED if topic in offered]))
                tasks.create_task(self._watch(robot, [topic for topic in STATES if topic in offered]))
                if "safety" in offered:
                    tasks.create_task(self._watch_stops(robot))
                if self._commands is not None:
                    tasks.create_task(self._commands.serve(robot))
                tasks.create_task(self._keep_clock(robot))
                if "localization" in offered or "map" in offered:
                    tasks.create_task(self._publish_maps(robot))
        finally:
            self._robot = None

    async def _keep_clock(self, robot: Client) -> None:
        """The computers' clocks may be set while it runs."""
        while True:
            await asyncio.sleep(CLOCK_S)
            self._offset_ns = await clock_offset_ns(robot)

    # to ROS

    async def _describe(self, robot: Client) -> None:
        urdf = await robot.get_description()
        if urdf is None:
            return
        self._publish("/robot_description", String(urdf))
        _, frames = fixed_transforms(urdf, time.time_ns())
        self._add_frames(frames.transforms)

    def _add_frames(self, transforms: list[Any]) -> None:
        """Frames that stay; the topic is latched, so each message has all of them."""
        new = [frame for frame in transforms if frame.child_frame_id not in self._frames]
        if new:
            self._static += new
            self._frames |= {frame.child_frame_id for frame in new}
            self._publish("/tf_static", TFMessage(list(self._static)))

    async def _follow(self, robot: Client, topics: list[str]) -> None:
        async with robot.subscribe(topics) as events:
            async for event in events:
                self._take(event)

    def _take(self, event: Event[Any]) -> None:
        if event.topic == "map_pose":
            if event.data.state == "ended":  # the pose in the map before: another one is in use
                self._map_from_odom.latest = None
            else:
                self._map_from_odom.add_map_pose(event.stamp_s, pose_of(event.data))
        elif event.topic == "path":
            self._publish(*path(event.data, stamped(event.stamp_s, self._offset_ns)))
        elif event.topic == "wheels":
            self._wheel_names = event.data.name
        elif event.topic == "odometry":
            self._map_from_odom.add_odometry(event.stamp_s, pose_of(event.data))
        for measured in events_of(event):
            self._add_sensor_frame(event, measured)
            for topic, message in messages(measured, self._offset_ns, self._wheel_names, self._is_wanted):
                if topic == "/tf":
                    self._add_map_frame(message, event.stamp_s)
                self._publish(topic, message)

    def _add_map_frame(self, message: Any, stamp_s: float) -> None:
        """With the stamp of odometry: so no other look-up has to wait for the next pose in the map."""
        if self._map_from_odom.latest is not None:
            stamp_ns = stamped(stamp_s, self._offset_ns)
            message.transforms.append(transform(stamp_ns, MAP, ODOM, self._map_from_odom.latest))

    def _add_sensor_frame(self, event: Event[Any], measured: Any) -> None:
        """The frame in which a sensor measures, where the description calls it otherwise."""
        name = getattr(measured, "lidar", None) or getattr(measured, "sensor", None)
        if name is None or frame_of(name) in self._frames:
            return
        stamp_ns = stamped(event.stamp_s, self._offset_ns)
        if event.topic == "scan":
            other = f"lidar_{frame_of(name)}"
            place = transform(stamp_ns, "base_footprint", frame_of(name), measured.base_from_lidar)
        else:
            other = f"infrared_{frame_of(name)}"
            place = transform(stamp_ns, "ultrasonic_link", frame_of(name), Pose2D())
        if other in self._frames:
            place = transform(stamp_ns, other, frame_of(name), Pose2D())
        self._add_frames([place])

    async def _watch(self, robot: Client, topics: list[str]) -> None:
        """The states; a map is asked for when one of them says that there is another one."""
        seen: dict[str, Any] = {}
        async with robot.subscribe(topics, max_rate_hz=1 / MAP_S) as events:
            async for event in events:
                self._latest[event.topic] = event.data
                self._take(event)
                mark = {"localization": "map", "mapping": "state", "map": "revision"}.get(event.topic)
                if mark is not None and seen.get(event.topic) != getattr(event.data, mark):
                    seen[event.topic] = getattr(event.data, mark)
                    self._has_new_map.set()

    async def _watch_stops(self, robot: Client) -> None:
        """Each at once, for what is asked from now on."""
        async with robot.subscribe("safety", policy="ordered") as events:
            async for event in events:
                self._latest[event.topic] = event.data
                self.stop_number = event.data.stop_number
                self._on_safety(event.data)
                if self._commands is not None:
                    self._commands.stop_number = self.stop_number

    async def _publish_maps(self, robot: Client) -> None:
        while True:
            await self._has_new_map.wait()
            self._has_new_map.clear()
            try:
                image = await robot.get_map()
                self._publish(*occupancy_grid(image, time.time_ns()))
            except CallError as refused:
                if refused.kind not in NO_MAP:
                    log.warning("the map cannot be had", why=refused.message)

    async def _report(self) -> None:
        while True:
            if self._robot is None:
                bridge = status("bridge", ERROR, self._why)
            else:
                refused = "" if self._commands is None else self._commands.refused
                bridge = status("bridge", WARN if refused else OK, refused or "connected")
            self._publish(*diagnostic_array(time.time_ns(), bridge, self._latest))
            await asyncio.sleep(DIAGNOSTICS_S)


async def clock_offset_ns(robot: Client) -> int:
    """From the daemon's clock to 1970: by the fastest of some pings."""
    fastest_ns, offset_ns = -1, 0
    for _ in range(PINGS):
        asked_ns = time.time_ns()
        stamp_s = (await robot.ping()).stamp_s
        took_ns = time.time_ns() - asked_ns
        if fastest_ns < 0 or took_ns < fastest_ns:
            fastest_ns, offset_ns = took_ns, asked_ns + took_ns // 2 - round(stamp_s * NS)
    return offset_ns
