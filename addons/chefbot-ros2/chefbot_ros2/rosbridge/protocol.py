"""A client of rosbridge: what it asks by JSON objects, and what it is sent. It knows no sockets.

Version 2 of the protocol, without fragments, PNG and CBOR, services of the client's own, and actions; each is refused by
a ``status``. A client's memory is bounded: of each topic only the newest message waits for a slow one.
"""

import asyncio
import json
import time
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Final

from msgspec import Struct

from chefbot_ros2.commands import SERVICES, Commands, NotConnected
from chefbot_ros2.messages import LATCHED_TOPICS, NS, pose_in_plane
from chefbot_ros2.rosbridge.codec import NotAMessage, from_json, full_name, to_json
from chefbotd.client import ChefbotError

TRIGGER: Final = "std_srvs/srv/Trigger"
MOST_WAITING, MOST_SUBSCRIPTIONS = 64, 64
ROSAPI: Final = "/rosapi/"
VELOCITY: Final = "/cmd_vel"

TAKEN: Final[Mapping[str, tuple[str, Callable[[Commands, Any], None]]]] = {
    VELOCITY: (
        "geometry_msgs/msg/Twist",
        lambda commands, message: commands.drive(message.linear.x, message.angular.z),
    ),
    "/initialpose": (
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        lambda commands, message: commands.set_pose(
            message.header.frame_id, pose_in_plane(message.pose.pose)
        ),
    ),
    "/goal_pose": (
        "geometry_msgs/msg/PoseStamped",
        lambda commands, message: commands.navigate(message.header.frame_id, pose_in_plane(message.pose)),
    ),
}
"""What clients may publish: its type, and what is done with it."""


class Subscription(Struct):
    """Of one topic: the client's names for it, the least time between two messages, and when the next may go."""

    ids: set[str | None]
    period_s: float
    next_s: float = 0.0


class Hub:
    """What the robot publishes, to every client that subscribed to it."""

    def __init__(self) -> None:
        self.types: dict[str, str] = {}
        self._clients: set[Client] = set()
        self._last: dict[str, str] = {}

    def publish(self, topic: str, message: Any) -> None:
        """Encoded once, and only where somebody wants it or will."""
        self.types[topic] = message.__msgtype__
        listeners = [client for client in self._clients if client.listens(topic)]
        if not listeners and topic not in LATCHED_TOPICS:
            return
        text = json.dumps({"op": "publish", "topic": topic, "msg": to_json(message)}, separators=(",", ":"))
        if topic in LATCHED_TOPICS:
            self._last[topic] = text
        for client in listeners:
            client.offer(topic, text)

    def is_wanted(self, topic: str) -> bool:
        """Whether a client would be sent a message of this topic now, or nobody knows the topic yet."""
        return topic not in self.types or any(client.listens(topic) for client in self._clients)

    def add(self, client: "Client") -> None:
        """A client has come."""
        self._clients.add(client)

    def remove(self, client: "Client") -> None:
        """A client has gone."""
        self._clients.discard(client)

    def last(self, topic: str) -> str | None:
        """The last message of a topic that late clients get too."""
        return self._last.get(topic)


class Client:
    """One client; ``next_texts`` is what goes to it."""

    def __init__(self, hub: Hub, source: str, now_s: Callable[[], float] = time.monotonic) -> None:
        self._hub, self._now_s = hub, now_s
        self.commands = Commands(source, self._tell_refused, now_s)
        self._subscriptions: dict[str, Subscription] = {}
        self._newest: dict[str, str] = {}
        self._answers: deque[str] = deque(maxlen=MOST_WAITING)
        self._has_news = asyncio.Event()
        self._refused = ""

    # to the client

    async def next_texts(self) -> list[str]:
        """All that waits for it; waits until there is something."""
        await self._has_news.wait()
        self._has_news.clear()
        texts = [*self._answers, *self._newest.values()]
        self._answers.clear()
        self._newest.clear()
        return texts

    def listens(self, topic: str) -> bool:
        """Whether it would be sent a message of this topic now."""
        subscription = self._subscriptions.get(topic)
        return subscription is not None and self._now_s() >= subscription.next_s

    def offer(self, topic: str, text: str) -> None:
        """A message; a newer one takes the place of one that still waits."""
        subscription = self._subscriptions[topic]
        subscription.next_s = self._now_s() + subscription.period_s
        self._newest[topic] = text
        self._has_news.set()

    def _answer(self, **words: Any) -> None:
        self._answers.append(json.dumps(words, separators=(",", ":")))
        self._has_news.set()

    def _status(self, text: str, request_id: object = None) -> None:
        about = {} if request_id is None else {"id": request_id}
        self._answer(op="status", level="error", msg=text, **about)

    def _tell_refused(self, why: str) -> None:
        if why != self._refused:
            self._status(why)
        self._refused = why

    # from the client

    async def handle(self, text: str | bytes) -> None:
        """One JSON object. Whatever is wrong with it is answered, and nothing is done."""
        try:
            request = json.loads(text)
            operation = request["op"]
            handler = OPERATIONS[operation]
        except (ValueError, TypeError, KeyError, RecursionError):
            known = ", ".join(OPERATIONS)
            self._status(f"expected a JSON object with one of these as op: {known}")
            return
        try:
            await handler(self, request)
        except (NotAMessage, KeyError, TypeError, ValueError) as problem:
            reason = f"{problem} is missing" if isinstance(problem, KeyError) else str(problem)
            self._status(f"{operation}: {reason}", request.get("id"))

    async def _subscribe(self, request: dict[str, Any]) -> None:
        topic = absolute(request["topic"])
        published, wanted = self._hub.types.get(topic), request.get("type")
        if published and wanted and full_name(wanted) != published:
            raise NotAMessage(f"{topic} is {published}, not {wanted}")
        if request.get("compression", "none") not in ("none", None):
            raise NotAMessage("expected the compression none")
        if len(self._subscriptions) >= MOST_SUBSCRIPTIONS:
            raise NotAMessage(f"at most {MOST_SUBSCRIPTIONS} subscriptions are allowed")
        period_s = float(request.get("throttle_rate") or 0) / 1000
        known = self._subscriptions.get(topic)
        if known is None:
            self._subscriptions[topic] = Subscription({request.get("id")}, period_s)
        else:
            known.ids.add(request.get("id"))
            known.period_s = min(known.period_s, period_s)
        last = self._hub.last(topic)
        if last is not None:
            self.offer(topic, last)

    async def _unsubscribe(self, request: dict[str, Any]) -> None:
        topic = absolute(request["topic"])
        subscription = self._subscriptions.get(topic)
        if subscription is None:
            return
        subscription.ids.discard(request.get("id"))
        if "id" not in request or not subscription.ids:
            del self._subscriptions[topic]
            self._newest.pop(topic, None)

    async def _advertise(self, request: dict[str, Any]) -> None:
        topic, wanted = absolute(request["topic"]), full_name(request["type"])
        if topic not in TAKEN:
            raise NotAMessage(f"the robot does not take {topic}; it takes {', '.join(TAKEN)}")
        if TAKEN[topic][0] != wanted:
            raise NotAMessage(f"{topic} is {TAKEN[topic][0]}, not {wanted}")

    async def _unadvertise(self, request: dict[str, Any]) -> None:
        """A client that no longer drives stands, at once."""
        if absolute(request["topic"]) == VELOCITY:
            self.commands.drive(0.0, 0.0)

    async def _publish(self, request: dict[str, Any]) -> None:
        topic = absolute(request["topic"])
        if topic not in TAKEN:
            raise NotAMessage(f"the robot does not take {topic}; it takes {', '.join(TAKEN)}")
        type_name, take = TAKEN[topic]
        take(self.commands, from_json(type_name, request.get("msg", {})))

    async def _call_service(self, request: dict[str, Any]) -> None:
        name, arguments = absolute(request["service"]), request.get("args") or {}
        if name.startswith(ROSAPI):
            values, result = self._about(name.removeprefix(ROSAPI), arguments)
        elif name.removeprefix("/") in SERVICES:
            values, result = await self._trigger(name.removeprefix("/")), True
        else:
            values, result = f"there is no service {name}", False
        about = {"id": request["id"]} if "id" in request else {}
        self._answer(op="service_response", service=request["service"], values=values, result=result, **about)

    async def _trigger(self, name: str) -> dict[str, object]:
        try:
            await SERVICES[name](self.commands)
        except (ChefbotError, NotConnected) as problem:
            return {"success": False, "message": str(problem)}
        return {"success": True, "message": "done"}

    def _about(self, name: str, arguments: Any) -> tuple[Any, bool]:
        """What roslib asks of the node rosapi."""
        topics = {**self._hub.types, **{topic: kind for topic, (kind, _) in TAKEN.items()}}
        services = {f"/{service}": TRIGGER for service in SERVICES}
        now_ns = time.time_ns()
        answers: dict[str, Callable[[], Any]] = {
            "topics": lambda: {"topics": list(topics), "types": list(topics.values())},
            "topic_type": lambda: {"type": topics.get(absolute(arguments["topic"]), "")},
            "services": lambda: {"services": list(services)},
            "service_type": lambda: {"type": services.get(absolute(arguments["service"]), "")},
            "nodes": lambda: {"nodes": ["/chefbot"]},
            "get_time": lambda: {"time": {"sec": now_ns // NS, "nanosec": now_ns % NS}},
        }
        if name not in answers:
            return f"there is no service {ROSAPI}{name}", False
        return answers[name](), True

    async def _ignore(self, request: dict[str, Any]) -> None:
        """How much a client wants to be told."""


OPERATIONS: Final[Mapping[str, Callable[[Client, dict[str, Any]], Awaitable[None]]]] = {
    "subscribe": Client._subscribe,
    "unsubscribe": Client._unsubscribe,
    "advertise": Client._advertise,
    "unadvertise": Client._unadvertise,
    "publish": Client._publish,
    "call_service": Client._call_service,
    "set_level": Client._ignore,
}


def absolute(topic: Any) -> str:
    """With a slash before it."""
    if not isinstance(topic, str):
        raise NotAMessage("expected a name")
    return topic if topic.startswith("/") else f"/{topic}"
