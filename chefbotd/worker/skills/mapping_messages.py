"""The messages of the skill ``mapping``. The daemon's side loads neither numpy nor a compiler."""

from pathlib import Path
from typing import Final, TypeAlias

import msgspec

from chefbotd.core.parameters import Parameters
from chefbotd.mapping.parameters import MappingParameters
from chefbotd.worker.messages import Message

SKILL: Final = "mapping"


class MappingSkillParameters(Parameters):
    """What the daemon tells the skill when it starts it; ``session`` is new with each start of the daemon.

    Of ``lidars`` the first leads: a scan has its time.
    """

    lidars: tuple[str, ...]
    folder: Path
    versions_kept: int
    session: str
    mapping: MappingParameters


# Requests


class Start(Message, frozen=True, tag="start"):
    """Begin a map; with a ``name``: go on with that one; ``unfinished``: with the one that was never finished."""

    name: str | None = None
    unfinished: bool = False


class Resume(Message, frozen=True, tag="resume"):
    """A new worker is to go on with what the one before it saved on its own; ``name`` as in ``MappingStatus``."""

    paused: bool
    name: str | None = None


class Pause(Message, frozen=True, tag="pause"):
    """Take in no scans until told to start again."""


class Finish(Message, frozen=True, tag="finish"):
    """Match all scans once more, save the map under this name, and end."""

    name: str


class Discard(Message, frozen=True, tag="discard"):
    """End without saving, and forget what was saved meanwhile."""


class GetGrid(Message, frozen=True, tag="get_grid"):
    """The whole map as it is now."""


class GetStatus(Message, frozen=True, tag="get_status"):
    """How the map stands, and whether one was never finished."""


MappingRequest: TypeAlias = Start | Resume | Pause | Finish | Discard | GetGrid | GetStatus

# Answers


class MappingStatus(Message, frozen=True, tag="status"):
    """How the map stands; ``reason`` says what is wrong, if anything is. Also told whenever the state changes.

    ``state`` is idle, mapping, paused or finishing; ``name``: the map that is being extended. ``unfinished``: a
    map that was not finished lies on the disk. ``warning`` says what is lost of it, if anything is.
    """

    state: str
    name: str | None = None
    keyframes: int = 0
    loops: int = 0
    path_m: float = 0.0
    scans: int = 0
    unfinished: bool = False
    reason: str = ""
    warning: str = ""


class Finished(Message, frozen=True, tag="finished"):
    """The map was saved."""

    name: str
    version: int
    keyframes: int
    loops: int
    path_m: float


class GridPart(Message, frozen=True, tag="grid"):
    """A grid's cells, or those that have changed since ``revision - 1``: from (``row``, ``column``) on.

    ``origin`` is where the outer corner of the grid's cell (0, 0) lies in ``map`` (x, y, heading). ``cells`` are the
    part's percentages row by row, a signed byte each (-1: unknown), compressed by zlib. ``whole``: it is all of it.
    """

    stamp_s: float
    revision: int
    resolution_m: float
    origin: tuple[float, float, float]
    columns: int
    rows: int
    column: int
    row: int
    part_columns: int
    part_rows: int
    whole: bool
    cells: bytes


# Told without having been asked


class PoseFound(Message, frozen=True, tag="pose"):
    """Where a scan was taken, in the map and by odometry; ``state`` is that of SLAM (``mapping.state.SlamMode``)."""

    stamp_s: float
    map_from_base: tuple[float, float, float]
    odometry: tuple[float, float, float]
    covariance: tuple[float, float, float, float, float, float]
    fit: float
    state: str


MappingTold: TypeAlias = PoseFound | GridPart | MappingStatus

REQUEST: Final = msgspec.msgpack.Decoder(MappingRequest)
TOLD: Final = msgspec.msgpack.Decoder(MappingTold)
STATUS: Final = msgspec.msgpack.Decoder(MappingStatus)
FINISHED: Final = msgspec.msgpack.Decoder(Finished)
GRID: Final = msgspec.msgpack.Decoder(GridPart)
