"""A client of rosbridge: what it asks by JSON objects, and what it is sent. It knows no sockets.

Version 2 of the protocol, without PNG, CBOR, services of the client's own, and actions. Whatever cannot be done is said
by a ``status``; a call of a service is answered by its id. A client's memory is bounded by its connection.
"""

import asyncio
import itertools
import json
import math
import time
from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol

import structlog
from msgspec import Struct
from msgspec.json import encode

from chefbot_ros2.commands import SERVICES, Commands, NotConnected
from chefbot_ros2.messages import LATCHED_TOPICS, NS, pose_in_plane
from chefbot_ros2.rosbridge.codec import NotAMessage, from_json, full_name, to_json
from chefbotd.client import ChefbotError
from chefbotd.logs import RateLimitedLog
from chefbotd.rpc.encoding import EventPayload

log = structlog.get_logger("rosbridge")
TRIGGER: Final = "std_srvs/srv/Trigger"
MOST_SUBSCRIPTIONS, MOST_NAMES, MOST_CALLS = 64, 64, 32
"""Topics of a client, its own names for one of them, and calls that wait for the daemon."""

LONGEST_THROTTLE_MS: Final = 3_600_000.0
LONGEST_NAME: Final = 256
EXCESS_EVERY_S: Final = 1.0
STOP_S: Final = 2.0
ROSAPI: Final = "/rosapi/"
VELOCITY: Final = "/cmd_vel"
ESTOP: Final = "estop"
MOVES: Final = frozenset({"arm", "take_control"})
"""Services that a stop makes void when they came before it."""

TAKEN: Final[Mapping[str, tuple[str, Callable[[Commands, Any, float], None]]]] = {
    VELOCITY: (
        "geometry_msgs/msg/Twist",
        lambda commands, message, since_s: commands.drive(message.linear.x, message.angular.z, since_s),
    ),
    "/initialpose": (
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        lambda commands, message, _: commands.set_pose(
            message.header.frame_id, pose_in_plane(message.pose.pose)
        ),
    ),
    "/goal_pose": (
        "geometry_msgs/msg/PoseStamped",
        lambda commands, message, _: commands.navigate(message.header.frame_id, pose_in_plane(message.pose)),
    ),
}
"""What clients may publish: its type, and what is done with it."""


class Outlet(Protocol):
    """Where messages for a client go; it never waits."""

    def reply(self, message: bytes, /) -> None:
        """Send an answer."""
        ...

    def send_event(self, payload: EventPayload, latest: bool, /) -> None:
        """Send an event; ``latest``: while the client is behind, only the newest of its topic is kept."""
        ...


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
        self._last: dict[str, EventPayload] = {}
        self._numbers = itertools.count(1)

    def publish(self, topic: str, message: Any) -> None:
        """Encoded once, and only where somebody wants it or will."""
        self.types[topic] = message.__msgtype__
        listeners = [client for client in self._clients if client.listens(topic)]
        if not listeners and topic not in LATCHED_TOPICS:
            return
        data = encode({"op": "publish", "topic": topic, "msg": to_json(message)})
        payload = EventPayload(topic, next(self._numbers), 0.0, 0.0, data)
        if topic in LATCHED_TOPICS:
            self._last[topic] = payload
        for client in listeners:
            client.offer(topic, payload)

    def is_wanted(self, topic: str) -> bool:
        """Whether a client would be sent a message of this topic now, or nobody knows the topic yet."""
        return topic not in self.types or any(client.listens(topic) for client in self._clients)

    def add(self, client: "Client") -> None:
        """A client has come."""
        self._clients.add(client)

    def remove(self, client: "Client") -> None:
        """A client has gone."""
        self._clients.discard(client)

    def last(self, topic: str) -> EventPayload | None:
        """The last message of a topic that late clients get too."""
        return self._last.get(topic)


class Client:
    """One client; ``outlet`` is its connection. ``now_s`` is the clock of the ages of what it sends."""

    def __init__(self, hub: Hub, source: str, outlet: Outlet, now_s: Callable[[], float]) -> None:
        self._hub, self._outlet, self._now_s = hub, outlet, now_s
        self.commands = Commands(source, self._tell_refused, now_s)
        self._subscriptions: dict[str, Subscription] = {}
        self._refused = ""
        self._calls = 0  # that wait for the daemon
        self._stopping: asyncio.Task[None] | None = None
        self._stops: list[Mapping[str, Any]] = []  # that wait for the daemon
        self._excess, self._tell_excess_s = 0, 0.0
        self._log = RateLimitedLog(log)

    # to the client

    @property
    def is_subscribed(self) -> bool:
        """Whether it takes any topic."""
        return bool(self._subscriptions)

    def listens(self, topic: str) -> bool:
        """Whether it would be sent a message of this topic now."""
        subscription = self._subscriptions.get(topic)
        return subscription is not None and self._now_s() >= subscription.next_s

    def offer(self, topic: str, payload: EventPayload) -> None:
        """A message; a newer one takes the place of one that still waits."""
        subscription = self._subscriptions[topic]
        subscription.next_s = self._now_s() + subscription.period_s
        self._outlet.send_event(payload, True)

    def _answer(self, **words: Any) -> None:
        try:
            message = encode(words)
        except (OverflowError, TypeError, ValueError):  # an id of a thousand digits, or half a letter in it
            message = json.dumps(words, separators=(",", ":")).encode()
        self._outlet.reply(message)

    def tell(self, text: str, request_id: object = None, level: str = "error") -> None:
        """Send a status; refusals are logged, the first at once and the rest as a count."""
        about = {} if request_id is None else {"id": request_id}
        self._log.warning("rosbridge_status", level=level, text=text[:200])
        self._answer(op="status", level=level, msg=text, **about)

    def _tell_refused(self, why: str) -> None:
        if why != self._refused:
            self.tell(why)
        self._refused = why

    # from the client

    def refuse_excess(self, lines: bytes) -> None:
        """Messages that are more than may wait, or came too soon: a call gets an answer, the rest a number."""
        self._excess += lines.count(b"\n") + 1
        if b"call_service" in lines:
            for line in lines.splitlines():
                request = read_call(line) if b"call_service" in line else None
                if request is not None:
                    self._answer_call(request, "too many messages: not done, call it again", result=False)
        now_s = self._now_s()
        if now_s >= self._tell_excess_s:
            self.tell(f"{self._excess} messages were not looked at: they came too fast")
            self._excess, self._tell_excess_s = 0, now_s + EXCESS_EVERY_S

    def stop(self, request: Mapping[str, Any]) -> None:
        """Have the robot stop, before whatever waits; those that come while one is under way share the next."""
        if len(self._stops) >= MOST_CALLS:
            self._answer_call(request, f"{MOST_CALLS} emergency stops are under way already", result=False)
            return
        self._stops.append(request)
        if len(self._stops) == 1:
            self._stopping = self.commands.begin(self._stop())

    async def finish_stops(self) -> None:
        """Wait for the stops that are under way: they count, even where their client is gone."""
        if self._stopping is not None:
            await asyncio.wait([self._stopping], timeout=STOP_S)

    async def _stop(self) -> None:
        while self._stops:
            count = len(self._stops)
            values = await self._trigger(ESTOP)
            for request in self._stops[:count]:
                self._answer_call(request, values, result=True)
            del self._stops[:count]

    def handle(self, text: bytes, age_s: float = 0.0, overtaken: str = "") -> None:
        """One JSON object. Whatever is wrong with it is answered, and nothing is done.

        It has waited for ``age_s``; ``overtaken`` says which stop came before it: then it does not move the robot.
        """
        try:
            request = json.loads(text)
            operation = request["op"]
            handler = OPERATIONS[operation]
        except (ValueError, TypeError, KeyError, RecursionError):
            known = ", ".join(OPERATIONS)
            self.tell(f"expected a JSON object with one of these as op: {known}")
            return
        try:
            handler(self, request, age_s, overtaken)
        except (NotAMessage, NotConnected, KeyError, TypeError, ValueError, OverflowError) as problem:
            reason = f"{problem} is missing" if isinstance(problem, KeyError) else str(problem)
            self._refuse(operation, request, reason)
        except Exception as problem:  # noqa: BLE001 - told and logged: one message must not end a connection
            self._log.warning("rosbridge_fault", operation=operation, error=repr(problem)[:500])
            self._refuse(operation, request, "a fault in the bridge; it is in its log")

    def _refuse(self, operation: str, request: Mapping[str, Any], reason: str) -> None:
        try:
            self.tell(f"{operation}: {reason[:500]}", request.get("id"))
        except RecursionError:  # of its id
            self.tell(f"{operation}: {reason[:500]}")

    def _subscribe(self, request: dict[str, Any], age_s: float, overtaken: str) -> None:
        topic, name = absolute(request["topic"]), request.get("id")
        published, wanted = self._hub.types.get(topic), request.get("type")
        if published and wanted and full_name(wanted) != published:
            raise NotAMessage(f"{topic} is {published}, not {wanted}")
        period_s = throttle_s(request.get("throttle_rate"))
        known = self._subscriptions.get(topic)
        if known is None:
            if len(self._subscriptions) >= MOST_SUBSCRIPTIONS:
                raise NotAMessage(f"at most {MOST_SUBSCRIPTIONS} subscriptions are allowed")
            self._subscriptions[topic] = Subscription({name}, period_s)
        else:
            if len(known.ids) >= MOST_NAMES and name not in known.ids:
                raise NotAMessage(f"at most {MOST_NAMES} subscriptions of one topic are allowed")
            known.ids.add(name)
            known.period_s = min(known.period_s, period_s)
        self._explain_encoding(topic, request)
        last = self._hub.last(topic)
        if last is not None:
            self.offer(topic, last)

    def _explain_encoding(self, topic: str, request: dict[str, Any]) -> None:
        """What a client asked for and does not get: it gets plain JSON, whole."""
        compression = request.get("compression")
        if compression not in ("none", None):
            self.tell(
                f"{topic} comes as plain JSON, not as {compression!a:.40}", request.get("id"), "warning"
            )
        if request.get("fragment_size") is not None:
            self.tell(f"{topic} comes whole, not in fragments", request.get("id"), "warning")

    def _unsubscribe(self, request: dict[str, Any], age_s: float, overtaken: str) -> None:
        topic = absolute(request["topic"])
        subscription = self._subscriptions.get(topic)
        if subscription is None:
            return
        subscription.ids.discard(request.get("id"))
        if "id" not in request or not subscription.ids:
            del self._subscriptions[topic]

    def _advertise(self, request: dict[str, Any], age_s: float, overtaken: str) -> None:
        topic, wanted = absolute(request["topic"]), full_name(request["type"])
        if topic not in TAKEN:
            raise NotAMessage(f"the robot does not take {topic}; it takes {', '.join(TAKEN)}")
        if TAKEN[topic][0] != wanted:
            raise NotAMessage(f"{topic} is {TAKEN[topic][0]}, not {wanted}")

    def _unadvertise(self, request: dict[str, Any], age_s: float, overtaken: str) -> None:
        """A client that no longer drives stands, at once."""
        if absolute(request["topic"]) == VELOCITY:
            self.commands.drive(0.0, 0.0)

    def _publish(self, request: dict[str, Any], age_s: float, overtaken: str) -> None:
        topic = absolute(request["topic"])
        if topic not in TAKEN:
            raise NotAMessage(f"the robot does not take {topic}; it takes {', '.join(TAKEN)}")
        type_name, take = TAKEN[topic]
        message = from_json(type_name, request.get("msg", {}))
        if overtaken:
            raise NotAMessage(f"{topic}: {overtaken}")
        take(self.commands, message, self._now_s() - age_s)

    def _call_service(self, request: dict[str, Any], age_s: float, overtaken: str) -> None:
        name = absolute(request["service"])
        service = name.removeprefix("/")
        if name.startswith(ROSAPI):
            self._answer_call(request, *self._ask_rosapi(name.removeprefix(ROSAPI), request))
        elif service not in SERVICES:
            self._answer_call(request, f"there is no service {name}", result=False)
        elif service == ESTOP:
            self.stop(request)
        elif overtaken and service in MOVES:
            self._answer_call(request, {"success": False, "message": overtaken}, result=True)
        elif self._calls >= MOST_CALLS:
            self._answer_call(request, f"{self._calls} calls wait already: not done", result=False)
        else:
            self._calls += 1
            self.commands.begin(self._call(request, service))

    async def _call(self, request: Mapping[str, Any], service: str) -> None:
        try:
            values = await self._trigger(service)
        finally:
            self._calls -= 1
        self._answer_call(request, values, result=True)

    async def _trigger(self, name: str) -> dict[str, object]:
        try:
            await SERVICES[name](self.commands)
        except (ChefbotError, NotConnected) as problem:
            return {"success": False, "message": str(problem)}
        return {"success": True, "message": "done"}

    def _answer_call(self, request: Mapping[str, Any], values: object, result: bool) -> None:
        about = {"id": request["id"]} if "id" in request else {}
        service = request["service"]
        try:
            self._answer(op="service_response", service=service, values=values, result=result, **about)
        except RecursionError:  # of its id
            self._answer(op="service_response", service=service, values=values, result=result)

    def _ask_rosapi(self, name: str, request: dict[str, Any]) -> tuple[Any, bool]:
        try:
            return self._about(name, request.get("args") or {})
        except (NotAMessage, KeyError, TypeError) as problem:
            missing = isinstance(problem, KeyError)
            return f"{problem} is missing" if missing else f"expected an object with names: {problem}", False

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

    def _ignore(self, request: dict[str, Any], age_s: float, overtaken: str) -> None:
        """How much a client wants to be told."""


OPERATIONS: Final[Mapping[str, Callable[[Client, dict[str, Any], float, str], None]]] = {
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
    if not isinstance(topic, str) or not 0 < len(topic) <= LONGEST_NAME:
        raise NotAMessage(f"expected a name of at most {LONGEST_NAME} letters")
    return topic if topic.startswith("/") else f"/{topic}"


def throttle_s(rate: Any) -> float:
    """The least time between two messages, of ``throttle_rate`` in milliseconds."""
    if rate is None:
        return 0.0
    if isinstance(rate, bool) or not isinstance(rate, int | float):
        raise NotAMessage("throttle_rate: expected milliseconds")
    if not 0 <= rate <= LONGEST_THROTTLE_MS or not math.isfinite(rate):
        raise NotAMessage(f"throttle_rate: expected milliseconds from 0 to {LONGEST_THROTTLE_MS:g}")
    return float(rate) / 1000


def read_call(text: bytes) -> dict[str, Any] | None:
    """The call of a service in a message; None: it is none."""
    try:
        request = json.loads(text)
        is_call = request["op"] == "call_service" and isinstance(request["service"], str)
    except (ValueError, TypeError, KeyError, RecursionError):
        return None
    return request if is_call else None
