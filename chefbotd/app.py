"""The composition root: build every part, wire them, run them in one task group, stop the motors on the way out."""

import asyncio
import os
import random
from collections.abc import Callable, Coroutine, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.component_list import FIRST, OWN, SCANNING
from chefbotd.composition.components import Built, build_own, build_strangers
from chefbotd.composition.context import NO_SUBSTITUTES, DaemonContext, DaemonParts, FeatureBuilder
from chefbotd.composition.network import page_server
from chefbotd.composition.robot import board_session, drive_service, robot_features
from chefbotd.composition.scanners import lidars
from chefbotd.core.events.inputs import DaemonStarted, DaemonStopping, ServiceFailed
from chefbotd.core.record import Stateful
from chefbotd.driving.board.service import board
from chefbotd.features.feature import Feature, Service, Waiting, methods_and_topics
from chefbotd.inputs import inputs_of
from chefbotd.link.board_memory import BoardMemory
from chefbotd.link.board_writer import FaultLog
from chefbotd.link.port import open_port
from chefbotd.link.reconnect import Opener, PortLink
from chefbotd.metrics import Metrics
from chefbotd.motion.limit_preview import LimitPreview
from chefbotd.rpc.access import Guard, load_guard
from chefbotd.rpc.control_leases import ControlLeases, Sources
from chefbotd.rpc.server import RpcServer
from chefbotd.safety.faults import Fault
from chefbotd.safety.latch import GateStore
from chefbotd.settings import Settings
from chefbotd.snapshot import DaemonState
from chefbotd.transport.tcp import TcpServer

Loop = Callable[[], Coroutine[Any, Any, None]]


class ServiceRunner(Protocol):
    """Runs services until they are cancelled; ``failures`` counts by the service's name."""

    @property
    def failures(self) -> Mapping[str, int]:
        """How often each service has failed."""
        ...

    async def run_restarting(self, name: str, loop: Loop, on_failure: Callable[[Fault], None]) -> None:
        """Run a service, and start it again after it has failed and ``on_failure`` has been called."""
        ...

    async def run_critical(self, name: str, loop: Loop) -> None:
        """Run a service that the robot cannot do without: its end is an error."""
        ...


class Daemon:
    """One robot, ready to run: on its serial port, or through whatever ``opener`` opens.

    ``latch`` keeps the gate's state beyond the end of the process, ``supervisor`` runs the services.
    ``features`` makes further ones, beside those that every robot has. ``substitutes`` are what components use in place
    of their own processes and threads, by the component's name. ``session`` tells this start from any other: None makes
    one. ``config_file`` is where the configuration was read from. ``own_process``: it is a program of its own.
    ``board_memory`` keeps whether the board was ours; None: it is not kept.
    """

    def __init__(
        self,
        settings: Settings,
        *,
        clock: Clock,
        latch: GateStore,
        supervisor: ServiceRunner,
        opener: Opener = open_port,
        simulated: bool = False,
        rng: random.Random | None = None,
        features: Sequence[FeatureBuilder] = (),
        substitutes: Mapping[str, Any] = NO_SUBSTITUTES,
        session: str | None = None,
        config_file: Path | None = None,
        own_process: bool = False,
        board_memory: BoardMemory | None = None,
    ) -> None:
        self.bus = Bus()
        self.entries = clock = inputs_of(clock)
        self.entries.bus = self.bus
        rng, self._session = rng or random.Random(), session or os.urandom(4).hex()
        context = DaemonContext(
            settings,
            self.bus,
            clock,
            rng,
            self._session,
            simulated,
            opener,
            substitutes,
            config_file,
            own_process,
        )
        self.session = board_session(context, board_memory)
        link = PortLink(settings.link, self.session, opener, clock, rng)
        self._latch, self._supervisor = latch, supervisor
        self.driving = driving = drive_service(context, self.session, latch)
        self.limit_preview = LimitPreview(settings.drive, settings.chassis, settings.limits)
        driving.wheels.call_on_limits(self.limit_preview.relimit)
        stop_hold_s = settings.safety.held_until_silent_s
        self.leases = ControlLeases(settings.api.lease_s, stop_hold_s, driving.release, self.bus.publish)
        self.metrics = Metrics()
        fault_log = FaultLog(self.bus, self.session.lines)
        board_feature = board(self.session, link, fault_log, driving.brake)
        self.features = self._make_features(context, features, board_feature)
        guard = load_guard(settings.api, os.environ)
        self.tls = guard.tls
        self.rpc = self._rpc_server(settings, guard)
        driving.keeper.call_on_latched(
            lambda: self.rpc.arrivals.record_stop(None, "the robot itself, for a fault")
        )
        self.server = TcpServer(self.rpc, settings.api, guard.tls)
        self.page = page_server(settings, self.rpc, guard, self.metrics, self._page_parts)
        self.state = self._state()
        self._add_metrics()

    def _make_features(
        self, context: DaemonContext, further: Sequence[FeatureBuilder], board_feature: Feature
    ) -> list[Feature]:
        """Each with its services and handlers; what records sees everything first, and the board is opened last."""
        parts, built = self._parts(context), Built()
        recorders = build_own(FIRST, parts, built)
        others = [build(self.bus, context.clock) for build in further]
        scanners = lidars(context)
        scanning = build_own(SCANNING, parts, built)
        basic = robot_features(context, self.driving, self.limit_preview, self.leases)
        own = build_own(OWN, parts, built)
        packaged = [
            *recorders,
            *others,
            *scanners,
            *scanning,
            *basic,
            *own,
        ]
        strangers = build_strangers(parts, built, [*packaged, board_feature])
        self._plugins, self._page_parts, self.strangers_events = (
            tuple(built.descriptions),
            built.page,
            built.events,
        )
        return [*packaged, *strangers, board_feature]

    def _parts(self, context: DaemonContext) -> DaemonParts:
        """What components of ours are built with; the servers come later, as they need every method first."""
        return DaemonParts(
            context,
            self.driving,
            self.leases,
            self.metrics,
            lambda: self.state,
            lambda: self.server.address(),
            self._page_address if context.settings.page.enabled else None,
            lambda: self.rpc,
        )

    async def _page_address(self) -> tuple[str, int]:
        if self.page is None:
            raise RuntimeError("the page is not served")
        return await self.page.address()

    def _rpc_server(self, settings: Settings, guard: Guard) -> RpcServer:
        methods, topics = methods_and_topics(self.features)
        return RpcServer(
            methods,
            topics,
            self.bus,
            self.entries,
            settings.api,
            self.leases,
            robot_name=settings.robot.name,
            session=self._session,
            sources=Sources(
                settings.safety.offered,
                settings.safety.default_source,
                self.driving.take_over,
            ),
            command_timeout_s=settings.safety.command_timeout_s,
            link_is_up=lambda: self.session.is_open,
            resumed_s=lambda: self.driving.resumed_s,
            stop_number=lambda: self.driving.stop_number,
            keyring=guard.keyring,
            plugins=self._plugins,
        )

    def _state(self) -> DaemonState:
        """What a recording needs that begins while the robot drives."""
        parts: dict[str, Stateful] = {f"link/{name}": session for name, session in self.entries.links.items()}
        parts |= {
            f"{feature.name}/{name}": part
            for feature in self.features
            for name, part in feature.parts.items()
        }
        harmless = {
            method.name
            for feature in self.features
            if not any(service.in_steps for service in feature.services)
            for method in feature.methods
        }
        return DaemonState(self.entries, {**parts, "leases": self.leases}, self.waiting, harmless)

    def waiting(self) -> Waiting:
        """The requests that wait for something, and what each goes on with."""
        return {task: run for feature in self.features for task, run in feature.waiting().items()}

    def _add_metrics(self) -> None:
        """Add what the process itself counts, and have every part add its own."""
        metrics = self.metrics
        metrics.counters(
            "bus_dropped", "Events that full inboxes dropped.", "event", lambda: self.bus.drops()
        )
        metrics.counters(
            "service_failures",
            "Services that were started again.",
            "service",
            lambda: self._supervisor.failures,
        )
        self.rpc.add_metrics(metrics)
        for feature in self.features:
            feature.add_metrics(metrics)

    async def run(self, *more: Loop) -> None:
        """Run every part, and ``more`` beside them, until cancelled or until one of them fails.

        The socket listens before the board is touched. However this ends, the motors are told to stop before all else.
        To be cancelled is to end in order; after any other end the next daemon begins disarmed, where a latch is kept.
        """
        with self.entries.entry(self._started):
            pass
        try:
            await self._run_services(*more)
        except asyncio.CancelledError:
            self._latch.end()
            raise

    def _started(self, stamp_s: float) -> DaemonStarted:
        gate = self.driving.keeper.gate
        fault = None if gate.fault is None else str(gate.fault)
        return DaemonStarted(stamp_s, str(gate.mode), gate.reason, fault, self._session)

    def _stop_for_fault(self, fault: Fault) -> None:
        with self.entries.entry(ServiceFailed, fault.reason):
            self.driving.fail(fault)

    def _loop_of(self, service: Service) -> Loop:
        """What runs the service: where a replay runs it again, in steps."""
        if not service.in_steps:
            return service.run
        return partial(self.entries.in_steps, service.name, service.run)

    async def _run_services(self, *more: Loop) -> None:
        run_restarting = partial(self._supervisor.run_restarting, on_failure=self._stop_for_fault)
        run_critical = self._supervisor.run_critical
        async with asyncio.TaskGroup() as group:
            try:
                group.create_task(run_critical("rpc", self.rpc.run))
                group.create_task(run_critical("server", self.server.run))
                await self.server.address()
                if self.page is not None:
                    group.create_task(run_critical("page", self.page.run))
                    await self.page.address()
                for loop in more:
                    group.create_task(loop())
                for service in [listed for feature in self.features for listed in feature.services]:
                    run = run_critical if service.critical else run_restarting
                    group.create_task(run(service.name, self._loop_of(service)))
                await asyncio.Event().wait()
            finally:
                try:
                    if self.entries.recording:
                        self.bus.publish(DaemonStopping(self.entries.now_s()))
                finally:
                    self.driving.detach()
                    self.session.close()
