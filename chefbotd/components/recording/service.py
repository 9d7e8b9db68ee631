"""Passes every event of the bus to the writer, and has the ring written after a fault."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import structlog
from msgspec.structs import asdict, replace

from chefbotd.bus import Bus, Inbox
from chefbotd.clock import BEAT_S, Clock, next_beat
from chefbotd.components.recording.models import (
    TOPICS,
    RecordingEnded,
    RecordingList,
    RecordingStarted,
    RingSaved,
    SaveRingParams,
    StartRecordingParams,
)
from chefbotd.components.recording.parameters import RecordingParameters
from chefbotd.components.recording.recorder_thread import DISK_PATIENCE_S, RecorderThread, waiting
from chefbotd.components.recording.status import AUTOMATIC, RecordingError
from chefbotd.core.events import LinkNotOpened, LinkOpened, SafetyChanged
from chefbotd.core.events.robot import RecordingChanged
from chefbotd.core.sentence import Sentence
from chefbotd.features.feature import Feature, Service
from chefbotd.inputs import inputs_of
from chefbotd.metrics import Metrics
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import NoParams
from chefbotd.rpc.parameters import Role
from chefbotd.snapshot import DaemonState

if TYPE_CHECKING:
    from chefbotd.components.recording.recorder import Recorder
    from chefbotd.components.recording.writer import Writer

T = TypeVar("T")

log = structlog.get_logger(component="recording")

AT_ONCE = 128
"""The number of events encoded without a pause; other work waits for as long as a control step takes."""

INBOX_EVENTS = 8192

BOARD_WITHIN_S = 2.0
"""The latest time at which the ring is loaded, even if the port has not said whether it can be opened."""

COLLECT_BEATS, TELL_BEATS = 2, 20

STATE_EVERY_S = 20.0
"""The interval of recorded states. One takes 0.14 ms with a lidar; a replay cannot begin before the first one."""

FLUSH_TIMEOUT_S = 1.0
"""How long the daemon's end waits for the end of the file."""

DISK_HANGS = Sentence(
    "recording.disk_hangs", "the disk does not answer: events will be lost when the buffer is full"
)
FAULTS_APART_S = 10.0
REPEATED_ELSEWHERE = frozenset({"LineSeen"})
"""Events that are not recorded, because the recorded bytes of the links contain every line."""


class RecordingService:
    """Records everything that is on the bus. ``dropped`` counts the events that found no room.

    The recording modules are loaded when a recording is requested and, for the ring, after the board's first stop. Until
    then events wait on the bus.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        parameters: RecordingParameters,
        folder: Path,
        start_writer: "Callable[[], Writer]",
        state: Callable[[], DaemonState],
    ) -> None:
        self._bus, self._clock, self._parameters, self._state = bus, clock, parameters, state
        self._state_s, self._state_lacks = float("-inf"), False
        self._folder, self.thread = folder, RecorderThread(clock, folder, start_writer)
        self._entries = inputs_of(clock)
        self._inbox: Inbox[Any] | None = None
        self._listening = asyncio.Event()
        self._end_inputs: Callable[[], None] = _nothing
        self._keeps_ring = parameters.ring_s > 0.0
        self._faults = bus.subscribe(SafetyChanged) if self._keeps_ring else None
        if self._keeps_ring or parameters.auto_start:
            self._subscribe_events()
        self._lost = 0
        self.faults_saved = 0

    @property
    def waiting(self) -> int:
        """The number of events on their way to the disk."""
        return self.thread.waiting + (0 if self._inbox is None else len(self._inbox))

    async def run(self) -> None:
        """Record until cancelled."""
        try:
            if self._parameters.auto_start:
                await self._begin_by_itself()
            elif self._keeps_ring:
                await self._load_ring()
            async with asyncio.TaskGroup() as group:
                group.create_task(self._collect())
                group.create_task(self._report_status())
                if self._faults is not None:
                    group.create_task(self._watch_faults(self._faults))
        finally:
            await self._end_recorder()

    async def _begin_by_itself(self) -> None:
        try:
            await self.thread.ask(
                lambda recorder, now_s: recorder.start(AUTOMATIC, now_s, from_beginning=True), DISK_PATIENCE_S
            )
        except RecordingError as problem:
            log.warning("automatic recording cannot start", error=str(problem))

    async def _load_ring(self) -> None:
        """Wait until the board was told to stop, or cannot be; the daemon's start does not wait for the recorder."""
        if self.thread.writer is None:
            board = self._bus.subscribe(LinkOpened, LinkNotOpened)
            with suppress(
                TimeoutError
            ):  # wait_for of Python 3.11 loses a cancellation that comes with the event
                async with asyncio.timeout(BOARD_WITHIN_S):
                    await board.get()
            board.close()
        try:
            await self.thread.ready()
        except RecordingError as problem:
            log.warning("nothing is recorded", error=str(problem))
            self._listen_no_more()

    async def _end_recorder(self) -> None:
        if self.thread.writer is None:
            return
        try:
            await self._ask_recorder(lambda recorder, now_s: recorder.close(now_s), FLUSH_TIMEOUT_S)
        except RecordingError as problem:
            log.warning("the recording was not closed properly", error=str(problem))

    def _subscribe_events(self) -> None:
        """Take every event of the bus, and let entries be published there."""
        if self._inbox is None:
            excluded = REPEATED_ELSEWHERE | self._parameters.exclude
            self._inbox, self._lost = self._bus.subscribe_all(INBOX_EVENTS, excluded), 0
            self._end_inputs = self._entries.begin_recording()
            self._listening.set()

    def _record_state(self) -> None:
        """Record the daemon's state, so that a replay can begin here."""
        if self._entries.recording and self._inbox is not None:
            recorded = self._state().record()
            self._state_s, self._state_lacks = recorded.stamp_s, bool(recorded.left_out)
            self._bus.publish(recorded)

    def _look_at_state(self) -> None:
        """Record the state at intervals; a little later while something is under way that it cannot contain."""
        since_s = self._clock.now_s() - self._state_s
        every_s = min(STATE_EVERY_S, self._parameters.ring_s / 4 or STATE_EVERY_S)
        is_due = since_s >= every_s or self._state_lacks
        if is_due and (self._state().is_settled or since_s >= 2 * every_s):
            self._record_state()

    def _listen_no_more(self) -> None:
        """Stop taking events where there is no ring, so that they cost nothing."""
        if self._inbox is not None and (self.thread.writer is None or not self._keeps_ring):
            self._end_inputs()
            self._inbox.close()
            self._inbox = None
            self._listening.clear()

    async def _collect(self) -> None:
        while True:
            await self._listening.wait()
            if self._hand_over(AT_ONCE):
                await asyncio.sleep(0)
            else:
                await next_beat(self._clock, COLLECT_BEATS)

    def _hand_over(self, most: int = INBOX_EVENTS) -> bool:
        """Pass this many events to the writer; returns whether some remain."""
        inbox, writer = self._inbox, self.thread.writer
        if inbox is None or writer is None:
            return False
        lost = sum(inbox.dropped.values()) if inbox.dropped else 0
        if lost > self._lost:
            writer.note_dropped(lost - self._lost)
            self._lost = lost
        if events := inbox.take_some(most):
            writer.put_events(events, self._clock.now_s())
        return len(inbox) > 0

    async def _report_status(self) -> None:
        reported, last = 0, ""
        while True:
            self._look_at_state()
            self.thread.watch_disk(TELL_BEATS * BEAT_S)
            problem = DISK_HANGS if self.thread.hangs else self.thread.status.reason
            if problem and problem != last:
                log.warning("recording has a problem", reason=problem, state=str(self.thread.status.state))
            elif last and not problem and self.thread.status.state == "recording":
                log.info("recording goes on", file=self.thread.status.file)
                self._record_state()
            last = problem
            if self.thread.dropped > reported:
                log.warning("events are missing from the recording", events=self.thread.dropped - reported)
                reported = self.thread.dropped
            self._publish_status()
            await next_beat(self._clock, TELL_BEATS)

    def _publish_status(self) -> None:
        self._entries.observe(self._bus, self._changed())

    def _changed(self) -> RecordingChanged:
        status = replace(self.thread.status, dropped=self.thread.dropped, waiting=self.waiting)
        if self.thread.hangs:
            status = replace(status, reason=DISK_HANGS)
        return RecordingChanged(stamp_s=self._clock.now_s(), **asdict(status))

    async def _watch_faults(self, changes: Inbox[SafetyChanged]) -> None:
        """Write the ring for a fault; of several faults within ``FAULTS_APART_S`` only for the first."""
        before, saved_s = None, float("-inf")
        async for event in changes:
            fault, before = before, event.fault
            if event.fault not in (None, fault) and event.stamp_s - saved_s >= FAULTS_APART_S:
                saved_s = event.stamp_s
                await asyncio.sleep(self._parameters.after_fault_s)
                await self._save_fault(event.fault)

    async def _save_fault(self, fault: str) -> None:
        try:
            saved = await self._save_ring(fault, fault=True)
        except RecordingError as problem:
            log.warning("the recording of a fault cannot be saved", fault=fault, error=str(problem))
            return
        self.faults_saved += 1
        log.info("the recording of a fault is saved", fault=fault, file=saved.file)

    # what clients ask: each runs as a job, because the disk may take its time

    @method(role=Role.DRIVE, moves=False)
    async def start_recording(
        self, caller: Caller, params: StartRecordingParams, progress: ProgressReporter
    ) -> RecordingStarted:
        """Record everything into a file on the robot's computer, until stop_recording."""
        return await waiting(self._start(params.name), progress)

    async def _start(self, name: str | None) -> RecordingStarted:
        self._subscribe_events()
        try:
            status = await self._ask_recorder(lambda recorder, now_s: recorder.start(name, now_s))
        except RecordingError:
            if self.thread.status.state != "recording":
                self._listen_no_more()
            raise
        self._record_state()
        self._publish_status()
        return RecordingStarted(name=str(status.name), file=str(status.file))

    @method(role=Role.DRIVE, moves=False)
    async def stop_recording(
        self, caller: Caller, params: NoParams, progress: ProgressReporter
    ) -> RecordingEnded:
        """End the recording."""
        return await waiting(self._stop(), progress)

    async def _stop(self) -> RecordingEnded:
        status = await self._ask_recorder(lambda recorder, now_s: recorder.stop(now_s))
        self._listen_no_more()
        self._publish_status()
        return RecordingEnded(
            name=str(status.name),
            file=str(status.file),
            seconds=status.seconds,
            size_bytes=status.bytes_written,
            messages=status.messages,
            dropped=self.thread.dropped,
        )

    @method(role=Role.OBSERVE)
    async def list_recordings(
        self, caller: Caller, params: NoParams, progress: ProgressReporter
    ) -> RecordingList:
        """Every recording in the robot's folder."""
        rows = await waiting(self._ask_recorder(lambda recorder, now_s: recorder.list_files()), progress)
        return RecordingList(folder=str(self._folder), files=tuple(rows))

    @method(role=Role.DRIVE, moves=False)
    async def save_ring(
        self, caller: Caller, params: SaveRingParams, progress: ProgressReporter
    ) -> RingSaved:
        """Write the last minutes from the ring buffer in memory into a file."""
        return await waiting(self._save_ring(params.reason or "asked", fault=False), progress)

    async def _save_ring(self, reason: str, *, fault: bool) -> RingSaved:
        status = await self._ask_recorder(
            lambda recorder, now_s: recorder.save_ring(reason, now_s, fault=fault)
        )
        self._publish_status()
        return RingSaved(file=str(status.saved), seconds=status.ring_s)

    async def _ask_recorder(
        self, work: "Callable[[Recorder, float], T]", patience_s: float = DISK_PATIENCE_S
    ) -> T:
        """Let the recorder do something after all events so far."""
        return await self.thread.ask(work, patience_s, before=self._hand_over)


def _nothing() -> None:
    """Do nothing."""


def recording(service: RecordingService) -> Feature:
    """The feature for recordings and the ring."""
    return Feature(
        "recording",
        services=(Service("recording", service.run),),
        methods=methods_of(service),
        topics=TOPICS,
        add_metrics=lambda metrics: _add_metrics(metrics, service),
    )


def _add_metrics(metrics: Metrics, service: RecordingService) -> None:
    metrics.gauge(
        "recording_bytes",
        "Of the current or the last recording.",
        lambda: service.thread.status.bytes_written,
    )
    metrics.counter(
        "recording_dropped",
        "Events that were dropped on their way to the disk.",
        lambda: service.thread.dropped,
    )
    metrics.gauge("recording_waiting", "Events on their way to the disk.", lambda: service.waiting)
    metrics.gauge(
        "recording_ring_bytes", "The last minutes in memory.", lambda: service.thread.status.ring_bytes
    )
    metrics.optional_gauge(
        "recording_free_bytes",
        "Free space of the disk at the last check.",
        lambda: service.thread.status.free_bytes,
    )
    metrics.counter(
        "recording_faults_saved", "Faults whose recording was saved.", lambda: service.faults_saved
    )
