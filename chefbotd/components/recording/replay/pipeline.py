"""How each entry of a recording comes into the parts of a daemon."""

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Any

from pydantic import ValidationError

from chefbotd.app import Daemon
from chefbotd.components.recording.replay.entries import ReplayEntries, Tasks
from chefbotd.components.recording.replay.recorded import EntryGroup, decode_event
from chefbotd.components.recording.replay.stand_ins import (
    ReplayedCaller,
    ReplayedPort,
    ReplayedSession,
    UnheardProgress,
)
from chefbotd.core.events import inputs
from chefbotd.core.events.inputs import BOARD_LINK
from chefbotd.link.entry_session import health_timer
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.connection_manager import LEASES_TIMER
from chefbotd.rpc.dispatch import job_name
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.safety.faults import Fault, FaultKind

NOT_HANDLED = frozenset(
    {"authenticate", "subscribe", "unsubscribe", "describe", "get_state", "ping", "cancel"}
)
"""Requests that do nothing to the robot. The end of one that is cancelled is a step of its task."""


class Pipeline:
    """``daemon`` was built with ``entries`` as its clock, and is not run. With ``drains``, ports are as full as then."""

    def __init__(self, daemon: Daemon, entries: ReplayEntries, *, drains: bool = True) -> None:
        self._daemon, self._entries, self._drains = daemon, entries, drains
        self._methods = dict(daemon.rpc.methods)
        self._ports: dict[str, ReplayedPort] = {}
        self._callers: dict[int, ReplayedCaller] = {}
        services = [
            service for feature in daemon.features for service in feature.services if service.in_steps
        ]
        self._services = {service.name: service.run for service in services}
        self._tasks = Tasks(self._services, entries)
        self._regular = {health_timer(name): link.judge_health for name, link in entries.links.items()}
        self._regular[LEASES_TIMER] = lambda: daemon.leases.expire(entries.now_s())
        self._inputs = [feature.inputs() for feature in daemon.features]
        self._not_handled = NOT_HANDLED.union(*(feature.not_replayed for feature in daemon.features))
        self._configured = [
            f"{feature.name}/{part}" for feature in daemon.features for part in feature.configured
        ]
        self._input_handlers = {kind: take for given in self._inputs for kind, take in given.take.items()}
        self._handlers: dict[type[Any], Callable[[Any], None]] = {
            inputs.DaemonStarted: lambda entry: None,
            inputs.StateRecorded: lambda entry: None,
            inputs.PortOpened: lambda entry: self._open(entry.link),
            inputs.PortLost: self._lose,
            inputs.PortNotOpened: lambda entry: self._session(entry.link).report_not_opened(entry.reason),
            inputs.PortShared: lambda entry: self._session(entry.link).report_sharers(entry.sharers),
            inputs.PortDrained: lambda entry: self._session(entry.link).resume_writing(),
            inputs.LinkBytesRead: self._read,
            inputs.RequestHandled: self._request,
            inputs.ClientLeft: self._leave,
            inputs.ServiceFailed: self._fail,
            inputs.GainsExchanged: self._retune,
            inputs.LimitsExchanged: self._relimit,
        }
        self._handlers |= self._input_handlers

    async def handle(self, group: EntryGroup) -> str:
        """Let an entry in; what is wrong with it, empty: nothing."""
        entry = group.entry
        self._expect(group)
        if isinstance(entry, inputs.TaskStepped):
            await self._tasks.step(entry.task, cancelled=entry.cancelled)
            return ""
        if isinstance(entry, inputs.TimerFired):
            return self._fire(entry.timer)
        if isinstance(entry, inputs.EventObserved):
            return self._observe(group)
        try:
            if (handle := self._handlers.get(type(entry))) is not None:  # of a part that is here
                handle(entry)
        except UnknownLink as problem:
            return str(problem)
        return ""

    async def begin_late(self, state: inputs.StateRecorded | None, *, keeps_parameters: bool) -> list[str]:
        """The recording began while the daemon ran: services wait, ports are open, and the parts are in this state.

        Without a state every port is open. Returns what cannot be put back.
        """
        await self._tasks.begin_anew()
        self._ports.clear()
        self._callers.clear()
        for link in self._entries.links if state is None else state.open_links:
            self._open(link)
        return [] if state is None else await self._restore(state, keeps_parameters=keeps_parameters)

    async def _restore(self, state: inputs.StateRecorded, *, keeps_parameters: bool) -> list[str]:
        daemon = self._daemon
        self._entries.forget_timers()
        problems = daemon.state.restore(state.parts, self._configured if keeps_parameters else ())
        if BOARD_LINK in self._ports and daemon.session.writer.memory.queries:
            self._ports[BOARD_LINK].set_drained(daemon.session.writer.memory.had_drained)
        for session in daemon.leases.sessions():
            self._callers[session.number] = ReplayedCaller(session)
        for given in self._inputs:
            given.go_on()
        for task, run in list(daemon.waiting().items()):
            self._tasks.add_request(task, partial(run, UnheardProgress()))
            await self._tasks.step(task, cancelled=False)
        return problems

    def close(self) -> None:
        """The replay is over."""
        self._tasks.close()

    def is_regular(self, timer: str) -> bool:
        """Whether a timer fires periodically, independent of what the robot does."""
        return timer in self._regular

    # what is known before

    def _expect(self, group: EntryGroup) -> None:
        drained: dict[int, bool] = {}
        for answer in group.answers():
            if isinstance(answer, inputs.DrainAnswered):
                drained[answer.query] = answer.drained
            elif isinstance(answer, inputs.SetpointWithdrawn):
                self._daemon.session.withdraw_setpoint()
            elif isinstance(answer, inputs.FaultTaken):
                fault = Fault(FaultKind(answer.kind), answer.reason)
                self._daemon.driving.keeper.report_from_thread(fault)
            elif isinstance(answer, inputs.AnswerTaken):
                self._entries.add_answer(answer.asked, answer.answer)
        if drained and self._drains and BOARD_LINK in self._ports:
            self._ports[BOARD_LINK].expect(drained)

    # links

    def _session(self, link: str) -> Any:
        session = self._entries.links.get(link)
        if session is None:
            links = ", ".join(self._entries.links)
            raise UnknownLink(f"the configuration has no link {link!r}; there are {links}")
        return session

    def _open(self, link: str) -> None:
        session = self._session(link)
        session.expect_connection()
        self._ports[link] = ReplayedPort(lambda: self._daemon.session.writer.memory.queries)
        session.connection_made(self._ports[link])

    def _lose(self, entry: inputs.PortLost) -> None:
        error = None if entry.reason is None else OSError(entry.reason)
        self._ports.pop(entry.link, None)
        self._session(entry.link).connection_lost(error)

    def _read(self, entry: inputs.LinkBytesRead) -> None:
        self._session(entry.link).data_received(entry.data)

    # timers and what came from outside

    def _fire(self, timer: str) -> str:
        regular = self._regular.get(timer)
        if regular is not None:
            regular()
            return ""
        return "" if self._entries.fire(timer) else f"the timer '{timer}' does not run here"

    def _observe(self, group: EntryGroup) -> str:
        if not group.followers:
            return "the event that was observed is not in the recording"
        event = decode_event(group.followers[0], self._daemon.strangers_events)
        if (take := self._input_handlers.get(type(event))) is not None:
            take(event)
        self._daemon.bus.publish(event)
        return ""

    # clients

    def _request(self, entry: inputs.RequestHandled) -> None:
        method = self._methods.get(entry.method)
        if method is None or entry.method in self._not_handled or entry.params is None:
            return
        caller = self._caller(entry)
        try:
            params = method.params.model_validate(entry.params)
        except ValidationError:
            return
        if asyncio.iscoroutinefunction(method.handle):
            self._tasks.add_request(job_name(entry.number), partial(method.handle, caller, params, caller))
            return
        try:
            if entry.renews and method.renew is not None and method.renew(caller, params) is not None:
                return
            method.handle(caller, params)
        except Exception:  # noqa: BLE001 - the client was refused, or heard of a fault
            return

    def _caller(self, entry: inputs.RequestHandled) -> ReplayedCaller:
        role = None if entry.role is None else Role(entry.role)
        caller = self._callers.get(entry.client)
        if caller is None:
            newcomer = ReplayedSession(ApiParameters(), "", 0, role, entry.stamp_s)
            caller = self._callers[entry.client] = ReplayedCaller(newcomer)
        session = caller.session
        session.number, session.client, session.role = entry.client, entry.name, role
        if isinstance(session, ReplayedSession):
            session.address = entry.where
        return caller

    def _leave(self, entry: inputs.ClientLeft) -> None:
        caller = self._callers.pop(entry.client, None)
        if caller is None:
            caller = ReplayedCaller(ReplayedSession(ApiParameters(), "", 0, None, entry.stamp_s))
            caller.session.number = entry.client
        self._daemon.rpc.connections.leave(caller.session)

    # the process

    def _fail(self, entry: inputs.ServiceFailed) -> None:
        self._daemon.driving.fail(Fault(FaultKind.SERVICE_FAILED, entry.reason))

    def _retune(self, entry: inputs.GainsExchanged) -> None:
        self._daemon.driving.wheels.retune(
            {name: PidParameters.model_validate(gains) for name, gains in entry.gains.items()}
        )

    def _relimit(self, entry: inputs.LimitsExchanged) -> None:
        self._daemon.driving.wheels.relimit(MotionLimits.model_validate(entry.limits))


class UnknownLink(Exception):
    """Bytes of a link that the configuration does not have."""
