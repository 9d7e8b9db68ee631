"""The clock of a replay: it shows the time of the present entry, and timers wait until they are fired."""

import asyncio
import contextlib
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine, Generator, Mapping
from typing import Any, TypeVar

from msgspec import Struct

from chefbotd.clock import ManualClock
from chefbotd.core.events.inputs import AnswerTaken
from chefbotd.inputs import InputLog, InputTimer, Timer, is_done

T = TypeVar("T")


class ReplayTimer(InputTimer):
    """A timer that waits until it is fired; ``due_s`` is when it would fire by itself."""

    _passed_s: float | None = None

    def is_late(self, now_s: float, by_s: float) -> bool:
        """Whether its time is over, and something else came in so long before ``now_s`` already.

        A loop that stood still fires its timers just after what came in meanwhile.
        """
        if self.due_s > now_s:
            return False
        if self._passed_s is None:
            self._passed_s = now_s
        return now_s - self._passed_s > by_s


class ReplayEntries(InputLog):
    """The time is set to each entry's."""

    is_replay = True

    def __init__(self) -> None:
        super().__init__(ManualClock())
        self._at_s = 0.0
        self._timers: dict[str, ReplayTimer] = {}
        self.answers: dict[str, deque[str]] = {}
        self.recording = True  # so that what is written to the links is told

    def now_s(self) -> float:
        """The time of the entry."""
        return self._at_s

    def begin(self) -> bool:
        """Time passes by ``set_time`` alone."""
        return False

    def set_time(self, now_s: float) -> None:
        """An entry begins."""
        self._at_s = now_s

    def call_later(self, delay_s: float, callback: Callable[[], None], name: str) -> Timer:
        """Wait to be fired."""
        return self.call_at(self._at_s + delay_s, callback, name)

    def call_at(self, due_s: float, callback: Callable[[], None], name: str) -> Timer:
        """The same."""
        timer = self._timers[name] = ReplayTimer(name, due_s, callback)
        return timer

    @property
    def timers(self) -> "dict[str, ReplayTimer]":
        """Those that wait."""
        return {name: timer for name, timer in self._timers.items() if timer.waits}

    def forget_timers(self) -> None:
        """None waits."""
        self._timers.clear()

    def fire(self, name: str) -> bool:
        """Fire a timer; whether there is one of this name."""
        timer = self._timers.pop(name, None)
        if timer is None or not timer.waits:
            return False
        timer.waits = False
        timer.callback()
        return True

    def add_answer(self, asked: str, answer: str) -> None:
        """What the outside answers in the step that comes now."""
        self.answers.setdefault(asked, deque()).append(answer)

    async def outside(self, ask: Callable[[], Awaitable[T]]) -> T:
        """Nothing outside is asked, so nothing comes: what it led to is in the recording."""
        waits: asyncio.Future[T] = asyncio.get_running_loop().create_future()
        return await waits

    async def answer(self, asked: str, ask: Callable[[], Awaitable[str]]) -> str:
        """What was answered, in the step in which it came."""
        while not self.answers.get(asked):
            await _Pause()
        answer = self.answers[asked].popleft()
        self.publish(AnswerTaken(self.now_s(), asked, answer))
        return answer


class _Pause:
    """Waits for the next step."""

    def __await__(self) -> Generator[Any, None, None]:
        yield


Run = Callable[[], Coroutine[Any, Any, Any]]

MOST_TURNS = 20
"""A future that is shielded hears of its end some turns of the loop later."""


class _Running(Struct):
    task: Coroutine[Any, Any, Any]
    waits_for: "asyncio.Future[Any] | None" = None


class Tasks:
    """``services`` restart when they are stepped after their end; a request does not."""

    def __init__(self, services: Mapping[str, Run], entries: InputLog) -> None:
        self._services, self._entries = services, entries
        self._requests: dict[str, Run] = {}
        self._running: dict[str, _Running] = {}

    def add_request(self, name: str, run: Run) -> None:
        """A request begins with its first step."""
        self._requests[name] = run

    async def step(self, name: str, *, cancelled: bool) -> bool:
        """Let a task go on to where it waits next; False for one that is not known or has nothing to go on with."""
        running = self._running.get(name)
        if running is None:
            run = self._requests.pop(name, None) or self._services.get(name)
            if run is None:
                return False
            running = self._running[name] = _Running(run())
        if not cancelled and not await _is_done(running.waits_for):
            return False
        self._entries.task = name
        try:
            task = running.task
            waits_for = task.throw(asyncio.CancelledError()) if cancelled else task.send(None)
        except (StopIteration, asyncio.CancelledError):
            del self._running[name]
            return True
        except Exception:  # noqa: BLE001 - what the recorded one led to is in the recording
            del self._running[name]
            return True
        finally:
            self._entries.task = ""
        if waits_for is not None:
            waits_for._asyncio_future_blocking = False
        running.waits_for = waits_for
        return True

    async def begin_anew(self) -> None:
        """Every service is at rest, and no request is under way."""
        for name, running in list(self._running.items()):
            if name not in self._entries.resting or is_done(running.waits_for):
                running.task.close()
                del self._running[name]
        self._requests.clear()
        for name in self._services.keys() - self._running.keys():
            await self.step(name, cancelled=False)

    def close(self) -> None:
        """The replay is over."""
        for running in self._running.values():
            with contextlib.suppress(Exception):  # why it ends is told already
                running.task.close()
        self._running.clear()
        self._requests.clear()


async def _is_done(future: "asyncio.Future[Any] | None") -> bool:
    for _ in range(MOST_TURNS):
        if future is None or future.done():
            return True
        await asyncio.sleep(0)
    return False
