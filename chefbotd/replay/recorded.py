"""What is in a recording, as values: entries, and after each of them what followed."""

from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from chefbotd.core.events import StatsSampled, TruthSimulated
from chefbotd.core.events.depth_cameras import DepthCameraChanged
from chefbotd.core.events.inputs import ANSWERS, ENTRIES, DaemonStopping
from chefbotd.core.events.maps import MapLoaded, MapUnloaded
from chefbotd.core.events.worker import WorkerReported
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record

OF_THE_RECORDER = frozenset({"RecordingChanged", "EventsDropped"})
NOT_COMPARED = OF_THE_RECORDER | {"LineSeen"}
"""What the recorder says of itself, and what the bytes of the links have in it."""

_OBSERVED = (StatsSampled, TruthSimulated, DepthCameraChanged, MapLoaded, MapUnloaded, WorkerReported)
_DECODERS: dict[str, msgspec.json.Decoder[Any]] = {
    each.__name__: msgspec.json.Decoder(each) for each in (*ENTRIES, *ANSWERS, *_OBSERVED, DaemonStopping)
}
_ENTRY_NAMES = frozenset(each.__name__ for each in ENTRIES)
_ANSWER_NAMES = frozenset(each.__name__ for each in ANSWERS)


class Recorded(Record, frozen=True):
    """A message of a recording: the class of the event, and the event as JSON. ``sequence`` counts the events."""

    sequence: int
    kind: str
    payload: bytes


class NotReplayable(Exception):
    """The file cannot be replayed; the text says why."""


class Group:
    """An entry, and all that followed it until the next."""

    __slots__ = ("entry", "followers", "lost")

    def __init__(self, entry: Any, lost: int) -> None:
        self.entry, self.lost = entry, lost
        self.followers: list[Recorded] = []

    def answers(self) -> list[Any]:
        """What the outside answered meanwhile."""
        return [decoded(each) for each in self.followers if each.kind in _ANSWER_NAMES]


def decoded(recorded: Recorded) -> Any:
    """The event itself; of a class that comes from outside only.

    Raises:
        NotReplayable: it is not what its class says.
    """
    if recorded.kind == "ScanMeasured":
        return _scan(msgspec.json.decode(recorded.payload))
    decoder = _DECODERS.get(recorded.kind)
    if decoder is None:
        raise NotReplayable(
            f"message {recorded.sequence}: {recorded.kind} is nothing that comes from outside"
        )
    try:
        return decoder.decode(recorded.payload)
    except msgspec.DecodeError as error:
        told = f"message {recorded.sequence}: not a {recorded.kind} of this version of chefbotd: {error}"
        raise NotReplayable(told) from error


def _scan(told: dict[str, Any]) -> Any:
    import numpy as np

    from chefbotd.core.events.scans import ScanMeasured
    from chefbotd.core.scan import LaserScan

    scan = told["scan"]
    columns = [np.array(scan[name], dtype=float) for name in ("bearing_rad", "range_m", "after_s")]
    mount = Pose2D(**told["base_from_lidar"])
    return ScanMeasured(told["stamp_s"], told["lidar"], mount, LaserScan(scan["stamp_s"], *columns))


def encoded(event: Any) -> bytes:
    """An event as it is in a recording."""
    if type(event).__name__ != "ScanMeasured":
        return msgspec.json.encode(event)
    scan = event.scan
    arrays = {name: getattr(scan, name).tolist() for name in ("bearing_rad", "range_m", "after_s")}
    return msgspec.json.encode(
        {
            "stamp_s": event.stamp_s,
            "lidar": event.lidar,
            "base_from_lidar": event.base_from_lidar,
            "scan": {"stamp_s": scan.stamp_s, **arrays},
        }
    )


def recorded_of(events: Iterable[Any]) -> Iterator[Recorded]:
    """Events that were taken off the bus, as they are in a file."""
    for number, event in enumerate(events, 1):
        yield Recorded(number, type(event).__name__, encoded(event))


def groups_of(stream: Iterable[Recorded]) -> Iterator[Group]:
    """The entries in their order, up to the daemon's end; ``lost`` counts messages that are missing before one.

    What comes before the first entry is left out.
    """
    group: Group | None = None
    before = None
    lost = 0
    for each in stream:
        if before is not None and each.sequence > before + 1:
            lost += each.sequence - before - 1
        before = each.sequence
        if each.kind == DaemonStopping.__name__:
            break
        if each.kind in _ENTRY_NAMES:
            if group is not None:
                yield group
            group, lost = Group(decoded(each), lost), 0
        elif group is not None:
            group.followers.append(each)
    if group is not None:
        yield group
