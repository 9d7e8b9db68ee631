"""The content of a recording as values: entries, and after each the events that followed."""

from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Any

import msgspec

from chefbotd.core.events.inputs import ANSWERS, ENTRIES, DaemonStarted, DaemonStopping, StateRecorded
from chefbotd.core.record import Record
from chefbotd.recording.classes import class_of, decode

OF_THE_RECORDER = frozenset({"RecordingChanged", "EventsDropped"})
NOT_COMPARED = OF_THE_RECORDER | {"LineSeen"}
"""What the recorder says of itself, and what the bytes of the links have in it."""

MAX_EVENT_BYTES = 32_000_000
"""A state with a lidar has 70 kB, a scan some 60."""

_ENTRY_NAMES = frozenset(entry.__name__ for entry in ENTRIES)
_ANSWER_NAMES = frozenset(answer.__name__ for answer in ANSWERS)


class Recorded(Record, frozen=True):
    """A message of a recording: the class of the event, and the event as JSON. ``sequence`` counts the events."""

    sequence: int
    kind: str
    payload: bytes


class NotReplayable(Exception):
    """The file cannot be replayed; the text says why."""


class EntryGroup:
    """An entry, and all that followed it until the next."""

    __slots__ = ("entry", "followers", "lost")

    def __init__(self, entry: Any, lost: int) -> None:
        self.entry, self.lost = entry, lost
        self.followers: list[Recorded] = []

    def answers(self) -> list[Any]:
        """What the outside answered meanwhile."""
        return [decoded(event) for event in self.followers if event.kind in _ANSWER_NAMES]


def decoded(recorded: Recorded) -> Any:
    """The event itself.

    Raises:
        NotReplayable: it is not what its class says.
    """
    event_class = class_of(recorded.kind)
    if len(recorded.payload) > MAX_EVENT_BYTES:
        size = f"{len(recorded.payload)} bytes, expected at most {MAX_EVENT_BYTES}"
        raise NotReplayable(f"message {recorded.sequence}: a {recorded.kind} of {size}")
    if event_class is None:
        raise NotReplayable(f"message {recorded.sequence}: this version of chefbotd has no {recorded.kind}")
    try:
        return decode(event_class, recorded.payload)
    except (msgspec.DecodeError, RecursionError) as error:
        reason = f"message {recorded.sequence}: not a {recorded.kind} of this version of chefbotd: {error}"
        raise NotReplayable(reason) from error


def groups_of(stream: Iterable[Recorded]) -> Iterator[EntryGroup]:
    """The entries in their order, up to the daemon's end; ``lost`` counts messages that are missing before one.

    What comes before the first entry is left out, and so is the last entry of a recording that was cut off before the
    daemon's end: nobody knows whether all that followed it is there.
    """
    group: EntryGroup | None = None
    before = None
    lost = 0
    for event in stream:
        if before is not None and event.sequence > before + 1:
            lost += event.sequence - before - 1
        before = event.sequence
        if event.kind == DaemonStopping.__name__:
            if group is not None:
                yield group
            return
        if event.kind in _ENTRY_NAMES:
            if group is not None:
                yield group
            group, lost = EntryGroup(decoded(event), lost), 0
        elif group is not None:
            group.followers.append(event)


def from_beginning(groups: Iterable[EntryGroup]) -> tuple[list[EntryGroup], Iterator[EntryGroup]]:
    """What comes before the first moment from which a recording can be replayed, and what comes from there on.

    That is the daemon's start, or a recorded state. A recording without one is replayed from its first entry.
    """
    before: list[EntryGroup] = []
    rest = iter(groups)
    for group in rest:
        if isinstance(group.entry, DaemonStarted | StateRecorded):
            return before, chain((group,), rest)
        before.append(group)
    return [], iter(before)
