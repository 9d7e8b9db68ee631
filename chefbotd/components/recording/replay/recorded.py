"""The content of a recording as values: entries, and after each the events that followed."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any

from chefbotd import __version__
from chefbotd.components.recording.encoder import REPEATED
from chefbotd.components.recording.reader import OWN, RecordingReader
from chefbotd.components.recording.status import UnreadableRecording
from chefbotd.core.events.inputs import ANSWERS, ENTRIES, DaemonStarted, DaemonStopping, StateRecorded
from chefbotd.core.record import Record
from chefbotd.event_classes import class_of, decode

OF_THE_RECORDER = frozenset({"RecordingChanged", "EventsDropped"})
NOT_COMPARED = OF_THE_RECORDER | {"LineSeen", "NotificationsChanged"}
"""What the recorder says of itself, what the bytes of the links have in it, and who was told: a replay tells nobody."""

MAX_EVENT_BYTES = 32_000_000
"""A state with a lidar has 70 kB, a scan some 60."""

NO_STRANGERS: Mapping[str, type[Any]] = MappingProxyType({})

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
        return [decode_event(event) for event in self.followers if event.kind in _ANSWER_NAMES]


def decode_event(recorded: Recorded, strangers: Mapping[str, type[Any]] = NO_STRANGERS) -> Any:
    """The event itself; ``strangers`` are the classes of the events of strangers' components.

    Raises:
        NotReplayable: it is not what its class says.
    """
    event_class = strangers.get(recorded.kind) or class_of(recorded.kind)
    if len(recorded.payload) > MAX_EVENT_BYTES:
        size = f"{len(recorded.payload)} bytes, expected at most {MAX_EVENT_BYTES}"
        raise NotReplayable(f"message {recorded.sequence}: a {recorded.kind} of {size}")
    if event_class is None:
        raise NotReplayable(f"message {recorded.sequence}: this version of chefbotd has no {recorded.kind}")
    try:
        return decode(event_class, recorded.payload)
    except (ValueError, RecursionError) as error:
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
            group, lost = EntryGroup(decode_event(event), lost), 0
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


class RecordingFiles:
    """The files of one recording, in their order. ``problem`` says where and why reading ended early, once it has.

    Raises:
        NotReplayable: a file cannot be read, or is of another recording than the first.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = with_parts(paths)
        self.problem: str | None = None
        self._about, *others = [_about(path) for path in self._paths]
        for path, about in zip(self._paths[1:], others, strict=True):
            if _recording_of(about) != _recording_of(self._about):
                raise NotReplayable(
                    f"{path}: is of another recording than {self._paths[0]}; replay one at a time: "
                    "its further parts are found by themselves"
                )

    @property
    def configuration(self) -> str:
        """The configuration of the robot then, as JSON.

        Raises:
            NotReplayable: there is none.
        """
        configuration = self._about.get("configuration", {}).get("json")
        if not configuration:
            raise NotReplayable(
                f"{self._paths[0]}: contains no configuration, so chefbotd did not record it, "
                "or its beginning is missing"
            )
        return configuration

    def require_version(self) -> None:
        """See that this is the version that recorded it.

        Raises:
            NotReplayable: it is another one.
        """
        version = self._about.get("chefbotd", {}).get("chefbotd", "of an unknown version")
        if version != __version__:
            raise NotReplayable(
                f"{self._paths[0]}: was recorded by chefbotd {version}, and this is {__version__}, which may do other "
                "things with the same input; --any-version replays it all the same"
            )

    def messages(self) -> Iterator[Recorded]:
        """Every event.

        Raises:
            NotReplayable: one of the files cannot be read.
        """
        for path in self._paths:
            try:
                reader = RecordingReader(path)
                for message in reader.messages(OWN):
                    if message.sequence != REPEATED:
                        yield Recorded(message.sequence, message.schema[len(OWN) :], message.data)
            except UnreadableRecording as problem:
                raise NotReplayable(str(problem)) from problem
            if reader.problem is not None:
                self.problem = f"{path.name}: {reader.problem}"


def _about(path: Path) -> Mapping[str, Mapping[str, str]]:
    try:
        reader = RecordingReader(path)
        reader.read_about()
    except UnreadableRecording as problem:
        raise NotReplayable(str(problem)) from problem
    return reader.metadata


def _recording_of(about: Mapping[str, Mapping[str, str]]) -> tuple[str | None, str | None]:
    """What all parts of a recording have in common."""
    status = about.get("recording", {})
    return status.get("reason"), status.get("clock_offset_ns")


def with_parts(paths: Sequence[Path]) -> tuple[Path, ...]:
    """The files. A single first part is followed by its other parts, ``NAME_part2.mcap`` and so on."""
    if len(paths) != 1 or paths[0].is_dir():  # that a folder is no recording is said where it is read
        return tuple(paths)
    parts, first = [paths[0]], paths[0]
    while (following := first.with_name(f"{first.stem}_part{len(parts) + 1}{first.suffix}")).is_file():
        parts.append(following)
    return tuple(parts)
