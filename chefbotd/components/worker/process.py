"""The daemon's side of the worker: starts, watches and restarts it, and passes on its skills' messages.

``send`` never waits: what the worker does not read in time gives way. ``request`` waits for an answer, within a
deadline. Whatever the worker does or fails to do, nothing here raises into the control loop or holds it up.
"""

import asyncio
import socket
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, TypeVar

import msgspec
import structlog

from chefbotd.clock import Clock
from chefbotd.components.worker import messages
from chefbotd.components.worker.channel import CLOSED, Channel
from chefbotd.components.worker.messages import FromWorker, Measurement, make_measured, pack_body, unpack_body
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.requests import OnProgress, RequestCancelled, Requests, WorkerLost
from chefbotd.components.worker.spawn import Child, Spawn, spawn
from chefbotd.components.worker.watch import (
    NEXT,
    Vitals,
    WorkerState,
    WorkerTransition,
    backoff_s,
    check_vitals,
    excuse_lateness,
    note_work,
    why_to_kill,
)
from chefbotd.core.commands import Refused
from chefbotd.core.events.inputs import WorkerGone, WorkerSaid
from chefbotd.core.record import MutableState, Record, StatefulPart, replace
from chefbotd.core.sentence import Sentence
from chefbotd.inputs import inputs_of

log = structlog.get_logger(component="worker")

CHECK_S: Final = 0.25
REPORT_S: Final = 1.0
HEALTHY_S: Final = 30.0
"""After so long the next failure is a first one again."""

LEAVE_S: Final = 1.5
"""How long the worker may take to save and leave when the daemon ends."""

NOBODY: Final = 0
"""The number of a request whose answer nobody waits for."""

A = TypeVar("A")
S = TypeVar("S", bound=msgspec.Struct)
OfSkill = messages.SkillEvent | messages.Answer | messages.Failed | messages.RequestProgress


class WorkerStatus(Record, frozen=True):
    """How the worker stands; ``cpu`` is its share of one core in the last second."""

    state: WorkerState = WorkerState.STOPPED
    pid: int | None = None
    restarts: int = 0
    rss_mb: float | None = None
    cpu: float | None = None
    reason: str = ""


class WorkerMemory(MutableState, array_like=True):
    """How the worker stands, and the number of the last request to it; the process itself is none of it."""

    status: WorkerStatus = WorkerStatus()
    last_number: int = 0


class Worker(StatefulPart[WorkerMemory]):
    """One worker process; ``skills`` are the parameters of those it loads, by name, as JSON.

    ``on_status`` is called with each new status.
    """

    def __init__(
        self,
        parameters: WorkerParameters,
        clock: Clock,
        skills: Mapping[str, bytes],
        on_status: Callable[[WorkerStatus], None],
        start: Spawn = spawn,
    ) -> None:
        self._parameters, self._clock, self._skills = parameters, inputs_of(clock), dict(skills)
        self._on_status, self._start = on_status, start
        self._vitals = Vitals(0.0, 0.0, 0.0)
        self._channel: Channel | None = None
        self._ended: asyncio.Future[str] | None = None
        self._requests = Requests(self._clock)
        self.memory, self.parts = WorkerMemory(), {"last_number": self._requests}
        self._listeners: dict[tuple[str, str], Callable[[bytes], None]] = {}
        self._on_ready: list[Callable[[], None]] = []
        self._references: dict[str, str] = {}
        self._dropped = self._failures = 0

    @property
    def dropped_measurements(self) -> int:
        """What was measured and gave way to what is newer."""
        return self._dropped + (self._channel.dropped if self._channel is not None else 0)

    @property
    def is_ready(self) -> bool:
        """Whether it takes requests."""
        return self.memory.status.state is WorkerState.READY

    def add_own_skill(self, name: str, parameters: bytes) -> None:
        """Load this skill of ours too, which a component of ours names."""
        self._skills[name] = parameters

    def add_skill(self, name: str, reference: str, parameters: bytes) -> None:
        """Load a stranger's skill too, ``module:class``: one that fails is left out, and the others go on.

        Raises:
            ValueError: there is one of this name.
        """
        if name in self._skills:
            raise ValueError(f"the worker has a skill named {name!a} already")
        self._skills[name], self._references[name] = parameters, reference

    def add_listener(self, skill: str, kind: type[S], listener: Callable[[S], None]) -> None:
        """Call ``listener`` with the records of this class that this skill tells without having been asked."""
        decoder = msgspec.msgpack.Decoder(kind)
        self._listeners[skill, kind.__name__] = lambda body: listener(unpack_body(decoder, body))

    def add_on_ready(self, handler: Callable[[], None]) -> None:
        """Call ``handler`` each time a worker has become ready: it knows nothing of what the one before it was sent."""
        self._on_ready.append(handler)

    def send(self, event: Measurement) -> None:
        """Send what was measured, if the worker is there; never waits."""
        if self._channel is not None and self.is_ready:
            self._channel.send(make_measured(event))

    def tell(self, skill: str, body: msgspec.Struct) -> None:
        """Have a skill do something whose answer nobody needs, if the worker is there; never waits."""
        if self._channel is not None and self.is_ready:
            self._channel.send(
                messages.SkillRequest(NOBODY, skill, self._parameters.step_timeout_s, pack_body(body))
            )

    async def request(
        self,
        skill: str,
        body: msgspec.Struct,
        answer: type[A],
        *,
        deadline_s: float,
        on_progress: OnProgress | None = None,
        settles: bool = False,
        is_replayed: bool = True,
    ) -> A:
        """Have a skill do something, and return what it answers, which is of the class ``answer``.

        A worker that neither answers nor reports progress within ``deadline_s`` is killed. Cancelling this gives the
        request up. One that ``settles`` waits until the worker has given up, or has done it nevertheless, which is then
        the result: only for a client's request, as a service must end when it is cancelled. One that is made within
        ``InputLog.outside`` is not ``is_replayed``.

        Raises:
            Refused: it was not done, and why; ``WorkerLost`` where nobody can say whether it was.
        """
        if self._channel is None or not self.is_ready:
            raise WorkerLost(_why_not_ready(self.memory.status))
        number, future = self._requests.open(deadline_s, on_progress, is_replayed=is_replayed)
        self._channel.send(messages.SkillRequest(number, skill, deadline_s, pack_body(body)))
        decoder = msgspec.msgpack.Decoder(answer)
        try:
            return unpack_body(decoder, await asyncio.shield(future))
        except asyncio.CancelledError:
            if future.done() or self._channel is None:
                raise
            self._channel.send(messages.Cancel(number))
            if not settles:
                raise
            try:
                return unpack_body(decoder, await future)
            except (RequestCancelled, Refused):
                raise asyncio.CancelledError from None
        finally:
            self._requests.close(number)

    async def run(self) -> None:
        """Keep a worker alive until cancelled."""
        try:
            while True:
                begun_s = self._clock.now_s()
                reason = await self._run_once()
                if self.memory.status.state is WorkerState.UNAVAILABLE:  # starting it again would not help
                    self._report_status(replace(self.memory.status, pid=None, rss_mb=None, cpu=None))
                    break
                self._failures = 1 if self._clock.now_s() - begun_s > HEALTHY_S else self._failures + 1
                wait_s = backoff_s(self._parameters, self._failures)
                log.warning("the worker has ended", reason=reason, again_in_s=wait_s)
                self._set(WorkerTransition.ENDED, pid=None, rss_mb=None, cpu=None, reason=reason)
                await asyncio.sleep(wait_s)
                self.memory.status = replace(self.memory.status, restarts=self.memory.status.restarts + 1)
            await asyncio.Event().wait()
        finally:
            self._set(WorkerTransition.STOPPED, pid=None, rss_mb=None, cpu=None)

    async def _run_once(self) -> str:
        """Start a worker, and watch it until its end; the reason."""
        ours, theirs = socket.socketpair()
        try:
            child = await self._start(theirs, self._parameters)
        except BaseException as error:
            ours.close()
            if isinstance(error, OSError):
                return f"it cannot be started: {error}"
            raise
        finally:
            theirs.close()
        now_s = self._clock.now_s()
        self._vitals = Vitals(spawned_s=now_s, heard_s=now_s, checked_s=now_s)
        self._ended = asyncio.get_running_loop().create_future()
        self._channel = Channel(ours, 1024 * self._parameters.queue_kb, self._take_message, self._mark_ended)
        self._channel.send(messages.Configure(self._skills, self._references))
        self._set(WorkerTransition.SPAWNED, pid=child.pid)
        waiting = asyncio.create_task(child.wait(), name="worker's end")
        try:
            return await self._watched(child, waiting, self._ended)
        except asyncio.CancelledError:
            self._channel.close()
            await asyncio.wait({waiting}, timeout=LEAVE_S)
            raise
        finally:
            self._end_process(child)
            await waiting

    async def _watched(self, child: Child, waiting: "asyncio.Task[str]", ended: "asyncio.Future[str]") -> str:
        """Check it four times a second until it ends, says nonsense, or breaks a bound."""
        reported_s, cpu_s = self._clock.now_s(), child.cpu_s()
        while True:
            await asyncio.wait({waiting, ended}, timeout=CHECK_S, return_when=asyncio.FIRST_COMPLETED)
            if ended.done() and ended.result() != CLOSED:
                return ended.result()
            if ended.done():
                await asyncio.wait({waiting}, timeout=CHECK_S)  # its exit code tells more than its socket
            if waiting.done() or ended.done():
                return waiting.result() if waiting.done() else ended.result()
            now_s, rss_mb = self._clock.now_s(), child.rss_mb()
            self._excuse(now_s)
            if not self.is_ready:
                self._vitals = note_work(self._vitals, child.cpu_s(), now_s)
            if reason := self._why_to_kill(now_s, rss_mb):
                return reason
            self._vitals = check_vitals(self._vitals, now_s)
            if now_s - reported_s >= REPORT_S:
                used_s = child.cpu_s()
                share = None if None in (used_s, cpu_s) else (used_s - cpu_s) / (now_s - reported_s)  # type: ignore[operator]
                reported_s, cpu_s = now_s, used_s
                self._report_status(replace(self.memory.status, rss_mb=rss_mb, cpu=share))

    def _excuse(self, now_s: float) -> None:
        """What the daemon slept through was no delay of the worker."""
        before_s, self._vitals = self._vitals.heard_s, excuse_lateness(self._vitals, now_s, CHECK_S)
        self._requests.postpone(self._vitals.heard_s - before_s)

    def _why_to_kill(self, now_s: float, rss_mb: float | None) -> str | None:
        allowed_s = max(self._parameters.step_timeout_s, self._requests.longest_deadline_s)
        reason = why_to_kill(
            self._parameters,
            self.memory.status.state,
            self._vitals,
            now_s,
            rss_mb=rss_mb,
            allowed_s=allowed_s,
        )
        return reason or self._requests.why_late(now_s)

    def _end_process(self, child: Child) -> None:
        """Nothing more comes from this worker: whoever waits for it hears so."""
        child.kill()
        if self._channel is not None:
            self._channel.close()
            self._dropped += self._channel.dropped
        with self._clock.entry(WorkerGone):
            self.forget_pending()

    def forget_pending(self) -> None:
        """The worker is gone: whoever waits for it hears so."""
        self._channel = None
        self._requests.fail_all()

    def follow(self, status: WorkerStatus, channel: "Channel | None") -> None:
        """Stand as a recorded worker stood; there is no process. What is sent to it goes to ``channel``."""
        was_ready, self.memory.status = self.is_ready, status
        self._channel = self._channel or channel
        if self.is_ready and not was_ready:
            for handler in self._on_ready:
                handler()

    def _mark_ended(self, reason: str) -> None:
        if self._ended is not None and not self._ended.done():
            self._ended.set_result(reason)

    def _take_message(self, message: FromWorker) -> None:
        now_s = self._clock.now_s()
        self._vitals = replace(self._vitals, heard_s=now_s, messages=self._vitals.messages + 1)
        match message:
            case messages.Alive():
                self._vitals = replace(self._vitals, busy_s=message.busy_s, doing=message.doing)
            case messages.SkillEvent() | messages.Answer() | messages.Failed() | messages.RequestProgress():
                with self._clock.entry(partial(_make_event, message)):
                    self.take_of_skill(message)
            case messages.Warming():
                self._set(
                    WorkerTransition.WARMING,
                    reason=Sentence("worker.loading", "loading {skill}", skill=message.skill),
                )
            case messages.Ready():
                if self._set(WorkerTransition.READY, reason=""):
                    self._vitals = replace(
                        self._vitals, busy_s=0.0, doing=""
                    )  # loading is over, however long it took
                    for handler in self._on_ready:
                        handler()
            case messages.SkillLeftOut():
                log.error("a skill is left out", skill=message.skill, reason=message.reason)
            case messages.Unavailable():
                log.warning("the worker is not available", reason=message.reason)
                self._set(WorkerTransition.UNAVAILABLE, reason=message.reason)
                self._mark_ended(message.reason)

    def take_of_skill(self, message: OfSkill) -> None:
        """What a skill tells or answers: hand it on to whom it concerns."""
        if isinstance(message, messages.SkillEvent):
            self._hand_on(message)
        else:
            self._requests.take_message(message)

    def _hand_on(self, message: messages.SkillEvent) -> None:
        listener = self._listeners.get((message.skill, message.kind))
        if message.skill in self._references:
            self._hand_to_stranger(message, listener)
            return
        if listener is None:
            self._mark_ended(
                Sentence(
                    "worker.unknown_event",
                    "its skill {skill!r} tells what nobody knows: {kind!r}",
                    skill=message.skill,
                    kind=message.kind,
                )
            )
            return
        try:
            listener(message.body)
        except ValueError as error:
            self._mark_ended(
                Sentence(
                    "worker.skill_no_message",
                    "its skill {skill} sent what is no message: {why}",
                    skill=message.skill,
                    why=error,
                )
            )

    def _hand_to_stranger(
        self, message: messages.SkillEvent, listener: Callable[[bytes], None] | None
    ) -> None:
        """What is wrong with it is said, and harms nobody else's skill."""
        try:
            if listener is None:
                raise LookupError(f"nobody listens to its {message.kind!r}")
            listener(message.body)
        except Exception as error:  # noqa: BLE001 - somebody else's code
            reason = f"{type(error).__name__}: {error}"
            log.error("what a skill said is left out", skill=message.skill, reason=reason)

    def _set(self, happened: WorkerTransition, **fields: object) -> bool:
        """Go on to the next state; a worker that tells what cannot be is not believed."""
        state = NEXT.get((self.memory.status.state, happened))
        if state is None:
            self._mark_ended(
                Sentence(
                    "worker.impossible",
                    "it says that it is {happened} while it is {state}",
                    happened=happened,
                    state=self.memory.status.state,
                )
            )
            return False
        self._report_status(replace(self.memory.status, state=state, **fields))
        return True

    def _report_status(self, status: WorkerStatus) -> None:
        self.memory.status = status
        self._on_status(status)


def _make_event(message: FromWorker, stamp_s: float) -> WorkerSaid:
    return WorkerSaid(stamp_s, pack_body(message))


def _why_not_ready(status: WorkerStatus) -> Sentence:
    if not status.reason:
        return Sentence("worker.not_ready", "the worker is {state}", state=str(status.state))
    return Sentence(
        "worker.not_ready_because",
        "the worker is {state}: {reason}",
        state=str(status.state),
        reason=status.reason,
    )
