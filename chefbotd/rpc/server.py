"""The command socket: its parts, and the bus's events on their way to the clients."""

import asyncio
from collections import Counter
from typing import Any

import structlog

from chefbotd.bus import Bus, Inbox
from chefbotd.clock import Clock
from chefbotd.messages.results import Hello
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.access import UNGUARDED, Guard
from chefbotd.rpc.connection_manager import ConnectionManager
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.describe import prepare
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.methods import Methods
from chefbotd.rpc.parameters import ApiParameters, is_loopback
from chefbotd.rpc.robot import Robot
from chefbotd.rpc.topics import Topic, link_data, topics
from chefbotd.transport.tcp.arrivals import BEAT_PERIOD_S, Arrivals
from chefbotd.transport.tcp.listener import Listener

log = structlog.get_logger(__name__)

INBOX_EVENTS = 1024
SWEEP_PERIOD_S = 0.25
SCHEMA_PERIOD_S = 0.05
"""The schemas for ``describe`` are built after the start, one at a time: together they take as long as several control
steps."""
FEATURES = ("snapshots", "rate_limits", "policies", "drop_notices", "roles", "control_leases")


class Server:
    """Serves one robot to many clients.

    ``session`` names this run of the daemon; ``wheel_names`` is the order of the tuples in ``WheelsDriven``; ``guard``
    has the tokens and the certificate. ``drops`` counts telemetry that slow clients lost by topic, ``refused``
    connections that were refused or ended by the kind of error, ``faults`` broken handlers by method.
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
        guard: Guard = UNGUARDED,
    ) -> None:
        self._parameters, self._bus, self._guard = parameters, bus, guard
        self._robot_name, self._session = robot_name, session
        self._fanout = Fanout(topics(wheel_names, simulated=simulated), clock, self._tap)
        let_go_s = max(parameters.let_go_s, robot.command_timeout_s)  # who drives may be that slow to repeat
        control = ControlLeases(parameters.lease_s, let_go_s, robot.release, bus.publish)
        self._arrivals = Arrivals(clock)
        methods = Methods(
            robot, self._fanout, clock, control, self._arrivals, guard.keyring, parameters.arm_role
        )
        self._methods = methods.table
        self._capabilities = (
            *(f"method.{name}" for name in self._methods),
            *(f"topic.{name}" for name in self._fanout.topics),
            *(f"feature.{name}" for name in FEATURES),
        )
        dispatcher = Dispatcher(self._methods, clock, self._arrivals, robot.command_timeout_s)
        role = parameters.default_role if guard.keyring is None else None
        self.lobby = ConnectionManager(
            parameters, clock, dispatcher, self._arrivals, self._fanout, control, self._greeting, role
        )
        self._taps: dict[str, tuple[Inbox[Any], asyncio.Task[None]]] = {}
        self._tasks: asyncio.TaskGroup
        self._listening = asyncio.Event()
        self._address = ("", 0)

    async def run(self) -> None:
        """Serve until cancelled.

        Raises:
            CannotListen: the address cannot be listened on.
        """
        doorway = Listener(self.lobby, self._guard.tls)
        self._address = doorway.listen(self._parameters.host, self._parameters.port)
        always = [e for t in self._fanout.topics.values() if not t.on_demand for e in t.events]
        inbox = self._bus.subscribe(*always, size=INBOX_EVENTS)
        try:
            async with asyncio.TaskGroup() as self._tasks:
                self._tasks.create_task(self._beat())
                self._tasks.create_task(doorway.run())
                self._tasks.create_task(self._sweep())
                self._tasks.create_task(self._prepare_description())
                self._announce()
                await self._pump(inbox)
        finally:
            doorway.close()
            inbox.close()
            self.lobby.close()
            await asyncio.sleep(0)  # whoever has not taken its answers by now does not get them
            self.lobby.abort()

    def _announce(self) -> None:
        host, port = self._address
        self._listening.set()
        log.info("api_listening", host=host, port=port, tls=self._guard.tls is not None)
        if not is_loopback(host) and self._guard.tls is None:
            log.warning(
                "api_not_encrypted", hint="set api.tls_certificate and api.tls_key: tokens can be overheard"
            )

    async def address(self) -> tuple[str, int]:
        """Where the server listens; waits until it does."""
        await self._listening.wait()
        return self._address

    @property
    def clients(self) -> int:
        """How many clients are connected now."""
        return len(self.lobby)

    @property
    def drops(self) -> Counter[str]:
        """Telemetry that slow clients lost, by topic."""
        return self.lobby.drops

    @property
    def refused(self) -> Counter[str]:
        """Connections that were refused or ended, by the kind of error."""
        return self.lobby.refused

    @property
    def faults(self) -> Counter[str]:
        """Requests that broke their handler, by method."""
        return self.lobby.dispatcher.faults

    @property
    def void_commands(self) -> Counter[str]:
        """Commands that came before a stop or waited too long, by the kind of error."""
        return self.lobby.dispatcher.void

    async def _beat(self) -> None:
        while True:
            self._arrivals.beat()
            await asyncio.sleep(BEAT_PERIOD_S)

    async def _sweep(self) -> None:
        while True:
            await asyncio.sleep(SWEEP_PERIOD_S)
            self.lobby.sweep()

    async def _prepare_description(self) -> None:
        for _ in prepare(self._methods, self._fanout.topics):
            await asyncio.sleep(SCHEMA_PERIOD_S)

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

    def _greeting(self) -> bytes:
        hello = Hello(
            robot=self._robot_name,
            session=self._session,
            link=link_data(self._fanout.state("link")).state,
            auth="none" if self._guard.keyring is None else "token",
            capabilities=self._capabilities,
        )
        return jsonrpc.notification("hello", hello.model_dump_json().encode())
