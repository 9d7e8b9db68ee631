"""The manager's process: MQTT, the clock and the page around the fleet's decisions."""

import asyncio
import ssl
import time
from collections.abc import Callable
from typing import Final

import aiomqtt
import structlog
from aiohttp import web
from chefbot_vda5050.broker import (
    FIRST_RETRY_S,
    KEEPALIVE_S,
    LONGEST_RETRY_S,
    NO_DELAY,
    BrokerParameters,
    SubscriptionRefused,
    listen_to,
)
from chefbot_vda5050.messages import (
    Action,
    BlockingType,
    Connection,
    ConnectionState,
    InstantActions,
    MalformedMessage,
    Message,
    Order,
    State,
    decode,
    encode,
)
from chefbot_vda5050.topics import EVERY, QOS, Headers, Kind, RobotName, parse_topic

from chefbot_fleet.fleet import Fleet
from chefbot_fleet.orders import CancelOrder, Outgoing
from chefbot_fleet.web import FleetPage
from chefbotd.logs import RateLimitedLog
from chefbotd.transport.web.http_server import ADD_ON_LIMITS, HttpServer

log = structlog.get_logger("fleet")

VERSION: Final = "2.1.0"
TICK_S: Final = 0.2
LISTENS: Final = (Kind.STATE, Kind.CONNECTION, Kind.ORDER)


def steady_clock(
    wall: Callable[[], float] = time.time, monotonic: Callable[[], float] = time.monotonic
) -> Callable[[], float]:
    """A clock with the seconds since 1970 at its start, which goes on evenly when somebody sets the computer's clock.

    Otherwise all robots would have been silent for as long as that clock was set forward.
    """
    offset_s = wall() - monotonic()
    return lambda: offset_s + monotonic()


class Manager:
    """Drives the robots of an interface of the broker."""

    def __init__(
        self,
        fleet: Fleet,
        broker: BrokerParameters,
        clock: Callable[[], float],
        *,
        interface: str = "uagv",
        major_version: str = "v2",
    ) -> None:
        """``clock`` is the fleet's; nothing that is sent shows it."""
        self.fleet, self._clock = fleet, clock
        self._broker, self._interface, self._major_version = broker, interface, major_version
        self._client: aiomqtt.Client | None = None
        self._headers: dict[str, Headers] = {}
        self._pause_s = FIRST_RETRY_S
        self._log = RateLimitedLog(log)

    async def run(self, page: FleetPage, host: str, port: int, tls: ssl.SSLContext | None = None) -> None:
        """Until cancelled; the page listens there."""
        self.fleet.disconnected()
        runner = web.AppRunner(page.application(), access_log=None)
        await runner.setup()
        application = runner.server
        if application is None:
            raise RuntimeError("the page's application has not begun")
        server = HttpServer(
            application.request_handler, "fleet", tls, ADD_ON_LIMITS, make_request=application.request_factory
        )
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(server.run(host, port, self._say_where))
                tasks.create_task(self._stay_connected())
                tasks.create_task(self._tick())
        finally:
            await runner.cleanup()

    def _say_where(self, host: str, port: int) -> None:
        log.info("serving the page", host=host, port=port)

    async def _stay_connected(self) -> None:
        while True:
            pause_s = self._pause_s
            try:
                async with self._connect() as client:
                    await self._serve(client)
            except SubscriptionRefused as refused:
                log.error("the manager hears no robots", why=str(refused), again_in_s=pause_s)
            except (aiomqtt.MqttError, OSError) as error:
                log.warning("no connection to the broker", why=str(error), again_in_s=pause_s)
            finally:
                self._client = None
                self.fleet.disconnected()
            pause_s = self._pause_s
            await asyncio.sleep(pause_s)
            self._pause_s = min(2 * pause_s, LONGEST_RETRY_S)

    def _connect(self) -> aiomqtt.Client:
        broker = self._broker
        return aiomqtt.Client(
            broker.host,
            broker.port,
            username=broker.user,
            password=broker.password,
            tls_context=broker.tls,
            clean_session=True,
            keepalive=KEEPALIVE_S,
            socket_options=NO_DELAY,
        )

    async def _serve(self, client: aiomqtt.Client) -> None:
        every = RobotName(EVERY, EVERY, self._interface, self._major_version)
        for kind in LISTENS:
            await listen_to(client, every.topic(kind), kind)
        self._client = client
        self._pause_s = FIRST_RETRY_S
        self.fleet.connected(self._clock())
        log.info("connected to the broker", host=self._broker.host, port=self._broker.port)
        for name in self.fleet.vehicles:
            await self._ask_for_state(name)
        async for message in client.messages:
            if isinstance(message.payload, bytes | bytearray):
                await self._receive(str(message.topic), bytes(message.payload), bool(message.retain))

    async def _receive(self, topic: str, data: bytes, retained: bool) -> None:
        parsed = parse_topic(topic)
        if parsed is None:
            return
        robot, kind = parsed
        name = f"{robot.manufacturer}/{robot.serial_number}"
        if not data:  # it clears what the broker had kept
            self.fleet.ignored.pop(name, None)
            return
        try:
            if kind is Kind.CONNECTION:
                connection = decode(data, Connection).connection_state
                self.fleet.on_connection(name, connection, self._clock())
                if connection is ConnectionState.ONLINE and name not in self.fleet.vehicles:
                    await self._ask_for_state(name)
            elif kind is Kind.ORDER:
                self.fleet.on_order(name, decode(data, Order).order_id, self._clock())
            elif not retained:  # a state that the broker kept says nothing about now
                self.fleet.on_state(name, decode(data, State), self._clock())
        except MalformedMessage as error:
            self.fleet.ignored[name] = f"its {kind} is malformed: {error}"
        except ValueError as error:  # what one robot says must not end the others' manager
            log.warning("a message does not fit what is known of its robot", robot=name, why=str(error))
        except Exception as problem:  # noqa: BLE001 - told and counted: one message must not end the others' manager
            self._log.warning(
                "a message cannot be taken", robot=name, kind=str(kind), why=repr(problem)[:500]
            )
        self._tell()

    def _tell(self) -> None:
        """What people should know of."""
        for notice in self.fleet.notices:
            log.warning(notice)
        self.fleet.notices.clear()

    async def _tick(self) -> None:
        while True:
            try:
                await self._send_what_is_due()
            except Exception as problem:  # noqa: BLE001 - told and counted: one robot must not end the others' manager
                self._log.warning("the manager sends nothing now", why=repr(problem)[:500])
            self._tell()
            await asyncio.sleep(TICK_S)

    async def _send_what_is_due(self) -> None:
        """What is due by now, one message after the other."""
        for message in self.fleet.tick(self._clock()):
            if isinstance(message, CancelOrder):
                await self._send_action(message.robot, "cancelOrder", message.action_id)
            else:
                await self._send(message)

    async def _send(self, order: Outgoing) -> None:
        header = self._header(order.robot).next(Kind.ORDER, time.time())
        message = Order(
            **header,
            order_id=order.order_id,
            order_update_id=order.update_id,
            nodes=order.nodes,
            edges=order.edges,
        )
        await self._publish(order.robot, Kind.ORDER, message)

    async def _ask_for_state(self, name: str) -> None:
        await self._send_action(name, "stateRequest", f"state-{time.time_ns()}")

    async def _send_action(self, name: str, action_type: str, action_id: str) -> None:
        header = self._header(name).next(Kind.INSTANT_ACTIONS, time.time())
        action = Action(action_type=action_type, action_id=action_id, blocking_type=BlockingType.NONE)
        await self._publish(name, Kind.INSTANT_ACTIONS, InstantActions(**header, actions=(action,)))

    async def _publish(self, name: str, kind: Kind, message: Message) -> None:
        """Send it; without a connection it is dropped, and the fleet sends it again."""
        client = self._client
        if client is None:
            return
        try:
            await client.publish(self._robot(name).topic(kind), encode(message), qos=QOS[kind])
        except aiomqtt.MqttError as error:
            log.info("a message was not sent", robot=name, kind=kind, why=str(error))

    def _header(self, name: str) -> Headers:
        if name not in self._headers:
            self._headers[name] = Headers(self._robot(name), VERSION)
        return self._headers[name]

    def _robot(self, name: str) -> RobotName:
        manufacturer, serial_number = name.split("/", 1)
        return RobotName(manufacturer, serial_number, self._interface, self._major_version)
