"""Reports the state of navigation on the topic ``navigation``, and to each request that waits for its goals."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Final

from msgspec import field

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.navigation.events import GoalCause, NavigationChanged
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.inputs import Timer, due_of, inputs_of
from chefbotd.rpc.jobs import ProgressReporter

REPORT_EVERY_S: Final = 0.5
"""How often the distance is reported while nothing else changes."""

REPEAT_S: Final = 2.0
"""How often a waiting request gets progress: a client gives up a request that is silent for 5 s."""


TIMER: Final = "navigation progress"


class ReportingState(MutableState):
    """What was reported last, and when the waiting requests get progress again."""

    latest: NavigationChanged | None = field(default=None, name="told")
    due_s: float | None = None


class Reporting(StatefulPart[ReportingState]):
    """Reports changes at once, and the distance now and then; an end stays until the next goal."""

    def __init__(self, bus: Bus, clock: Clock) -> None:
        self._bus, self._clock = bus, inputs_of(clock)
        self._waiting: list[_Waiting] = []
        self._timer: Timer | None = None
        self.memory = ReportingState()

    def state(self) -> ReportingState:
        """Return the state of this part."""
        self.memory.due_s = due_of(self._timer)
        return self.memory

    def restore(self, state: ReportingState) -> None:
        """Restore this state."""
        super().restore(state)
        self._timer = self._clock.resume(state.due_s, self._repeat, TIMER)

    def report(
        self,
        state: str,
        goal: int | None,
        reason: str,
        distance_m: float | None = None,
        time_s: float | None = None,
        cause: GoalCause | None = None,
    ) -> None:
        """Report what navigation does now."""
        last, now_s = self.memory.latest, self._clock.now_s()
        if state == "idle" and last is not None:
            return
        is_same = last is not None and (last.state, last.goal, last.reason) == (state, goal, reason)
        if last is not None and is_same and now_s - last.stamp_s < REPORT_EVERY_S:
            return
        latest = self.memory.latest = NavigationChanged(
            state=state,
            goal=goal,
            reason=reason,
            distance_m=distance_m,
            time_s=time_s,
            cause=cause,
            stamp_s=now_s,
        )
        self._bus.publish(latest)
        for waiting in self._waiting:
            waiting.report(latest)

    def revise(self, goal: int, reason: str) -> None:
        """Say more of a goal that was reached, while it is the last of which anything was reported."""
        last = self.memory.latest
        if last is not None and last.goal == goal and last.state == "reached":
            self.report(last.state, goal, reason)

    def state_of(self, goal: int) -> str:
        """What is done for a goal that has not ended."""
        last = self.memory.latest
        return last.state if last is not None and last.goal == goal else "waiting"

    @contextmanager
    def telling(self, goals: Collection[int], progress: ProgressReporter) -> Iterator[None]:
        """Report to a request that waits for these goals, while the block runs."""
        waiting = _Waiting(goals, progress)
        self._waiting.append(waiting)
        self._repeat_later()
        try:
            yield
        finally:
            self._waiting.remove(waiting)

    def _repeat_later(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None
        if self._waiting:
            self._timer = self._clock.call_later(REPEAT_S, self._repeat, TIMER)

    def _repeat(self) -> None:
        """Also while nothing happens: the goal is paused, or there is no worker."""
        for waiting in self._waiting:
            if self.memory.latest is not None:
                waiting.report(self.memory.latest)
        self._repeat_later()


class _Waiting:
    """A request that waits. Its path grows when a new one is longer, and begins again with another goal."""

    def __init__(self, goals: Collection[int], progress: ProgressReporter) -> None:
        self._goals, self._progress = goals, progress
        self._goal: int | None = None
        self._path_m = self._left_m = 0.0

    def report(self, change: NavigationChanged) -> None:
        """Metres done of the present goal's path; none while the request's goals have not begun."""
        if change.goal not in self._goals:
            self._progress.report(0.0, 0.0, f"waits for goal {change.goal}: {change.reason}")
            return
        if change.goal != self._goal:
            self._goal, self._path_m, self._left_m = change.goal, 0.0, 0.0
        if change.distance_m is not None:
            self._left_m = change.distance_m
            self._path_m = max(self._path_m, change.distance_m)
        self._progress.report(self._path_m - self._left_m, self._path_m, change.reason)
