"""The daemon, as seen from a program: one method per method of the socket.

    async with Client.connect() as robot:
        await robot.arm()
        await robot.drive(linear_m_s=0.2, angular_rad_s=0.0)
        async for event in robot.subscribe("odometry", max_rate_hz=10):
            print(event.data["x_m"])

Every method raises ``CallError``, ``CallTimeout`` or ``ConnectionLost``.
"""

import asyncio
import ssl
from collections import Counter
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, fields
from typing import Any, Literal, Self, TypeVar

from chefbotd.client.errors import ConnectionLost, IncompatibleProtocol, NoGreeting
from chefbotd.client.subscription import Event, Subscription
from chefbotd.client.wire import Wire

PROTOCOL_MAJOR = "1"
CLOSING_PATIENCE_S = 1.0
MAX_REASON_CHARACTERS = 200  # more is cut by the daemon; a line that is too long would end the connection


@dataclass(frozen=True, slots=True)
class Hello:
    """The daemon's greeting; ``session`` changes when the daemon restarts."""

    protocol: str
    robot: str
    session: str
    link: Literal["up", "down"]
    auth: str
    capabilities: tuple[str, ...]


Message = TypeVar("Message", Hello, Event)


class Client:
    """A connected daemon; made by ``connect``."""

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._subscriptions: list[Subscription] = []
        self._wire = Wire(self._notified, self._lost)
        self._greeted = asyncio.Event()
        self.hello: Hello
        self.dropped: Counter[str] = Counter()

    @classmethod
    @asynccontextmanager
    async def connect(
        cls,
        host: str = "127.0.0.1",
        port: int = 7333,
        *,
        token: str | None = None,
        tls: ssl.SSLContext | None = None,
        name: str | None = None,
        timeout_s: float = 5.0,
    ) -> AsyncIterator[Self]:
        """Connect, wait for the greeting, show the token if one is asked for, and say our name if we have one.

        ``tls`` decides which certificates are trusted (``ssl.create_default_context(cafile=...)``); without it the
        connection is not encrypted. ``timeout_s`` also bounds every later call.

        Raises:
            OSError: nobody listens there, or (``ssl.SSLError``) it is not whom we trust.
            CallError: the daemon wants another token (``kind`` is ``wrong_token``).
            NoGreeting: the connection was closed, or stayed silent, before the greeting.
            ConnectionLost: the same, and it was said why.
            IncompatibleProtocol: the daemon speaks another major version.
        """
        client = cls(timeout_s)
        async with asyncio.timeout(timeout_s):
            await asyncio.get_running_loop().create_connection(lambda: client._wire, host, port, ssl=tls)
        try:
            await client._await_greeting()
            if token is not None and client.hello.auth == "token":
                await client.call("authenticate", token=token)
            if name is not None:
                await client.call("introduce", client=name)
            yield client
        finally:
            await client._wire.close(CLOSING_PATIENCE_S)

    async def _await_greeting(self) -> None:
        try:
            async with asyncio.timeout(self._timeout_s):
                await self._greeted.wait()
        except TimeoutError:
            raise NoGreeting(f"no greeting within {self._timeout_s:g} s") from None
        if self._wire.lost is not None:
            raise (ConnectionLost if self._wire.explained else NoGreeting)(str(self._wire.lost))
        if self.hello.protocol.partition(".")[0] != PROTOCOL_MAJOR:
            raise IncompatibleProtocol(f"the daemon speaks {self.hello.protocol}, we {PROTOCOL_MAJOR}.x")

    @property
    def connected(self) -> bool:
        """Whether the connection still stands."""
        return self._wire.lost is None

    async def call(self, method: str, /, **params: Any) -> dict[str, Any]:
        """Any method by its name: the answer's ``result``."""
        return await self._wire.call(method, params, self._timeout_s)

    async def drive(
        self, linear_m_s: float, angular_rad_s: float, source: str | None = None
    ) -> dict[str, Any]:
        """Ask for a velocity; it holds for the daemon's dead-man time, so repeat it.

        Without a source it is the robot's default one that asks. The answer has what the limits allow of it.
        """
        velocity = {"linear_m_s": linear_m_s, "angular_rad_s": angular_rad_s}
        return await self.call("drive", **velocity, **_named(source))

    async def set_wheel_velocities(
        self, velocity_rad_s: Mapping[str, float], source: str | None = None
    ) -> dict[str, Any]:
        """Ask for a speed of each wheel by name; the others stand. It holds, and is answered, as a ``drive`` is."""
        names, velocities = list(velocity_rad_s), list(velocity_rad_s.values())
        return await self.call(
            "set_wheel_velocities", name=names, velocity_rad_s=velocities, **_named(source)
        )

    async def take_control(self, source: str | None = None) -> str | None:
        """Have a source of commands (the robot's default one) for ourselves; who had it until now, if another did."""
        taken_from: str | None = (await self.call("take_control", **_named(source)))["taken_from"]
        return taken_from

    async def release_control(self) -> None:
        """Give back every source that we have; our commands are withdrawn."""
        await self.call("release_control")

    async def stop(self) -> None:
        """Come to rest within the deceleration limit; another ``drive`` moves again."""
        await self.call("stop")

    async def estop(self, reason: str | None = None) -> None:
        """Stop the motors at once, and until ``arm``; of a long reason the beginning is told."""
        await self.call("estop", **({} if reason is None else {"reason": reason[:MAX_REASON_CHARACTERS]}))

    async def arm(self) -> None:
        """Allow motion again after an emergency stop or a fault."""
        await self.call("arm")

    async def ping(self) -> dict[str, Any]:
        """``pong`` and the daemon's ``stamp_s``."""
        return await self.call("ping")

    async def describe(self) -> dict[str, Any]:
        """Methods, topics and error kinds with their JSON Schemas."""
        return await self.call("describe")

    async def get_state(self) -> dict[str, Any]:
        """``link``, ``safety`` and the latest value of each topic with its age."""
        return await self.call("get_state")

    async def get_stats(self) -> dict[str, Any]:
        """The daemon's counters, as in the topic ``stats``."""
        return await self.call("get_stats")

    async def get_pid(self) -> dict[str, dict[str, Any]]:
        """The gains by wheel name."""
        return _wheels(await self.call("get_pid"))

    async def set_pid(self, wheel: str = "all", **changes: Any) -> dict[str, dict[str, Any]]:
        """Change some gains of a wheel, or of all; what every wheel now has."""
        return _wheels(await self.call("set_pid", wheel=wheel, **changes))

    async def undo_pid(self) -> dict[str, dict[str, Any]]:
        """Take the latest change of gains back, whoever made it; what every wheel now has."""
        return _wheels(await self.call("undo_pid"))

    async def reset_odometry(self, x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0) -> None:
        """Say where the robot stands in ``odom``."""
        await self.call("reset_odometry", x_m=x_m, y_m=y_m, heading_rad=heading_rad)

    async def reset_board(self) -> None:
        """Restart the board."""
        await self.call("reset_board")

    def subscribe(
        self,
        topics: str | Iterable[str],
        max_rate_hz: float | None = None,
        policy: Literal["latest", "ordered"] = "latest",
        queue_size: int = 256,
    ) -> Subscription:
        """Events of one or several topics, first the latest value of each; see ``Subscription``.

        The daemon keeps one rate and policy per topic and connection: the last ones asked for.
        """
        wanted = (topics,) if isinstance(topics, str) else tuple(topics)
        options = {} if max_rate_hz is None else {"max_rate_hz": max_rate_hz}

        async def start(subscription: Subscription) -> None:
            self._subscriptions.append(subscription)  # first: the snapshot follows the answer at once
            try:
                await self.call("subscribe", topics=wanted, policy=policy, **options)
            except BaseException:
                self._subscriptions.remove(subscription)
                raise

        return Subscription(wanted, queue_size, start, self._unsubscribe)

    async def _unsubscribe(self, subscription: Subscription) -> None:
        self._subscriptions.remove(subscription)
        still_wanted = {topic for other in self._subscriptions for topic in other.topics}
        over = [topic for topic in subscription.topics if topic not in still_wanted]
        if over:
            await self.call("unsubscribe", topics=over)

    def _notified(self, method: str, params: dict[str, Any]) -> None:
        if method == "event":
            event = _known(Event, params)
            for subscription in self._subscriptions:
                if event.topic in subscription.topics:
                    subscription.put(event)
        elif method == "dropped":
            self._count_drops(params["topics"])
        elif method == "hello":
            self.hello = _known(Hello, params)
            self._greeted.set()

    def _count_drops(self, topics: dict[str, int]) -> None:
        self.dropped.update(topics)
        for subscription in self._subscriptions:
            subscription.dropped.update({t: n for t, n in topics.items() if t in subscription.topics})

    def _lost(self, loss: ConnectionLost) -> None:
        self._greeted.set()
        for subscription in self._subscriptions:
            subscription.end(loss)


def _known(kind: type[Message], params: Mapping[str, Any]) -> Message:
    """A message of this kind; fields that a newer daemon has added are passed over."""
    return kind(**{field.name: _frozen(params[field.name]) for field in fields(kind) if field.name in params})


def _frozen(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _wheels(answer: dict[str, Any]) -> dict[str, dict[str, Any]]:
    wheels: dict[str, dict[str, Any]] = answer["wheels"]
    return wheels


def _named(source: str | None) -> dict[str, str]:
    """The parameter ``source``, if there is one to send."""
    return {} if source is None else {"source": source}
