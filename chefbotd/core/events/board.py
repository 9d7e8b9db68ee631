"""What the link and the board have said, in the board's own numbers."""

from dataclasses import dataclass
from enum import StrEnum


@dataclass(frozen=True, slots=True)
class LinkOpened:
    """The serial device is open and being read."""

    stamp_s: float
    device: str


@dataclass(frozen=True, slots=True)
class LinkNotOpened:
    """The device cannot be opened; ``reason`` tells people why and what to do. Told again when the reason changes."""

    stamp_s: float
    device: str
    reason: str


@dataclass(frozen=True, slots=True)
class LinkClosed:
    """The serial device is gone; ``reason`` is for people."""

    stamp_s: float
    device: str
    reason: str


@dataclass(frozen=True, slots=True)
class LinkHealthChanged:
    """What the open device sounds like: ``condition`` is its stable name, ``reason`` for people (empty: healthy)."""

    stamp_s: float
    device: str
    healthy: bool
    condition: str
    reason: str


@dataclass(frozen=True, slots=True)
class BoardRestarted:
    """The board's counters and time began anew; ``cause`` says how it was noticed."""

    stamp_s: float
    cause: str


@dataclass(frozen=True, slots=True)
class BoardResetProgressed:
    """How far a restart that was asked for has come; ``stage`` is its stable name, ``reason`` for people."""

    stamp_s: float
    stage: str
    reason: str


@dataclass(frozen=True, slots=True)
class DutyWritten:
    """A motor command went to the port; whether the board reads it is told by ``DutyEchoed``."""

    stamp_s: float
    duty: tuple[int, ...]


class Direction(StrEnum):
    """Which way a line went."""

    FROM_BOARD = "in"
    TO_BOARD = "out"


@dataclass(frozen=True, slots=True)
class LineSeen:
    """A line as it stood on the wire, without its end."""

    stamp_s: float
    direction: Direction
    line: bytes


@dataclass(frozen=True, slots=True)
class LineRefused:
    """A line from the board that was no message."""

    stamp_s: float
    reason: str
    line: bytes
    detail: str


@dataclass(frozen=True, slots=True)
class TextReceived:
    """A line of text from the board: its banner, or whatever else it prints."""

    stamp_s: float
    text: str


@dataclass(frozen=True, slots=True)
class EncodersCounted:
    """Accumulated encoder counts per wheel, as on the wire.

    ``rate_counts_s`` is how fast each counts, where the edges' own timing says so; None where only the counts are known.
    """

    stamp_s: float
    board_s: float
    counts: tuple[int, ...]
    rate_counts_s: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class EdgeBurst:
    """Edges of a wheel's quadrature encoder, in their order: ``levels`` after each, A worth 2 and B worth 1.

    There are none where the wheel stood. ``times_s`` are the board times of the last edges, one or more; those before
    them have none. ``total`` is how many edges the board has seen up to the last of these, modulo 2^16: what it counted
    and never told is missing here.
    """

    wheel: int
    total: int
    levels: tuple[int, ...]
    times_s: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class EdgesSeen:
    """The edges of a cycle that ended at ``board_s``: each wheel's bursts in their order, at least one of each."""

    stamp_s: float
    board_s: float
    bursts: tuple[EdgeBurst, ...]


@dataclass(frozen=True, slots=True)
class UltrasonicEchoed:
    """Whole centimetres from the ultrasonic sensor; 0 is no echo."""

    stamp_s: float
    distance_cm: int


@dataclass(frozen=True, slots=True)
class AnalogueCounted:
    """The raw 12-bit ADC reading of one analogue input."""

    stamp_s: float
    channel: int
    adc: float


@dataclass(frozen=True, slots=True)
class DutyEchoed:
    """The motor command that the board says is in force."""

    stamp_s: float
    duty: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class OrientationReported:
    """The IMU's quaternion as on the wire, not normalised."""

    stamp_s: float
    x: float
    y: float
    z: float
    w: float


@dataclass(frozen=True, slots=True)
class InertialCounted:
    """Raw IMU counts, acceleration and angular rate, each x y z."""

    stamp_s: float
    acceleration: tuple[int, int, int]
    angular_rate: tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class BatteryCounted:
    """The raw ADC reading behind the battery's divider."""

    stamp_s: float
    adc: float
