"""The replay: every entry of a recording comes in again, and what follows is held against what followed then."""

import asyncio
from collections.abc import Callable, Iterable
from typing import Any

import msgspec

from chefbotd.app import Daemon
from chefbotd.bus import Inbox
from chefbotd.components.recording.replay.comparison import (
    Comparison,
    Difference,
    EncodedEvent,
    SpeedError,
    describe_entry,
)
from chefbotd.components.recording.replay.entries import ReplayEntries
from chefbotd.components.recording.replay.pipeline import Pipeline
from chefbotd.components.recording.replay.recorded import NOT_COMPARED, EntryGroup, NotReplayable
from chefbotd.core.events.inputs import DaemonStarted, StateRecorded, TimerFired
from chefbotd.event_classes import encode

MOST_EVENTS = 100_000
"""That follow one entry."""

FIRST_PROBLEMS = 5
LATE_S = 0.1
"""A timer that is not fired so long after the first entry behind its time has no firing in the recording."""

EARLY_S = 0.002
"""The event loop fires timers early by the resolution of its clock."""


class ReplayOutcome:
    """What a replay has found. ``exact`` says that every event is the same, bit for bit.

    ``skipped_s`` is how much of the recording comes before the first state. ``left_out`` says what that state has not;
    ``same_since_s`` is the stamp from which on every event is the same.
    """

    def __init__(self, comparison: Comparison) -> None:
        self.comparison = comparison
        self.entries = self.lost = 0
        self.began_s: float | None = None
        self.ended_s = 0.0
        self.from_start = self.from_state = False
        self.skipped_s = 0.0
        self.left_out: tuple[str, ...] = ()
        self.same_since_s: float | None = None
        self.problems: list[str] = []
        self.problem_count = 0
        self.recorded_error, self.replayed_error = SpeedError(), SpeedError()

    @property
    def first(self) -> Difference | None:
        """The first difference."""
        return self.comparison.first

    @property
    def exact(self) -> bool:
        """Whether all of it is the same."""
        return self.first is None and not self.problem_count

    @property
    def seconds(self) -> float:
        """How long the recording is."""
        return 0.0 if self.began_s is None else self.ended_s - self.began_s

    def note(self, problem: str) -> None:
        """Something could not be replayed."""
        self.problem_count += 1
        if len(self.problems) < FIRST_PROBLEMS:
            self.problems.append(problem)


class Replay:
    """Timers fire when they did then. With ``own_timers``, as another configuration needs, others fire when due.

    With ``any_state``, as another version needs, too, what cannot be put back is left as it is.
    """

    def __init__(
        self,
        daemon: Daemon,
        entries: ReplayEntries,
        *,
        own_timers: bool = False,
        any_state: bool = False,
        left_out: Iterable[str] = (),
    ) -> None:
        self._pipeline = Pipeline(daemon, entries, drains=not own_timers)
        self._entries = entries
        self._own_timers, self._is_astray = own_timers, False
        self._any_state = any_state or own_timers
        self._inbox: Inbox[Any] = daemon.bus.subscribe_all(MOST_EVENTS, NOT_COMPARED)
        self.outcome = ReplayOutcome(Comparison(left_out))

    async def run(self, groups: Iterable[EntryGroup], pace: "ReplayPace | None" = None) -> ReplayOutcome:
        """Replay all of it; ``pace`` holds it back."""
        outcome = self.outcome
        try:
            for group in groups:
                if pace is not None:
                    await pace.wait(group.entry.stamp_s)
                await self._take_group(group)
        finally:
            self._pipeline.close()
            self._inbox.close()
        outcome.comparison.finish()
        return outcome

    async def _take_group(self, group: EntryGroup) -> None:
        entry, outcome = group.entry, self.outcome
        stamp_s = entry.stamp_s
        if outcome.began_s is None:
            outcome.began_s, outcome.from_start = stamp_s, isinstance(entry, DaemonStarted)
        begins_again = outcome.entries == 0 and not outcome.from_start
        begins_again |= isinstance(entry, StateRecorded) and self._is_astray and not entry.left_out
        self._is_astray |= group.lost > 0
        outcome.ended_s = stamp_s
        outcome.entries += 1
        outcome.lost += group.lost
        replayed: list[EncodedEvent] = []
        if self._own_timers:
            self._fire_due(stamp_s)
            replayed = self._replayed_events()
        self._entries.set_time(stamp_s)
        if begins_again:
            await self._begin_again(entry if isinstance(entry, StateRecorded) else None)
        if not (self._own_timers and self._is_of_the_other(entry)):
            problem = await self._handle(group)
            if problem and not self._own_timers:
                outcome.note(f"at {stamp_s:.6f} s: {problem}")
        replayed += self._replayed_events()
        if not outcome.comparison.add(entry, group.followers, replayed):
            outcome.same_since_s = None
        elif outcome.same_since_s is None:
            outcome.same_since_s = stamp_s
        if self._own_timers:
            self._add_errors(group, replayed)

    async def _handle(self, group: EntryGroup) -> str:
        try:
            return await self._pipeline.handle(group)
        except NotReplayable:
            raise
        except Exception as error:
            what = f"at {group.entry.stamp_s:.6f} s: {describe_entry(group.entry)}"
            raise NotReplayable(f"{what} cannot be replayed: {type(error).__name__}: {error}") from error

    async def _begin_again(self, state: StateRecorded | None) -> None:
        """From a state: at the beginning, and where one has everything after one that had not, or after a gap."""
        outcome = self.outcome
        problems = await self._pipeline.begin_late(state, keeps_parameters=self._own_timers)
        if problems and state is not None and not self._any_state:
            raise NotReplayable(
                f"the state at {state.stamp_s:.6f} s is none that this version of chefbotd recorded: {problems[0]}; "
                "--any-version puts back the rest"
            )
        self._replayed_events()
        if not outcome.from_state and state is not None:
            outcome.from_state, outcome.left_out = True, (*state.left_out, *problems)
        self._is_astray = state is None or bool(state.left_out)

    def _add_errors(self, group: EntryGroup, replayed: list[EncodedEvent]) -> None:
        for event in group.followers:
            if event.kind == "WheelsDriven":
                self.outcome.recorded_error.add(msgspec.json.decode(event.payload))
        for kind, payload in replayed:
            if kind == "WheelsDriven":
                self.outcome.replayed_error.add(msgspec.json.decode(payload))

    def _is_of_the_other(self, entry: Any) -> bool:
        """Whether a timer fired that does not run here, or is set for later."""
        if not isinstance(entry, TimerFired) or self._pipeline.is_regular(entry.timer):
            return False
        timer = self._entries.timers.get(entry.timer)
        return timer is None or timer.due_s > entry.stamp_s + EARLY_S

    def _fire_due(self, now_s: float) -> None:
        """Fire the timers that should have fired a while ago and did not then, in order."""
        timers = self._entries.timers
        while late := [timer for timer in timers.values() if timer.is_late(now_s, LATE_S)]:
            first = min(late, key=lambda timer: timer.due_s)
            self._entries.set_time(first.due_s)
            self._entries.fire(first.name)

    def _replayed_events(self) -> list[EncodedEvent]:
        if not len(self._inbox):
            return []
        takes = self.outcome.comparison.takes
        events = [(type(event).__name__, event) for event in self._inbox.take_all()]
        return [(kind, encode(event)) for kind, event in events if takes(kind)]


class ReplayPace:
    """Holds a replay back to ``rate`` times the recorded speed."""

    def __init__(self, rate: float, now_s: Callable[[], float]) -> None:
        self._rate, self._now_s = rate, now_s
        self._first: tuple[float, float] | None = None

    async def wait(self, stamp_s: float) -> None:
        """Until it is time for what happened then."""
        if self._first is None:
            self._first = self._now_s(), stamp_s
        began_s, first_s = self._first
        wait_s = began_s + (stamp_s - first_s) / self._rate - self._now_s()
        if wait_s > 0:
            await asyncio.sleep(wait_s)
