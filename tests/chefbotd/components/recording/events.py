"""One oblique event of every class, and a recorder in a folder."""

import enum
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from chefbotd.components.recording.chunk import Channels
from chefbotd.components.recording.chunk_encoder import ChunkEncoder
from chefbotd.components.recording.folder import RecordingDisk
from chefbotd.components.recording.foxglove import Cells, ReadMap
from chefbotd.components.recording.parameters import RecordingParameters
from chefbotd.components.recording.recorder import Recorder
from chefbotd.components.recording.status import About
from chefbotd.core.events import OdometryUpdated, SafetyChanged, WheelsDriven
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import RecordingData
from chefbotd.core.geometry import Pose2D, PoseCovariance, Twist2D
from chefbotd.core.scan import LaserScan

WALL_S = 1_700_000_000.25
START_S = 5000.5
ABOUT = About({"chefbotd": {"robot": "kitchen-bot"}}, "<robot name='kitchen-bot'/>")


class SyncRecorder(Recorder):
    """A recorder with its encoder before it, in one call."""

    encoder: ChunkEncoder

    def record(self, events: Sequence[Any], now_s: float) -> None:  # type: ignore[override]
        """Record events, a chunk at a time."""
        self.encoder.encode(events)
        if self.encoder.is_due(now_s):
            self.flush(now_s)

    def note_gap(self, count: int, reason: str, now_s: float) -> None:
        """So many events are missing here."""
        self.encoder.skip(count)
        self.encoder.mark_gap(count, reason, now_s)

    def flush(self, now_s: float) -> None:
        """What is in no chunk yet."""
        if (chunk := self.encoder.cut(now_s)) is not None:
            super().record(chunk, now_s)

    def start(self, name: str | None, now_s: float, *, from_beginning: bool = False) -> RecordingData:
        """After all that was taken before."""
        self.flush(now_s)
        return super().start(name, now_s, from_beginning=from_beginning)

    def stop(self, now_s: float) -> RecordingData:
        """After all that was taken before."""
        self.flush(now_s)
        return super().stop(now_s)

    def save_ring(self, reason: str, now_s: float, *, fault: bool = False) -> RecordingData:
        """After all that was taken before."""
        self.flush(now_s)
        return super().save_ring(reason, now_s, fault=fault)


def no_map(event: Any) -> Cells | None:
    """No map can be read."""
    return None


def recorder(
    folder: Path,
    disk: RecordingDisk | None = None,
    read_map: ReadMap = no_map,
    about: About = ABOUT,
    **parameters: Any,
) -> SyncRecorder:
    """A recorder that begins at ``START_S``, which is ``WALL_S`` since 1970."""
    encoder, made = parts(folder, disk, read_map, about=about, **parameters)
    assert isinstance(made, SyncRecorder)
    made.encoder = encoder
    return made


def parts(
    folder: Path,
    disk: RecordingDisk | None = None,
    read_map: ReadMap = no_map,
    kind: type[Recorder] = SyncRecorder,
    about: About = ABOUT,
    **parameters: Any,
) -> tuple[ChunkEncoder, Recorder]:
    """An encoder, and what takes its pieces."""
    told = RecordingParameters(**{"min_free_mb": 0.0, **parameters})
    offset_ns = round(WALL_S * 1e9) - round(START_S * 1e9)
    encoder = ChunkEncoder(Channels(), offset_ns, None, told.chunk_s, START_S)
    made = kind(
        told,
        folder,
        encoder.channels,
        offset_ns,
        about=lambda: about,
        read_map=read_map,
        disk=disk,
        wall_s=lambda: WALL_S,
    )
    return encoder, made


def cycle(stamp_s: float) -> list[Any]:
    """What a cycle of the board brings, with numbers that no rounding leaves alone."""
    pose = Pose2D(stamp_s / 3, -stamp_s / 7, 0.1)
    return [
        WheelsDriven(stamp_s, (stamp_s / 9, 2.0), (3.3, -4.4), (3.5, -4.5), (101, -77), (1,)),
        OdometryUpdated(
            stamp_s, stamp_s + 0.0031, pose, Twist2D(0.3, -0.2), PoseCovariance(1e-3, 2e-4, 0.0, 3e-3)
        ),
    ]


def fault(stamp_s: float, kind: str = "stalled") -> SafetyChanged:
    """A fault that latched."""
    return SafetyChanged(stamp_s, "disarmed", "the left wheel stands", None, fault=kind)


def example(event_class: type[Any]) -> Any:
    """An event of this class whose fields differ from each other."""
    if event_class is ScanMeasured:
        beams = np.linspace(-3.0, 3.1, 7)
        return ScanMeasured(
            7.25, "top", Pose2D(0.1, -0.02, 0.3), LaserScan(7.25, beams, beams**2 + 0.3, beams / 60)
        )
    return _value(event_class, count(1))


def _value(kind: Any, numbers: Iterator[int]) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        return _value(arguments[0], numbers)
    if origin is tuple:
        inner = arguments[:1] * 2 if arguments[-1] is Ellipsis else arguments
        return tuple(_value(each, numbers) for each in inner)
    if origin in (dict, Mapping):
        return {f"key{next(numbers)}": _value(arguments[1], numbers)}
    if origin is typing.Literal:
        return arguments[-1]
    if kind is Any:
        return {"deep": [next(numbers), None]}
    if issubclass(kind, msgspec.Struct):
        hints = typing.get_type_hints(kind)
        return kind(**{name: _value(hints[name], numbers) for name in kind.__struct_fields__})
    if issubclass(kind, enum.Enum):
        return list(kind)[-1]
    if hasattr(kind, "_fields"):
        return kind(*(next(numbers) / 7 for _ in kind._fields))
    number = next(numbers)
    plain = {
        float: number / 7,
        int: number,
        str: f"word {number} \u00e9",
        bool: True,
        bytes: bytes([0, 255, number]),
    }
    return plain[kind]
