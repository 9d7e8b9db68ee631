"""The command socket: listens, greets, and brings the bus's events to the clients."""

import asyncio
from collections import Counter
from typing import Any

import structlog

from chefbotd.api import jsonrpc
from chefbotd.api.connection import Connection
from chefbotd.api.dispatch import Dispatcher
from chefbotd.api.fanout import Fanout
from chefbotd.api.jsonrpc import ErrorKind, Failure
from chefbotd.api.methods import Methods
from chefbotd.api.models import Hello
from chefbotd.api.parameters import ApiParameters
from chefbotd.api.robot import Robot
from chefbotd.api.topics import Topic, link_data, topics
from chefbotd.bus import Bus, Inbox
from chefbotd.clock import Clock

log = structlog.get_logger(__name__)

INBOX_EVENTS = 1024
FEATURES = ("snapshots", "rate_limits", "policies", "drop_notices")


class Server:
    """Serves one robot to many clients.

    ``session`` names this run of the daemon; ``wheel_names`` is the order of the tuples in ``WheelsDriven``;
    ``drops`` counts telemetry that slow clients lost, by topic.
    """

    def __init__(
        self,
        robot: Robot,
        bus: Bus,
        clock: Clock,
        parameters: ApiParameters,
        *,
        robot_name: str,
        session: str,
        wheel_names: tuple[str, ...],
        simulated: bool = False,
    ) -> None:
        self.parameters = parameters
        self.drops: Counter[str] = Counter()
        self._bus, self._robot_name, self._session = bus, robot_name, session
        self._fanout = Fanout(topics(wheel_names, simulated=simulated), clock, self._tap)
        methods = Methods(robot, self._fanout, clock)
        self.dispatcher = Dispatcher(methods.table)
        self._capabilities = (
            *(f"method.{name}" for name in methods.table),
            *(f"topic.{name}" for name in self._fanout.topics),
            *(f"feature.{name}" for name in FEATURES),
        )
        self._connections: set[Connection] = set()
        self._taps: dict[str, tuple[Inbox[Any], asyncio.Task[None]]] = {}
        self._tasks: asyncio.TaskGroup
        self._listening = asyncio.Event()
        self._address = ("", 0)

    async def run(self) -> None:
        """Serve until cancelled.

        Raises:
            OSError: the address cannot be listened on.
        """
        listener = await asyncio.get_running_loop().create_server(
            lambda: Connection(self), self.parameters.host, self.parameters.port, start_serving=False
        )
        always = [e for t in self._fanout.topics.values() if not t.on_demand for e in t.events]
        inbox = self._bus.subscribe(*always, size=INBOX_EVENTS)
        try:
            async with asyncio.TaskGroup() as self._tasks:
                await listener.start_serving()
                self._announce(listener)
                await self._pump(inbox)
        finally:
            listener.close()
            inbox.close()
            await self._hang_up()

    def _announce(self, listener: asyncio.Server) -> None:
        host, port = listener.sockets[0].getsockname()[:2]
        self._address = (host, port)
        self._listening.set()
        log.info("api_listening", host=host, port=port)

    async def address(self) -> tuple[str, int]:
        """Where the server listens; waits until it does."""
        await self._listening.wait()
        return self._address

    @property
    def clients(self) -> int:
        """How many clients are connected now."""
        return len(self._connections)

    async def _pump(self, inbox: Inbox[Any]) -> None:
        async for event in inbox:
            self._fanout.publish(event)

    def _tap(self, topic: Topic, wanted: bool) -> None:
        """Take a topic's events off the bus only while someone wants them; its publisher can tell."""
        if wanted:
            inbox = self._bus.subscribe(*topic.events, size=INBOX_EVENTS)
            self._taps[topic.name] = (inbox, self._tasks.create_task(self._pump(inbox)))
        else:
            inbox, pump = self._taps.pop(topic.name)
            inbox.close()
            pump.cancel()

    def welcome(self, connection: Connection) -> bytes | Failure:
        """Take in a client: the greeting for it, or why there is no room."""
        if self.clients >= self.parameters.max_clients:
            log.warning("client_refused", clients=self.clients)
            return Failure(ErrorKind.TOO_MANY_CLIENTS, f"already {self.clients} clients")
        self._connections.add(connection)
        hello = Hello(
            robot=self._robot_name,
            session=self._session,
            link=link_data(self._fanout.state("link")).state,
            capabilities=self._capabilities,
        )
        return jsonrpc.notification("hello", hello.model_dump_json().encode())

    def farewell(self, connection: Connection) -> None:
        """A client is gone, with its subscriptions."""
        self._connections.discard(connection)
        self._fanout.unsubscribe(connection)

    async def _hang_up(self) -> None:
        """Close every connection; whoever has not taken its answers by the next turn does not get them."""
        for connection in tuple(self._connections):
            connection.close()
        await asyncio.sleep(0)
        for connection in tuple(self._connections):
            connection.abort()
