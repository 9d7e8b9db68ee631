"""Recorded and replayed events held against each other."""

import math
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from chefbotd.components.recording.replay.recorded import NOT_COMPARED, Recorded
from chefbotd.core.events.inputs import (
    EventObserved,
    LinkBytesRead,
    RequestHandled,
    TaskStepped,
    TimerFired,
)
from chefbotd.core.record import Record

EncodedEvent = tuple[str, bytes]
"""The class of an event, and the event as JSON."""

ABSENT = "nothing"


class Difference(Record, frozen=True):
    """Where a replay first differs. ``field`` is the first one that does (empty: the whole event)."""

    stamp_s: float
    after: str
    kind: str
    field: str
    recorded: str
    replayed: str

    def __str__(self) -> str:
        where = f"{self.kind} {self.field}" if self.field else self.kind
        return (
            f"at {self.stamp_s:.6f} s, after {self.after}: {where}: "
            f"recorded {self.recorded}, replayed {self.replayed}"
        )


class Row:
    """How the events of a class differ."""

    def __init__(self) -> None:
        self.recorded = self.replayed = self.differing = 0
        self.largest, self.field = 0.0, ""
        self._waiting: tuple[deque[Any], deque[Any]] = (deque(), deque())

    def add(self, recorded: list[Any], replayed: list[Any]) -> None:
        """What followed one entry, as plain values: pairs in their order. What is left finds its pair by its stamp."""
        self.recorded += len(recorded)
        self.replayed += len(replayed)
        pairs = min(len(recorded), len(replayed))
        for one, other in zip(recorded[:pairs], replayed[:pairs], strict=True):
            self._compare(one, other)
        ours, theirs = self._waiting
        ours += recorded[pairs:]
        theirs += replayed[pairs:]
        while ours and theirs:
            early = _stamp(ours[0]) - _stamp(theirs[0])
            if early != 0.0 and abs(early) > _NEAR_S:
                (ours if early < 0 else theirs).popleft()
                self.differing += 1
                continue
            self._compare(ours.popleft(), theirs.popleft())

    def finish(self) -> None:
        """Nothing more comes: what has no partner differs."""
        for waiting in self._waiting:
            self.differing += len(waiting)
            waiting.clear()

    def _compare(self, recorded: Any, replayed: Any) -> None:
        if recorded == replayed:
            return
        self.differing += 1
        for field, one, other in differences(recorded, replayed):
            if _is_number(one) and _is_number(other) and abs(one - other) > self.largest:
                self.largest, self.field = abs(one - other), field


_NEAR_S = 0.002


class Comparison:
    """Counts by class; ``first`` is the first difference. Classes in ``left_out`` are not in the recording."""

    def __init__(self, left_out: Iterable[str] = ()) -> None:
        self._left_out = NOT_COMPARED | set(left_out)
        self.rows: dict[str, Row] = {}
        self.first: Difference | None = None
        self.different = 0

    def takes(self, kind: str) -> bool:
        """Whether events of this class are compared."""
        return kind not in self._left_out

    def add(self, entry: Any, recorded: list[Recorded], replayed: list[EncodedEvent]) -> bool:
        """What followed an entry, then and now; whether it is the same."""
        left_out, rows = self._left_out, self.rows
        was = [(event.kind, event.payload) for event in recorded if event.kind not in left_out]
        if was == replayed or _are_same(was, replayed):
            for kind, _ in was:
                row = rows.get(kind) or self._row(kind)
                row.recorded += 1
                row.replayed += 1
            return True
        if self.first is None:
            self.first = _first_difference(entry.stamp_s, describe_entry(entry), was, replayed)
        self.different += 1
        for kind in dict.fromkeys(kind for kind, _ in (*was, *replayed)):
            self._row(kind).add(_of_kind(kind, was), _of_kind(kind, replayed))
        return False

    def _row(self, kind: str) -> Row:
        row = self.rows.get(kind)
        if row is None:
            row = self.rows[kind] = Row()
        return row

    def finish(self) -> None:
        """The recording is over."""
        for row in self.rows.values():
            row.finish()

    @property
    def counts(self) -> Counter[str]:
        """Recorded events by class."""
        return Counter({kind: row.recorded for kind, row in self.rows.items()})


def _are_same(was: list[EncodedEvent], now: list[EncodedEvent]) -> bool:
    return len(was) == len(now) and all(map(_is_same, was, now))


def _is_same(one: EncodedEvent, other: EncodedEvent) -> bool:
    """Whether two events are equal to the last bit; another version may write the fields in another order."""
    return one == other or (one[0] == other[0] and _in_order(one[1]) == _in_order(other[1]))


def _in_order(payload: bytes) -> bytes:
    return msgspec.json.encode(msgspec.json.decode(payload), order="sorted")


def _first_difference(
    stamp_s: float, after: str, was: list[EncodedEvent], now: list[EncodedEvent]
) -> Difference:
    for one, other in zip(was, now, strict=False):
        if _is_same(one, other):
            continue
        if one[0] != other[0]:
            return Difference(stamp_s, after, one[0], "", _short(one), _short(other))
        for field, before, after_it in differences(
            msgspec.json.decode(one[1]), msgspec.json.decode(other[1])
        ):
            return Difference(stamp_s, after, one[0], field, _text(before), _text(after_it))
        return Difference(stamp_s, after, one[0], "", _short(one), _short(other))
    longer = was if len(was) > len(now) else now
    extra = longer[min(len(was), len(now))]
    sides = (_short(extra), ABSENT) if longer is was else (ABSENT, _short(extra))
    return Difference(stamp_s, after, extra[0], "", *sides)


def differences(one: Any, other: Any, where: str = "") -> Iterator[tuple[str, Any, Any]]:
    """The fields in which two plain values differ, with both values."""
    if isinstance(one, dict) and isinstance(other, dict):
        for name in {**one, **other}:
            inner = f"{where}.{name}" if where else str(name)
            yield from differences(one.get(name), other.get(name), inner)
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for index, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(*pair, f"{where}[{index}]")
    elif one != other:
        yield where, one, other


def _of_kind(kind: str, events: list[EncodedEvent]) -> list[Any]:
    return [msgspec.json.decode(payload) for name, payload in events if name == kind]


def _stamp(event: Any) -> float:
    stamp = event.get("stamp_s", math.nan)
    return float(stamp)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _text(value: object) -> str:
    return ABSENT if value is None else repr(value)


def _short(event: EncodedEvent) -> str:
    text = f"{event[0]} {event[1].decode(errors='replace')}"
    return text if len(text) <= 160 else text[:157] + "..."


def describe_entry(entry: Any) -> str:
    """An entry in a few words."""
    match entry:
        case LinkBytesRead():
            return f"{len(entry.data)} bytes from {entry.link}"
        case TimerFired():
            return f"the timer '{entry.timer}'"
        case RequestHandled():
            return f"the request {entry.method} of {entry.name or entry.where}"
        case TaskStepped():
            return f"a step of '{entry.task}'"
        case EventObserved():
            return "what was observed outside"
    return type(entry).__name__


class SpeedError:
    """The wheels' errors of speed (target less measured, rad/s) and duties, as root mean squares."""

    def __init__(self) -> None:
        self._error2 = self._duty2 = 0.0
        self._count = 0

    def add(self, driven: Any) -> None:
        """A ``WheelsDriven`` as plain values."""
        for target, measured, duty in zip(
            driven["target_rad_s"], driven["velocity_rad_s"], driven["duty"], strict=True
        ):
            self._error2 += (target - measured) ** 2
            self._duty2 += duty**2
            self._count += 1

    @property
    def rms_rad_s(self) -> float | None:
        """Of all wheels and steps; None without any."""
        return math.sqrt(self._error2 / self._count) if self._count else None

    @property
    def duty_rms(self) -> float | None:
        """The same of the duties."""
        return math.sqrt(self._duty2 / self._count) if self._count else None
