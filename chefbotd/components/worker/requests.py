"""Requests to the worker that wait for an answer, each with a number and a deadline."""

import asyncio
from collections.abc import Callable

from msgspec import Struct

from chefbotd.clock import Clock
from chefbotd.components.worker.messages import Answer, Failed, RequestProgress
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.record import StatefulValue
from chefbotd.core.sentence import Sentence, sentence_of

OnProgress = Callable[[float, float, str], None]


class RequestCancelled(Exception):
    """A request was given up before it had an effect."""


class WorkerLost(Refused):
    """The worker is not there, or ended before it answered."""

    def __init__(self, message: str) -> None:
        super().__init__(RefusalKind.WORKER_UNAVAILABLE, message)


class _Pending(Struct):
    future: "asyncio.Future[bytes]"
    on_progress: OnProgress | None
    deadline_s: float
    due_s: float


class Requests(StatefulValue[int]):
    """Those under way; the ``memory`` is the number of the last one that a replay makes too."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.memory = 0
        self._last_unreplayed = 0
        self._pending: dict[int, _Pending] = {}

    def open(
        self, deadline_s: float, on_progress: OnProgress | None, *, is_replayed: bool = True
    ) -> tuple[int, "asyncio.Future[bytes]"]:
        """The number of a new request, and what its answer comes into.

        One that a replay does not make has a number below zero, so that it does not change those of the others.
        """
        if is_replayed:
            self.memory = number = self.memory + 1
        else:
            self._last_unreplayed = number = self._last_unreplayed - 1
        future = asyncio.get_running_loop().create_future()
        due_s = self._clock.now_s() + deadline_s
        self._pending[number] = _Pending(future, on_progress, deadline_s, due_s)
        return number, future

    def close(self, number: int) -> None:
        """Nobody waits for this one any more."""
        self._pending.pop(number, None)

    def take_message(self, message: Answer | Failed | RequestProgress) -> None:
        """Give an answer to whoever waits for it; a report of progress also allows more time."""
        pending = self._pending.get(message.id)
        if pending is None:
            return
        if isinstance(message, RequestProgress):
            pending.due_s = self._clock.now_s() + pending.deadline_s
            if pending.on_progress is not None:
                pending.on_progress(message.done, message.total, message.text)
        elif pending.future.done():
            return
        elif isinstance(message, Answer):
            pending.future.set_result(message.body)
        elif message.kind is None:
            pending.future.set_exception(RequestCancelled(message.message))
        else:
            pending.future.set_exception(Refused(message.kind, sentence_of(message.message, message.said)))

    @property
    def longest_deadline_s(self) -> float:
        """The longest that any of them may take."""
        return max((pending.deadline_s for pending in self._pending.values()), default=0.0)

    def why_late(self, now_s: float) -> str | None:
        """What to say of a worker that has not answered in time; None: it has."""
        late = next((pending for pending in self._pending.values() if now_s > pending.due_s), None)
        return (
            None
            if late is None
            else Sentence(
                "worker.too_slow", "it did not answer a request within {seconds:g} s", seconds=late.deadline_s
            )
        )

    def postpone(self, by_s: float) -> None:
        """The daemon itself slept for so long: each may take that much longer."""
        for pending in self._pending.values():
            pending.due_s += by_s

    def fail_all(self) -> None:
        """The worker is gone: each request that waits for an answer fails."""
        pending, self._pending = self._pending, {}
        for request in pending.values():
            if not request.future.done():
                request.future.set_exception(
                    WorkerLost(Sentence("worker.ended", "the worker ended before it was done"))
                )
                request.future.exception()  # whoever asked may be gone
