"""The clock of a replay: it shows the time of the present entry, and timers wait until they are fired."""

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Generator
from typing import Any, TypeVar

from chefbotd.clock import ManualClock
from chefbotd.core.events.inputs import AnswerTaken
from chefbotd.entries import Entries, EntryTimer, Timer

T = TypeVar("T")


class ReplayTimer(EntryTimer):
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


class ReplayEntries(Entries):
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
