"""The connection to the MQTT broker: keeps itself up, tells whether the robot is there, passes messages on (6.2, 6.14).

Orders come with QoS 0 into a session that ends with the connection: the broker stores none for later.
"""

import asyncio
import random
import socket
import ssl
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

import aiomqtt
import structlog
from msgspec import Struct

from chefbot_vda5050.messages import Connection, ConnectionState, encode
from chefbot_vda5050.topics import QOS, RETAINED, Headers, Kind, RobotName

log = structlog.get_logger("vda5050")

KEEPALIVE_S: Final = 15
"""6.14."""

ANSWER_WITHIN_S: Final = 5.0

FIRST_RETRY_S, LONGEST_RETRY_S = 0.25, 15.0
NO_DELAY: Final = ((socket.IPPROTO_TCP, socket.TCP_NODELAY, 1),)
"""Without it a message waits for the acknowledgement of the one before, up to 40 ms."""

STEADY_S: Final = 60.0
"""A connection that has held so long was no accident: the next attempts begin with short pauses again."""

TAKEN_OVER: Final = 3
"""So many connections that each ended soon after they had begun are no accident."""

LONGEST_PAUSE_S: Final = 120.0
"""Between two attempts where another client takes the connection over, and where the broker refuses to let us listen."""

REFUSED: Final = 0x80
"""The least return code of a subscription that was refused: 3.9.3 of MQTT 3.1.1."""

Receive = Callable[[Kind, bytes, bool], None]


class BrokerParameters(Struct, frozen=True):
    """Where the broker is and how it is spoken to."""

    host: str = "127.0.0.1"
    port: int = 1883
    user: str | None = None
    password: str | None = None
    tls: ssl.SSLContext | None = None
    websocket_path: str | None = None


class SubscriptionRefused(Exception):
    """The broker lets us in, and does not let us listen; the text says to what."""


async def listen_to(client: aiomqtt.Client, topic: str, kind: Kind) -> None:
    """Subscribe to a topic.

    Raises:
        SubscriptionRefused: the broker does not let us.
    """
    granted = await client.subscribe(topic, qos=QOS[kind])
    codes: tuple[Any, ...] = tuple(granted) if isinstance(granted, tuple | list) else (granted,)
    if any(code is not None and int(getattr(code, "value", code)) >= REFUSED for code in codes):
        raise SubscriptionRefused(
            f"the broker refuses the subscription of {topic!a}, so nothing of it would arrive: see its access list"
        )


class Broker:
    """A robot's connection. ``receive`` is called with each message, ``online`` when the connection comes or goes."""

    def __init__(
        self,
        parameters: BrokerParameters,
        name: RobotName,
        headers: Headers,
        *,
        receive: Receive,
        online: Callable[[bool], None],
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._parameters, self._name, self._headers, self._clock = parameters, name, headers, clock
        self._receive, self._online = receive, online
        self._client: aiomqtt.Client | None = None
        self._began_s: float | None = None  # the present connection, or the last one
        self._takes = {name.topic(kind): kind for kind in (Kind.ORDER, Kind.INSTANT_ACTIONS)}

    @property
    def connected(self) -> bool:
        """Whether the broker can be reached."""
        return self._client is not None

    async def run(self) -> None:
        """Be connected until cancelled; then say so and leave."""
        pause_s, ended_soon, was_away, loop = FIRST_RETRY_S, 0, False, asyncio.get_running_loop()
        while True:
            self._began_s, longest_s = None, LONGEST_RETRY_S
            try:
                async with self._connect() as client:
                    await self._serve(client)
            except SubscriptionRefused as refused:
                raise_if_cancelled()
                longest_s = LONGEST_PAUSE_S
                log.error("the robot is not in the fleet", why=str(refused), again_in_s=round(pause_s, 2))
            except (aiomqtt.MqttError, OSError, ValueError) as error:
                raise_if_cancelled()
                log.warning("no connection to the broker", why=str(error), again_in_s=round(pause_s, 2))
            held_s = 0.0 if self._began_s is None else loop.time() - self._began_s
            if self._began_s is None:  # it is away, or lets nobody in: that is not another client's doing
                was_away, ended_soon = True, 0
            elif was_away or held_s >= STEADY_S:
                was_away, ended_soon, pause_s = False, 0, FIRST_RETRY_S
            else:
                ended_soon += 1
            if ended_soon >= TAKEN_OVER:
                longest_s = LONGEST_PAUSE_S
                log.error(
                    "another client takes this connection over: two robots have one serial number",
                    robot=f"{self._name.manufacturer}/{self._name.serial_number}",
                    client=self._identifier,
                    times=ended_soon,
                    hint="a copied card? give each robot its own SERIAL",
                )
            await asyncio.sleep(pause_s * random.uniform(0.8, 1.2))
            pause_s = min(2 * pause_s, longest_s)

    @property
    def _identifier(self) -> str:
        return f"{self._name.manufacturer}-{self._name.serial_number}"

    async def publish(self, kind: Kind, data: bytes) -> None:
        """Send a message; without a connection it is dropped, as the next one says more."""
        client = self._client
        if client is None:
            return
        try:
            await client.publish(self._name.topic(kind), data, qos=QOS[kind], retain=kind in RETAINED)
        except aiomqtt.MqttError as error:
            log.info("a message was not sent", kind=kind, why=str(error))
        raise_if_cancelled()

    def _connect(self) -> aiomqtt.Client:
        parameters = self._parameters
        will = aiomqtt.Will(
            self._name.topic(Kind.CONNECTION),
            self._connection(ConnectionState.BROKEN),
            qos=QOS[Kind.CONNECTION],
            retain=True,
        )
        return aiomqtt.Client(
            parameters.host,
            parameters.port,
            identifier=self._identifier,
            username=parameters.user,
            password=parameters.password,
            tls_context=parameters.tls,
            transport="tcp" if parameters.websocket_path is None else "websockets",
            websocket_path=parameters.websocket_path,
            will=will,
            clean_session=True,
            keepalive=KEEPALIVE_S,
            timeout=ANSWER_WITHIN_S,
            socket_options=NO_DELAY,
        )

    async def _serve(self, client: aiomqtt.Client) -> None:
        try:
            for topic, kind in self._takes.items():
                await listen_to(client, topic, kind)
        except SubscriptionRefused:
            await self._say(client, ConnectionState.OFFLINE)
            raise
        try:
            await self._say(client, ConnectionState.ONLINE)
            self._began_s = asyncio.get_running_loop().time()
            raise_if_cancelled()
            self._client = client
            log.info("connected to the broker", host=self._parameters.host, port=self._parameters.port)
            self._online(True)
            async for message in client.messages:
                self._take(message)
        except asyncio.CancelledError:
            with suppress(aiomqtt.MqttError):
                await self._say(client, ConnectionState.OFFLINE)
            raise
        finally:
            self._client = None
            self._online(False)

    def _take(self, message: aiomqtt.Message) -> None:
        kind = self._takes.get(str(message.topic))
        if kind is None or not isinstance(message.payload, bytes | bytearray):
            return
        try:
            self._receive(kind, bytes(message.payload), bool(message.retain))
        except Exception:
            log.exception("a message cannot be taken", kind=kind, bytes=len(message.payload))

    async def _say(self, client: aiomqtt.Client, connection: ConnectionState) -> None:
        topic = self._name.topic(Kind.CONNECTION)
        await client.publish(topic, self._connection(connection), qos=QOS[Kind.CONNECTION], retain=True)

    def _connection(self, connection: ConnectionState) -> bytes:
        header = self._headers.next(Kind.CONNECTION, self._clock())
        return encode(Connection(**header, connection_state=connection))


def raise_if_cancelled() -> None:
    """End a task that was cancelled while aiomqtt waited: in Python 3.11 ``wait_for`` loses that with an answer.

    Raises:
        asyncio.CancelledError: it was.
    """
    if (task := asyncio.current_task()) is not None and task.cancelling():
        raise asyncio.CancelledError
