"""Everything behind a transport: methods, topics, leases and clients, and the way from the bus to the clients."""

import asyncio
import math
from collections.abc import Callable, Mapping

from chefbotd.bus import Bus, HandlerFailure
from chefbotd.clock import Clock, next_beat
from chefbotd.metrics import Metrics
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.access import Keyring
from chefbotd.rpc.arrivals import LEAST_TIMEOUT_S, SHORT_TICK_S, Arrivals
from chefbotd.rpc.connection_manager import ConnectionManager
from chefbotd.rpc.control_leases import ControlLeases, Sources
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.encoding import encode
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.jobs import Jobs
from chefbotd.rpc.method import Method
from chefbotd.rpc.methods import method_table, prepare
from chefbotd.rpc.models import Greeting, PluginDescription
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.topics import Topic

SWEEP_BEATS = 4
DESCRIBED_AFTER_S = 1.0
FEATURES = ("snapshots", "rate_limits", "policies", "drop_notices", "roles", "control_leases")


class RpcServer:
    """Serves one robot to many clients.

    ``methods`` and ``topics`` are those of the robot's features; the server adds its own. ``session`` names this run of
    the daemon. A command holds for ``command_timeout_s``. ``keyring`` has the tokens (None: no client needs one).
    ``stop_number`` is the number of the robot's last stop or fault.
    """

    def __init__(
        self,
        methods: Mapping[str, Method],
        topics: Mapping[str, Topic],
        bus: Bus,
        clock: Clock,
        parameters: ApiParameters,
        leases: ControlLeases,
        *,
        robot_name: str,
        session: str,
        sources: Sources,
        command_timeout_s: float,
        link_is_up: Callable[[], bool],
        resumed_s: Callable[[], float] = lambda: -math.inf,
        stop_number: Callable[[], int] = lambda: 0,
        keyring: Keyring | None = None,
        plugins: tuple[PluginDescription, ...] = (),
    ) -> None:
        self._bus, self._clock, self._keyring = bus, clock, keyring
        self._robot_name, self._session, self._link_is_up = robot_name, session, link_is_up
        self._command_timeout_s = command_timeout_s
        self._fanout = Fanout(topics, clock, self._tap)
        self.arrivals, self._ticks_with_beat = (
            Arrivals(clock, resumed_s),
            command_timeout_s >= LEAST_TIMEOUT_S,
        )
        jobs = Jobs()
        self._methods = method_table(
            methods, self._fanout, clock, leases, sources, keyring=keyring, jobs=jobs, plugins=plugins
        )
        self._capabilities = (
            *(f"method.{name}" for name in self._methods),
            *(f"topic.{name}" for name in self._fanout.topics),
            *(f"feature.{name}" for name in FEATURES),
        )
        dispatcher = Dispatcher(
            self._methods, clock, self.arrivals, command_timeout_s, jobs, stop_number=stop_number
        )
        role = parameters.default_role if keyring is None else None
        self.connections = ConnectionManager(
            parameters,
            clock,
            dispatcher,
            self.arrivals,
            self._fanout,
            leases,
            self._greeting,
            role,
            bus.publish,
        )
        self._taps: dict[str, Callable[[], None]] = {}
        self._failure = HandlerFailure()

    @property
    def methods(self) -> Mapping[str, Method]:
        """Every method of the socket by name."""
        return self._methods

    def exchange_methods(self, change: Callable[[Method], Method]) -> None:
        """Serve each method as ``change`` makes it."""
        self._methods.update({name: change(method) for name, method in self._methods.items()})

    async def run(self) -> None:
        """Serve the clients of every transport until cancelled; then close all connections."""
        always = [topic for topic in self._fanout.topics.values() if not topic.on_demand]
        ends = [self._fanout.listen_to(topic, self._bus, self._failure.report) for topic in always]
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._tick())
                tasks.create_task(self._sweep())
                tasks.create_task(self._prepare_description())
                await self._failure.wait()
        finally:
            for end in ends:
                end()
            self.connections.close()
            await asyncio.sleep(0)  # answers that are not sent by now are lost
            self.connections.abort()

    @property
    def asks_for_tokens(self) -> bool:
        """Whether a client has to show a token."""
        return self._keyring is not None

    def exchange_tokens(self, keyring: Keyring) -> None:
        """Other tokens open the socket from now on; raises ``ValueError`` where none is asked for."""
        if self._keyring is None:
            raise ValueError("tokens cannot be added to a daemon that was started without them")
        self._keyring.exchange(keyring)
        self.connections.check_tokens(self._keyring.role_of_digest)

    def set_issued_tokens(self, roles: Mapping[bytes, Role]) -> None:
        """These open the socket too, by their digests; raises ``ValueError`` where no token is asked for."""
        if self._keyring is None:
            raise ValueError("tokens cannot be added to a daemon that was started without them")
        self._keyring.set_issued(roles)
        self.connections.check_tokens(self._keyring.role_of_digest)

    def add_metrics(self, metrics: Metrics) -> None:
        """Add what the server counts."""
        connections, dispatcher = self.connections, self.connections.dispatcher
        metrics.gauge("clients", "Clients that are connected now.", lambda: len(connections))
        metrics.counters(
            "clients_refused", "Connections that were refused or ended.", "error", lambda: connections.refused
        )
        metrics.counters(
            "handler_faults", "Requests whose handler failed.", "method", lambda: dispatcher.faults
        )
        metrics.counters(
            "void_commands",
            "Commands that a stop overtook or that waited too long.",
            "error",
            lambda: dispatcher.void,
        )
        metrics.counter(
            "telemetry_dropped",
            "Events that were dropped for slow clients.",
            lambda: connections.drops.total(),
        )

    async def _tick(self) -> None:
        while True:
            self.arrivals.tick()
            await (next_beat(self._clock) if self._ticks_with_beat else asyncio.sleep(SHORT_TICK_S))

    async def _sweep(self) -> None:
        while True:
            await next_beat(self._clock, SWEEP_BEATS)
            self.connections.sweep()

    async def _prepare_description(self) -> None:
        """Build the schemas for ``describe``, one a beat: all at once would take as long as several control steps.

        Not before ``DESCRIBED_AFTER_S``: the start has the processor until the board has been told to stop.
        """
        await asyncio.sleep(DESCRIBED_AFTER_S)
        for _ in prepare(self._methods, self._fanout.topics):
            await next_beat(self._clock)

    def _tap(self, topic: Topic, has_subscribers: bool) -> None:
        """Take a topic's events off the bus only while someone wants them; its publisher can tell."""
        if has_subscribers:
            self._taps[topic.name] = self._fanout.listen_to(topic, self._bus, self._failure.report)
        else:
            self._taps.pop(topic.name)()
        if topic.demanded is not None:
            topic.demanded(has_subscribers)

    def _greeting(self) -> bytes:
        hello = Greeting(
            robot=self._robot_name,
            session=self._session,
            link="up" if self._link_is_up() else "down",
            auth="none" if self._keyring is None else "token",
            capabilities=self._capabilities,
            command_timeout_s=self._command_timeout_s,
        )
        return jsonrpc.notification("hello", encode(hello))
