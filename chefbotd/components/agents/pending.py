"""Questions and calls that wait for an answer: until it comes, their time is over, or nobody waits any more."""

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from chefbotd.components.agents.events import QuestionData
from chefbotd.components.agents.models import AskResult, CallResult
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.record import MutableState, Record, StatefulPart
from chefbotd.core.sentence import Sentence
from chefbotd.features.feature import Waiting
from chefbotd.inputs import InputLog, Timer
from chefbotd.rpc.jobs import ProgressReporter

TELL_EVERY_S: Final = 2.0
"""How often a request that waits reports: a client gives up one that is silent for 5 s."""

EARLY_S: Final = 0.002
"""A timer may fire so much too early."""


class Pending(Record, frozen=True):
    """An agent's question, or the call of a ``method`` of it, and until when it waits."""

    number: int
    agent: str
    began_s: float
    due_s: float
    question: QuestionData | None
    method: str = ""


class PendingState(MutableState):
    """What waits, when each is looked at next, and the numbers by the tasks of the requests."""

    pending: list[Pending] = []
    looks_s: dict[int, float | None] = {}
    tasks: dict[str, int] = {}


class PendingRequests(StatefulPart[PendingState]):
    """``changed`` is called when there is another question than before."""

    def __init__(self, entries: InputLog, changed: Callable[[], None]) -> None:
        self._entries, self._changed = entries, changed
        self.memory = PendingState()
        self._timers: dict[int, Timer] = {}
        self._ends: dict[int, asyncio.Future[AskResult | CallResult | Refused]] = {}
        self._progress: dict[int, ProgressReporter] = {}

    def restore(self, state: PendingState) -> None:
        """Restore this state."""
        super().restore(state)
        self._ends = {pending.number: asyncio.get_running_loop().create_future() for pending in state.pending}
        self._timers = {}
        for number, due_s in tuple(state.looks_s.items()):
            if due_s is not None:
                self._look_at(number, due_s)

    def get(self, number: int) -> Pending | None:
        """What waits under this number."""
        return next((pending for pending in self.memory.pending if pending.number == number), None)

    def of(self, agent: str, *, questions: bool) -> list[Pending]:
        """The questions of an agent, or the calls of its methods."""
        return [
            pending
            for pending in self.memory.pending
            if pending.agent == agent and (pending.question is not None) is questions
        ]

    def questions(self) -> tuple[QuestionData, ...]:
        """Every question."""
        return tuple(pending.question for pending in self.memory.pending if pending.question is not None)

    def waiting(self) -> Waiting:
        """The requests that wait, by their tasks."""
        return {task: partial(self.wait, number) for task, number in self.memory.tasks.items()}

    def add(
        self, number: int, agent: str, timeout_s: float, question: QuestionData | None, method: str = ""
    ) -> None:
        """It waits from now on."""
        now_s = self._entries.now_s()
        self.memory.pending.append(Pending(number, agent, now_s, now_s + timeout_s, question, method))
        self._ends[number] = asyncio.get_running_loop().create_future()
        self._look_at(number, min(now_s + timeout_s, now_s + TELL_EVERY_S))

    async def wait(self, number: int, progress: ProgressReporter) -> Any:
        """The answer; raises it where it is a refusal. Given up, nothing is left of the question or the call."""
        task, self._progress[number] = self._entries.task, progress
        self.memory.tasks[task] = number
        try:
            answer = await self._ends[number]
        except asyncio.CancelledError:
            self.end(number, None)
            raise
        finally:
            self.memory.tasks.pop(task, None)
            del self._progress[number], self._ends[number]
        if isinstance(answer, Refused):
            raise answer
        return answer

    def end(self, number: int, answer: AskResult | CallResult | Refused | None) -> None:
        """It waits no longer; None: nobody waits for the answer."""
        pending = self.get(number)
        if pending is None:
            return
        self.memory.pending.remove(pending)
        del self.memory.looks_s[number]
        self._timers.pop(number).cancel()
        if answer is not None and not self._ends[number].done():
            self._ends[number].set_result(answer)
        if pending.question is not None:
            self._changed()

    def _look_at(self, number: int, due_s: float) -> None:
        name, self.memory.looks_s[number] = f"agent request {number}", due_s
        self._timers[number] = self._entries.call_at(due_s, partial(self._look_at_request, number), name)

    def _look_at_request(self, number: int) -> None:
        """Its time is over, or who waits is told that it still waits."""
        pending, now_s = self.get(number), self._entries.now_s()
        if pending is None:
            return
        if now_s < pending.due_s - EARLY_S:
            total_s = pending.due_s - pending.began_s
            if number in self._progress:
                self._progress[number].report(now_s - pending.began_s, total_s, "waits for an answer")
            self._look_at(number, min(pending.due_s, now_s + TELL_EVERY_S))
        elif pending.question is not None:
            self.end(number, AskResult(None))
        else:
            why = Sentence(
                "agents.timed_out",
                "the agent {agent!a} has not answered {method!a} in time",
                agent=pending.agent,
                method=pending.method,
            )
            self.end(number, Refused(RefusalKind.AGENT_TIMED_OUT, why))
