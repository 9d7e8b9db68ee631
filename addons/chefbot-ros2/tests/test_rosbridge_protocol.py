"""A client of rosbridge without a socket, and its messages as JSON."""

import asyncio
import json
import math
from typing import Any

import numpy as np
import pytest
from chefbot_ros2.map_messages import String
from chefbot_ros2.messages import NS, Odometry, pose_message, ros_type
from chefbot_ros2.rosbridge.codec import NotAMessage, from_json, to_json
from chefbot_ros2.rosbridge.protocol import Client, Hub
from msgspec.json import encode

from chefbotd.core.geometry import Pose2D
from chefbotd.rpc.encoding import EventPayload

TWIST = "geometry_msgs/msg/Twist"


class Bench:
    """A client whose clock stands; ``say`` is one operation, and what is sent because of it."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.hub = Hub()
        self._answers: list[bytes] = []
        self._newest: dict[str, bytes] = {}
        self.client = Client(self.hub, "ros2", self, lambda: self.now_s)
        self.hub.add(self.client)

    def reply(self, message: bytes) -> None:
        """An answer to the client."""
        self._answers.append(message)

    def send_event(self, payload: EventPayload, latest: bool) -> None:
        """A message of a topic, to a client that is behind."""
        assert latest
        self._newest[payload.topic] = payload.data

    async def say(self, text: str = "", **words: Any) -> list[dict[str, Any]]:
        """Have the client say this; what it is sent."""
        self.client.handle((text or json.dumps(words)).encode())
        return await self.sent()

    async def sent(self) -> list[dict[str, Any]]:
        """What waits for it."""
        for _ in range(5):
            await asyncio.sleep(0)
        texts = [*self._answers, *self._newest.values()]
        self._answers.clear()
        self._newest.clear()
        return [json.loads(text) for text in texts]


def test_a_message_is_json_with_null_for_what_is_not_finite_and_base64_for_bytes() -> None:
    """As rosbridge's own library has it."""
    scan = ros_type("sensor_msgs/LaserScan")
    empty = from_json("sensor_msgs/msg/Range", {"range": 1.5})
    assert to_json(empty)["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    ranges = np.array([1.0, math.inf], dtype=np.float32)
    message = scan(empty.header, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, math.nan, ranges, np.array([], np.float32))
    encoded = to_json(message)
    assert (encoded["ranges"], encoded["intensities"], encoded["range_max"]) == ([1.0, None], [], None)
    image = from_json("nav_msgs/msg/Odometry", {})
    assert isinstance(image, Odometry)
    assert to_json(np.array([1, 2, 255], dtype=np.uint8)) == "AQL/"
    assert to_json(pose_message(Pose2D(1.0, 2.0, 0.0)))["orientation"] == {
        "x": 0.0,
        "y": 0.0,
        "z": 0.0,
        "w": 1.0,
    }


@pytest.mark.parametrize(
    ("value", "problem"),
    [
        ({"linear": {"x": "fast"}}, "msg.linear.x: expected a number"),
        ({"linear": {"x": True}}, "msg.linear.x: expected a number"),
        ({"speed": 1}, "has no speed; it has linear, angular"),
        ({"linear": 3}, "msg.linear: expected an object"),
        ([], "msg: expected an object"),
        ({"linear": {"x": 10**400}}, "msg.linear.x: this number does not fit float64"),
    ],
)
def test_what_is_no_message_is_said_with_its_place(value: Any, problem: str) -> None:
    """Nothing is guessed."""
    with pytest.raises(NotAMessage, match=problem):
        from_json(TWIST, value)


@pytest.mark.parametrize("seconds", ["1e999", "-1e999", "NaN"])
def test_a_whole_number_is_finite(seconds: str) -> None:
    """JSON's 1e999 is infinite for Python; the client goes on and is told."""

    async def scenario() -> None:
        stamp = f'{{"header": {{"stamp": {{"sec": {seconds}}}}}}}'
        bench = Bench()
        (status,) = await bench.say(f'{{"op": "publish", "topic": "/goal_pose", "msg": {stamp}}}')
        assert status["level"] == "error"
        assert "msg.header.stamp.sec: this number does not fit int32" in status["msg"]

    asyncio.run(scenario())


def test_the_cells_of_a_large_map_are_the_same_numbers() -> None:
    """Every value of a byte, many times, those that no map has too; a small map is a list."""
    for least in (-128, -99):
        cells = np.tile(np.arange(least, 128, dtype=np.int8), 100)
        assert json.loads(encode(to_json(cells))) == cells.tolist()
    assert to_json(cells[:256]) == cells[:256].tolist()


def test_what_is_not_given_is_zero_and_a_turn_that_is_not_given_is_none() -> None:
    """The unit quaternion, which turns nothing."""
    pose = from_json("geometry_msgs/msg/PoseStamped", {"pose": {"position": {"x": 2}}}).pose
    assert (pose.position.x, pose.position.y, pose.orientation.w) == (2.0, 0.0, 1.0)


def test_a_subscriber_gets_what_was_latched_and_of_the_rest_the_newest() -> None:
    """A slow client skips messages, and is never sent an old one; unsubscribed, nothing."""

    async def scenario() -> None:
        bench = Bench()
        bench.hub.publish("/robot_description", String("urdf"))
        (latched,) = await bench.say(op="subscribe", topic="robot_description", type="std_msgs/String")
        assert (latched["topic"], latched["msg"]) == ("/robot_description", {"data": "urdf"})
        await bench.say(op="subscribe", id="1", topic="/odom", type="nav_msgs/msg/Odometry")
        for x_m in (1.0, 2.0):
            message = from_json("nav_msgs/msg/Odometry", {"pose": {"pose": {"position": {"x": x_m}}}})
            bench.hub.publish("/odom", message)
        (newest,) = await bench.sent()
        assert newest["msg"]["pose"]["pose"]["position"]["x"] == 2.0
        await bench.say(op="unsubscribe", id="1", topic="/odom")
        bench.hub.publish("/odom", message)
        assert await bench.sent() == []

    asyncio.run(scenario())


def test_a_throttled_topic_is_sent_no_more_often() -> None:
    """At 10 Hz by the clock; of two subscriptions the faster one counts."""

    async def scenario() -> None:
        bench = Bench()
        await bench.say(op="subscribe", id="slow", topic="/odom", throttle_rate=1000)
        await bench.say(op="subscribe", id="fast", topic="/odom", throttle_rate=100)
        counts = []
        for bench.now_s in (0.0, 0.05, 0.1, 0.15, 0.2):
            bench.hub.publish("/odom", from_json("nav_msgs/msg/Odometry", {}))
            counts.append(len(await bench.sent()))
        assert counts == [1, 0, 1, 0, 1]

    asyncio.run(scenario())


@pytest.mark.parametrize(
    ("operation", "problem"),
    [
        ("[1]", "expected a JSON object"),
        ("{", "expected a JSON object"),
        ('{"op": "fragment"}', "expected a JSON object with one of these as op"),
        ('{"op": "subscribe"}', "'topic' is missing"),
        ('{"op": "subscribe", "topic": 3}', "expected a name"),
        ('{"op": "subscribe", "topic": "/odom", "type": "std_msgs/String"}', "is nav_msgs/msg/Odometry"),
        ('{"op": "advertise", "topic": "/odom", "type": "nav_msgs/Odometry"}', "does not take /odom"),
        ('{"op": "advertise", "topic": "/cmd_vel", "type": "std_msgs/String"}', "is geometry_msgs/msg/Twist"),
        ('{"op": "publish", "topic": "/cmd_vel", "msg": {"linear": 1}}', "msg.linear: expected an object"),
    ],
)
def test_whatever_is_wrong_is_answered_and_nothing_is_done(operation: str, problem: str) -> None:
    """By a status of the level error."""

    async def scenario() -> None:
        bench = Bench()
        bench.hub.publish("/odom", from_json("nav_msgs/msg/Odometry", {}))
        (status,) = await bench.say(operation)
        assert (status["op"], status["level"]) == ("status", "error")
        assert problem in status["msg"]

    asyncio.run(scenario())


def test_services_that_are_not_there_or_cannot_be_done_say_so() -> None:
    """The answer has the id of the call."""

    async def scenario() -> None:
        bench = Bench()
        (missing,) = await bench.say(op="call_service", id="7", service="/dance")
        assert (missing["id"], missing["result"]) == ("7", False)
        (stop,) = await bench.say(op="call_service", id="8", service="/estop")
        assert (stop["result"], stop["values"]["success"]) == (True, False)
        assert "no connection" in stop["values"]["message"]
        (kind,) = await bench.say(
            op="call_service", service="/rosapi/service_type", args={"service": "/estop"}
        )
        assert kind["values"] == {"type": "std_srvs/srv/Trigger"}
        (now,) = await bench.say(op="call_service", service="/rosapi/get_time")
        assert now["values"]["time"]["sec"] * NS > 1_700_000_000 * NS

    asyncio.run(scenario())
