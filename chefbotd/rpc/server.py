"""Everything behind a transport: methods, topics, leases and clients, and the way from the bus to the clients."""

import asyncio
from collections import Counter
from typing import Any

from chefbotd.bus import Bus, Inbox
from chefbotd.clock import Clock
from chefbotd.messages.results import Hello
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.access import Keyring
from chefbotd.rpc.arrivals import TICK_PERIOD_S, Arrivals
from chefbotd.rpc.connection_manager import ConnectionManager
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.describe import prepare
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.methods import Methods
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.rpc.robot import Robot
from chefbotd.rpc.topics import Topic, link_data, topics

INBOX_EVENTS = 1024
SWEEP_PERIOD_S = 0.25
SCHEMA_PERIOD_S = 0.05
"""The schemas for ``describe`` are built after the start, one at a time: together they take as long as several control
steps."""
FEATURES = ("snapshots", "rate_limits", "policies", "drop_notices", "roles", "control_leases")


class RpcServer:
    """Serves one robot to many clients.

    ``session`` names this run of the daemon; ``wheel_names`` is the order of the tuples in ``WheelsDriven``;
    ``keyring`` has the tokens (None: no client needs one). ``drops`` counts telemetry that slow clients lost
    by topic, ``refused`` connections that were refused or ended by the kind of error, ``faults`` broken handlers by
    method.
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
        keyring: Keyring | None = None,
    ) -> None:
        self._bus, self._keyring = bus, keyring
        self._robot_name, self._session = robot_name, session
        self._fanout = Fanout(topics(wheel_names, simulated=simulated), clock, self._tap)
        control = ControlLeases(parameters.lease_s, robot.let_go_s, robot.release, bus.publish)
        self.arrivals = Arrivals(clock)
        methods = Methods(robot, self._fanout, clock, control, self.arrivals, keyring, parameters.arm_role)
        self._methods = methods.table
        self._capabilities = (
            *(f"method.{name}" for name in self._methods),
            *(f"topic.{name}" for name in self._fanout.topics),
            *(f"feature.{name}" for name in FEATURES),
        )
        dispatcher = Dispatcher(self._methods, clock, self.arrivals, robot.command_timeout_s)
        role = parameters.default_role if keyring is None else None
        self.connections = ConnectionManager(
            parameters, clock, dispatcher, self.arrivals, self._fanout, control, self._greeting, role
        )
        self._taps: dict[str, tuple[Inbox[Any], asyncio.Task[None]]] = {}
        self._tasks: asyncio.TaskGroup

    async def run(self) -> None:
        """Serve the clients of every transport until cancelled; then close all connections."""
        always = [e for t in self._fanout.topics.values() if not t.on_demand for e in t.events]
        inbox = self._bus.subscribe(*always, size=INBOX_EVENTS)
        try:
            async with asyncio.TaskGroup() as self._tasks:
                self._tasks.create_task(self._tick())
                self._tasks.create_task(self._sweep())
                self._tasks.create_task(self._prepare_description())
                await self._pump(inbox)
        finally:
            inbox.close()
            self.connections.close()
            await asyncio.sleep(0)  # answers that are not sent by now are lost
            self.connections.abort()

    @property
    def clients(self) -> int:
        """How many clients are connected now."""
        return len(self.connections)

    @property
    def drops(self) -> Counter[str]:
        """Telemetry that slow clients lost, by topic."""
        return self.connections.drops

    @property
    def refused(self) -> Counter[str]:
        """Connections that were refused or ended, by the kind of error."""
        return self.connections.refused

    @property
    def faults(self) -> Counter[str]:
        """Requests that broke their handler, by method."""
        return self.connections.dispatcher.faults

    @property
    def void_commands(self) -> Counter[str]:
        """Commands that came before a stop or waited too long, by the kind of error."""
        return self.connections.dispatcher.void

    async def _tick(self) -> None:
        while True:
            self.arrivals.tick()
            await asyncio.sleep(TICK_PERIOD_S)

    async def _sweep(self) -> None:
        while True:
            await asyncio.sleep(SWEEP_PERIOD_S)
            self.connections.sweep()

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
            auth="none" if self._keyring is None else "token",
            capabilities=self._capabilities,
        )
        return jsonrpc.notification("hello", hello.model_dump_json().encode())
