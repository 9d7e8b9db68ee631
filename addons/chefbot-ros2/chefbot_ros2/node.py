"""The bridge's half that talks ROS: a managed node on rclpy, with what RViz and Nav2 expect of a robot's topics.

rclpy has a thread of its own; the session lives in the loop of asyncio. A message crosses over by a call, and one that
leaves is published from the loop: rclpy's publishers allow that. Messages leave as bytes that rosbags has encoded, so
bags, this node and rosbridge have the same messages.
"""

import asyncio
import time
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, Final

import structlog
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist, TwistStamped
from rclpy.exceptions import InvalidHandle
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

from chefbot_ros2.commands import SERVICES, Commands, NotConnected
from chefbot_ros2.messages import LATCHED_TOPICS, TYPESTORE, pose_in_plane
from chefbot_ros2.session import Connect, Session
from chefbot_ros2.types import class_of
from chefbotd.client import ChefbotError

log = structlog.get_logger("ros2")
VERSION: Final = "0.1.0"
PATIENCE_S: Final = 3.0

RELIABLE = QoSProfile(depth=10)
NEWEST = QoSProfile(depth=1)
SENSOR = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SENSORS: Final = ("/scan/", "/points/", "/ranges/", "/imu")
ABSOLUTE: Final = {"/tf", "/tf_static", "/diagnostics"}
"""Not in the node's namespace, as in any ROS 2 system."""


class Bridge(LifecycleNode):  # type: ignore[misc]  # rclpy tells no types
    """Unconfigured it has no topics; inactive it has them, and no connection; active it has both."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        connect: Connect,
        on_failure: Callable[[], None],
        **options: Any,
    ) -> None:
        """``on_failure`` is called in the loop when the session has ended by a mistake of ours, which is in the log."""
        super().__init__("chefbot", **options)
        self._loop, self._connect, self._on_failure = loop, connect, on_failure
        self._publishers_by_topic: dict[str, Any] = {}
        self._missing: set[str] = set()
        self._entities: list[tuple[Callable[[Any], Any], Any]] = []
        self._commands: Commands | None = None
        self._task: asyncio.Task[None] | None = None
        self.declare_parameter("source", "ros2")
        self.declare_parameter("stamped_cmd_vel", False)

    # the life of a managed node, in rclpy's thread

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Make what others send to; what is sent is made with its first message."""
        stamped = self.get_parameter("stamped_cmd_vel").value
        on_velocity = self._take_stamped if stamped else self._take_twist
        wanted = [
            (TwistStamped if stamped else Twist, "cmd_vel", on_velocity, NEWEST),
            (PoseWithCovarianceStamped, "initialpose", self._take_pose, RELIABLE),
            (PoseStamped, "goal_pose", self._take_goal, RELIABLE),
        ]
        for kind, topic, callback, qos in wanted:
            entity = self.create_subscription(kind, topic, callback, qos)
            self._entities.append((self.destroy_subscription, entity))
        for name in SERVICES:
            service = self.create_service(Trigger, name, partial(self._serve, name))
            self._entities.append((self.destroy_service, service))
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Connect to the daemon, now or as soon as it is there."""
        self._in_loop(self._start())
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Leave the daemon: what this node drove with is withdrawn, and its goals end as configured."""
        self._in_loop(self._end())
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Remove all topics and services."""
        for destroy, entity in self._entities:
            destroy(entity)
        for publisher in self._publishers_by_topic.values():
            self.destroy_publisher(publisher)
        self._entities.clear()
        self._publishers_by_topic.clear()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """From whatever state it was in."""
        self._in_loop(self._end())
        return self.on_cleanup(state)

    def _in_loop(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(PATIENCE_S)

    # in the loop

    async def _start(self) -> None:
        await self._end()
        source = str(self.get_parameter("source").value)
        self._commands = Commands(source)
        session = Session(self._connect, self._publish, "ros2", VERSION, self._commands, self._is_wanted)
        self._task = asyncio.create_task(session.run())
        self._task.add_done_callback(self._ended)

    def _ended(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (problem := task.exception()) is not None:
            log.error("the bridge has failed", exc_info=problem)
            self._on_failure()

    async def _end(self) -> None:
        task, self._task, self._commands = self._task, None, None
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    def _is_wanted(self, topic: str) -> bool:
        """Of a topic that nobody has seen yet, the first message makes the publisher."""
        publisher = self._publishers_by_topic.get(topic)
        try:
            return publisher is None or publisher.get_subscription_count() > 0
        except InvalidHandle:  # removed in this moment, by a clean-up
            return False

    def _publish(self, topic: str, message: Any) -> None:
        if topic in self._missing:
            return
        publisher = self._publishers_by_topic.get(topic)
        if publisher is None:
            publisher = self._create_publisher(topic, message.__msgtype__)
            if publisher is None:
                return
        try:
            publisher.publish(bytes(TYPESTORE.serialize_cdr(message, message.__msgtype__)))
        except InvalidHandle:
            return

    def _create_publisher(self, topic: str, type_name: str) -> Any:
        kind = class_of(type_name)
        if kind is None:
            self._missing.add(topic)
            log.warning("not published: ROS has no such type here", topic=topic, type=type_name)
            return None
        name = topic if topic in ABSOLUTE else topic.removeprefix("/")
        self._publishers_by_topic[topic] = publisher = self.create_publisher(kind, name, qos_of(topic))
        return publisher

    # what others send, in rclpy's thread

    def _take_twist(self, message: Twist) -> None:
        came_s = time.monotonic()  # not when the loop gets to it
        self._call(lambda commands: commands.drive(message.linear.x, message.angular.z, came_s))

    def _take_stamped(self, message: TwistStamped) -> None:
        self._take_twist(message.twist)

    def _take_pose(self, message: PoseWithCovarianceStamped) -> None:
        frame, pose = message.header.frame_id, pose_in_plane(message.pose.pose)
        self._call(lambda commands: commands.set_pose(frame, pose))

    def _take_goal(self, message: PoseStamped) -> None:
        frame, pose = message.header.frame_id, pose_in_plane(message.pose)
        stop_number = (
            None if self._commands is None else self._commands.stop_number
        )  # not when the loop gets to it
        self._call(lambda commands: commands.navigate(frame, pose, stop_number))

    def _call(self, call: Callable[[Commands], None]) -> None:
        commands = self._commands
        if commands is not None:
            self._loop.call_soon_threadsafe(call, commands)

    def _serve(self, name: str, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        commands = self._commands
        try:
            if commands is None:
                raise NotConnected("the node is not active")
            self._in_loop(SERVICES[name](commands))
            response.success, response.message = True, "done"
        except (ChefbotError, NotConnected, TimeoutError) as problem:
            response.success, response.message = False, str(problem) or type(problem).__name__
        return response


def qos_of(topic: str) -> QoSProfile:
    """What RViz and Nav2 expect: sensors best effort, what is said once for late joiners too.

    All else is reliable; whoever asks for less gets it too, as with /odom and /tf.
    """
    if topic in LATCHED_TOPICS:
        return LATCHED
    return SENSOR if topic.startswith(SENSORS) else RELIABLE
