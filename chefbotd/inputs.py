"""Inputs from outside: each is handled at one time, and passed to the recorder.

Bytes that arrive, a timer that fires, a request, a task that goes on: whatever follows from one of them in the same call
stack sees the time of its beginning. So what the robot does is a function of its entries and their times, and can be
computed again from a recording.
"""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine, Generator
from typing import Any, Protocol, TypeVar

from msgspec import Struct

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events.inputs import AnswerTaken, EventObserved, TaskStepped, TimerFired

T = TypeVar("T")


class Timer(Protocol):
    """What ``call_later`` returns."""

    def cancel(self) -> None:
        """Do not call it any more."""
        ...


class InputTimer(Struct, eq=False):
    """A timer that runs: what it is called, when it fires, and what it then calls."""

    name: str
    due_s: float
    callback: Callable[[], None]
    waits: bool = True
    handle: asyncio.TimerHandle | None = None

    def cancel(self) -> None:
        """Do not fire."""
        self.waits = False
        if self.handle is not None:
            self.handle.cancel()


def due_of(timer: Timer | None) -> float | None:
    """When a timer fires; None: there is none, or none that waits."""
    return timer.due_s if isinstance(timer, InputTimer) and timer.waits else None


class Entry:
    """A context in which an entry is handled; a generator as the context would take three times as many calls."""

    __slots__ = ("_entries", "_fields", "_is_outermost", "_kind")

    def __init__(self, entries: "InputLog", kind: Callable[..., object], fields: tuple[object, ...]) -> None:
        self._entries, self._kind, self._fields = entries, kind, fields

    def __enter__(self) -> None:
        entries = self._entries
        self._is_outermost = entries.begin()
        if entries.recording and self._is_outermost:
            try:
                entries.publish(self._kind(entries.now_s(), *self._fields))
            except BaseException:
                entries.end()
                raise

    def __exit__(self, *_: object) -> None:
        if self._is_outermost:
            self._entries.end()


class ResumableTimer:
    """One timer at most, whose state is when it is due; ``callback`` is called then, as ``name`` in a recording."""

    def __init__(self, entries: "InputLog", callback: Callable[[], None], name: str) -> None:
        self._entries, self._callback, self._name = entries, callback, name
        self._timer: Timer | None = None

    @property
    def due_s(self) -> float | None:
        """When it fires; None where it does not wait."""
        return due_of(self._timer)

    def start(self, delay_s: float) -> None:
        """Fire after so long, and not when it was to fire before."""
        self.cancel()
        self._timer = self._entries.call_later(delay_s, self._callback, self._name)

    def cancel(self) -> None:
        """Do not fire."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def state(self) -> float | None:
        """Return when it fires."""
        return self.due_s

    def restore(self, state: float | None) -> None:
        """Fire then; a state that is None has no timer."""
        self.cancel()
        self._timer = self._entries.resume(state, self._callback, self._name)


class StatefulEvent(asyncio.Event):
    """An event whose state is whether it is set."""

    def state(self) -> bool:
        """Return whether it is set."""
        return self.is_set()

    def restore(self, state: bool) -> None:
        """Set it, or clear it."""
        set_event(self, state)


class InputLog:
    """A clock that stands still while an entry is handled.

    ``links`` are the sessions of the ports by the names of their links, as each of them has entered itself.
    ``running`` are the coroutines that go on in steps, by name, and ``task`` is the one whose step is handled.
    ``resting`` are the services among them that wait for what comes next.
    ``recording`` says whether the records in ``core.events.inputs`` are to be published; read it before you make one.
    """

    is_replay = False

    def __init__(self, clock: Clock, bus: Bus | None = None) -> None:
        self._read_clock, self.bus = clock.now_s, bus
        self._latched_s: float | None = None
        self._recorders = 0
        self.links: dict[str, Any] = {}
        self.running: dict[str, Steps] = {}
        self.resting: set[str] = set()
        self.task = ""
        self.recording = False

    def now_s(self) -> float:
        """The time of the entry that is being handled; between entries, the present."""
        latched_s = self._latched_s
        return self._read_clock() if latched_s is None else latched_s

    def begin(self) -> bool:
        """An entry begins, unless it belongs to one that is being handled: whether ``end`` is to follow."""
        if self._latched_s is not None:
            return False
        self._latched_s = self._read_clock()
        return True

    def end(self) -> None:
        """The entry has been handled."""
        self._latched_s = None

    def publish(self, record: object) -> None:
        """Publish a record; to be called only while ``recording``."""
        if self.bus is not None:
            self.bus.publish(record)

    def entry(self, kind: Callable[..., object], *fields: object) -> "Entry":
        """Handle an entry; ``kind`` is the class of its record, whose fields after the stamp these are."""
        return Entry(self, kind, fields)

    def call_later(self, delay_s: float, callback: Callable[[], None], name: str) -> Timer:
        """As the event loop's; the call is an entry. Of one name, one timer at most runs at a time."""
        latched_s = self._latched_s
        now_s = self._read_clock() if latched_s is None else latched_s  # not another call in every cycle
        timer = InputTimer(name, now_s + delay_s, callback)
        timer.handle = asyncio.get_running_loop().call_later(delay_s, self._fire, timer)
        return timer

    def call_at(self, due_s: float, callback: Callable[[], None], name: str) -> Timer:
        """As ``call_later``, at a time of this clock."""
        return self.call_later(due_s - self.now_s(), callback, name)

    def resume(self, due_s: float | None, callback: Callable[[], None], name: str) -> Timer | None:
        """The timer of a restored state that is due then; None: it has none."""
        return None if due_s is None else self.call_at(due_s, callback, name)

    def _fire(self, timer: InputTimer) -> None:
        timer.waits = False
        with self.entry(TimerFired, timer.name):
            timer.callback()

    def observe(self, bus: Bus, event: object) -> None:
        """Publish what came from outside: from the disk, from another process, from the computer itself."""
        outermost = self.begin()
        try:
            if self.recording:
                self.publish(EventObserved(self.now_s()))
            bus.publish(event)
        finally:
            if outermost:
                self.end()

    async def in_steps(self, name: str, run: Callable[[], Coroutine[Any, Any, T]], what: str = "") -> T:
        """Run a coroutine; each time that it goes on is an entry. ``what`` is the method of a request."""
        result: T = await Steps(self, name, run(), what)
        return result

    async def at_rest(self, wait: Awaitable[T]) -> T:
        """Wait as a service that is in the middle of nothing: a replay may begin here, and wait in its place."""
        task = self.task
        self.resting.add(task)
        try:
            return await wait
        finally:
            self.resting.discard(task)

    async def outside(self, ask: Callable[[], Awaitable[T]]) -> T:
        """Wait for the disk or another process; a replay does not ask again."""
        return await ask()

    async def answer(self, asked: str, ask: Callable[[], Awaitable[str]]) -> str:
        """Wait for an answer from outside that decides what the robot does: it is recorded."""
        answer = await ask()
        if self.recording:
            self.publish(AnswerTaken(self.now_s(), asked, answer))
        return answer

    def begin_recording(self) -> Callable[[], None]:
        """Publish the records from now on; returns what ends that.

        A replay needs them from the daemon's start, or from a recorded state.
        """
        self._recorders += 1
        self.recording, ended = True, False

        def end() -> None:
            nonlocal ended
            if not ended:
                ended, self._recorders = True, self._recorders - 1
                self.recording = self._recorders > 0

        return end


class Steps:
    """A coroutine whose steps are entries; an asyncio task sees no difference. ``what`` is the method of a request."""

    def __init__(self, entries: InputLog, name: str, task: Coroutine[Any, Any, Any], what: str = "") -> None:
        self._entries, self._name, self._task, self.what = entries, name, task, what
        self._waits_for: object = None

    @property
    def is_woken(self) -> bool:
        """Whether what it waits for is there, so that it is about to go on."""
        return is_done(self._waits_for)

    @property
    def is_at_rest(self) -> bool:
        """Whether it is in the middle of nothing, and nothing has woken it."""
        return self._name in self._entries.resting and not self.is_woken

    def __await__(self) -> Generator[Any, None, Any]:
        self._entries.running[self._name] = self
        try:
            return (yield from self._steps())
        finally:
            if self._entries.running.get(self._name) is self:
                del self._entries.running[self._name]

    def _steps(self) -> Generator[Any, None, Any]:
        error: BaseException | None = None
        while True:
            with self._entries.entry(TaskStepped, self._name, error is not None):
                self._entries.task = self._name
                try:
                    awaited = self._task.send(None) if error is None else self._task.throw(error)
                except StopIteration as end:
                    return end.value
                finally:
                    self._entries.task = ""
            error, self._waits_for = None, awaited
            try:
                yield awaited
            except BaseException as raised:  # noqa: BLE001 - the coroutine's to handle
                error = raised


def is_done(awaited: object) -> bool:
    """Whether what a coroutine waits for is there: it goes on in the next turn of the loop."""
    return asyncio.isfuture(awaited) and awaited.done()


def set_event(event: asyncio.Event, is_set: bool) -> None:
    """Set an event, or clear it."""
    if is_set:
        event.set()
    else:
        event.clear()


def inputs_of(clock: Clock) -> InputLog:
    """The clock itself if it is an input log, else an input log on this clock that nobody records."""
    return clock if isinstance(clock, InputLog) else InputLog(clock)
