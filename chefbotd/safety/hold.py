"""The sources of commands that a stop holds.

A driver who repeats its command without knowing of a stop would undo the stop 50 ms later. So a stop holds every
source from which a command has come lately. Each further command from a held source is refused, and restarts its
waiting time. A source is free again when no command has come from it for ``stop_hold_s``, or when its driver asks to
drive again. An emergency stop also holds every source that tries to drive while it is latched, so that ``arm`` alone
never moves the robot. It does not matter who sends the commands: a client that opens a new connection for each command
is held as well.
"""

from collections.abc import Collection
from typing import NamedTuple


class Attempt(NamedTuple):
    """When the last command came from a source, refused or not, and whose stop holds the source (empty: none)."""

    source: str
    stamp_s: float
    stopped_by: str = ""


Attempts = tuple[Attempt, ...]
"""The latest of each source that has ever tried."""


def note_attempt(state: Attempts, source: str, now_s: float, stop_hold_s: float) -> Attempts:
    """Record a command from this source. A source that was silent long enough is no longer held."""
    before = _of(state, source)
    goes_on = before is not None and now_s - before.stamp_s < stop_hold_s
    stopped_by = before.stopped_by if before is not None and goes_on else ""
    others = [each for each in state if each.source != source]
    return (*others, Attempt(source, now_s, stopped_by))


def hold(
    state: Attempts, now_s: float, stop_hold_s: float, by: str, excluded: Collection[str] = ()
) -> Attempts:
    """A stop: hold every source from which commands have come lately, except the ``excluded`` ones."""
    return tuple(
        [
            each._replace(stopped_by=by)
            if each.source not in excluded and now_s - each.stamp_s < stop_hold_s
            else each
            for each in state
        ]
    )


def free(state: Attempts, sources: Collection[str]) -> Attempts:
    """The drivers of these sources ask to drive again: free them."""
    return tuple([each._replace(stopped_by="") if each.source in sources else each for each in state])


def holder_of(state: Attempts, source: str) -> str:
    """Whose stop holds a source; empty where none does."""
    attempt = _of(state, source)
    return "" if attempt is None else attempt.stopped_by


def _of(state: Attempts, source: str) -> Attempt | None:
    return next((each for each in state if each.source == source), None)
