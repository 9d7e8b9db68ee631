"""Events of the link and the board, in the board's own numbers."""

from enum import StrEnum
from typing import Annotated, ClassVar

from msgspec import Meta

from chefbotd.core.record import Level, LogLine, Record, because
from chefbotd.core.sentence import Sentence


class LinkOpened(Record, frozen=True):
    """The serial device is open and being read."""

    retained: ClassVar[bool] = True

    stamp_s: float
    device: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(Level.INFO, "link", Sentence("log.port_open", "open: {device}", device=self.device))


class LinkNotOpened(Record, frozen=True):
    """The device cannot be opened; ``reason`` says why and what to do. Published again when the reason changes."""

    stamp_s: float
    device: str
    reason: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(
            Level.WARNING,
            "link",
            Sentence("log.port_not_opened", "cannot be opened: {reason}", reason=self.reason),
        )


class LinkClosed(Record, frozen=True):
    """The serial device is gone; ``reason`` is for people."""

    stamp_s: float
    device: str
    reason: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(
            Level.WARNING, "link", Sentence("log.port_closed", "closed: {reason}", reason=self.reason)
        )


class LinkHealthChanged(Record, frozen=True):
    """The condition of the open device: ``condition`` is a stable name, ``reason`` is for people (empty: healthy)."""

    stamp_s: float
    device: str
    healthy: bool
    condition: str
    reason: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        if self.healthy:
            return LogLine(
                Level.INFO, "link", Sentence("log.link_healthy", "{device} is healthy", device=self.device)
            )
        return LogLine(Level.WARNING, "link", because(self.condition, self.reason))


class BoardRestarted(Record, frozen=True):
    """The board has restarted, with its counters and its time; ``cause`` says how this was noticed."""

    stamp_s: float
    cause: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(
            Level.WARNING,
            "board",
            Sentence("log.board_restarted", "has restarted: {cause}", cause=self.cause),
        )


class BoardResetProgressed(Record, frozen=True):
    """The progress of a requested restart; ``stage`` is a stable name, ``reason`` is for people."""

    stamp_s: float
    stage: str
    reason: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(
            Level.INFO,
            "board",
            Sentence("log.reset", "reset {stage}: {reason}", stage=self.stage, reason=self.reason),
        )


class FirmwareData(Record, frozen=True):
    """Our own firmware on the board, with each change and once a second; a classic sketch tells nothing."""

    mode: Annotated[
        str, Meta(description="classic, or checked: lines with checksums, and a board that stops by itself")
    ]
    version: str
    board: str
    capabilities: tuple[str, ...]
    deadman_ms: Annotated[
        int | None, Meta(description="after how long without a command the board stops; null: it does not")
    ]
    reset_cause: str
    stops: Annotated[
        tuple[str, ...],
        Meta(description="in force on the board: dead_man, estop, stall, left_wheel_lost, ..."),
    ]
    stopped_itself: Annotated[bool, Meta(description="one of them latched that nobody here asked for")]
    crc_errors: Annotated[
        int, Meta(description="lines that arrived damaged at the board; wraps at 65536, as the next")
    ]
    refused: int
    overruns: int
    gaps: int
    deadman_stops: int
    late_cycles: int
    lines_lost: Annotated[int, Meta(description="lines of the board that did not arrive, or damaged")]
    round_trip_s: Annotated[float | None, Meta(description="from a command to its echo, on average")]
    clock_late_s: Annotated[
        float | None, Meta(description="by how much later than they were taken readings are stamped")
    ]
    reason: Annotated[str, Meta(description="why the checked mode is not agreed on, if it was tried")]
    build: Annotated[
        str, Meta(description="its program, by the CRC over it; empty: the board does not say so")
    ] = ""
    counted_edges: Annotated[
        int | None, Meta(description="which edges of a period of its encoders it counts: 4 are all")
    ] = None
    most_edges_s: Annotated[
        int | None, Meta(description="how many edges of a wheel a second it counts at most")
    ] = None


class FirmwareReported(FirmwareData, frozen=True, kw_only=True):
    """What the board's own firmware is and says of itself; nothing is known of a classic sketch."""

    retained: ClassVar[bool] = True

    stamp_s: float


class DutyWritten(Record, frozen=True):
    """A motor command was written to the port. ``DutyEchoed`` shows whether the board has read it."""

    stamp_s: float
    duty: tuple[int, ...]


class Direction(StrEnum):
    """The direction of a line."""

    FROM_BOARD = "in"
    TO_BOARD = "out"


class LineSeen(Record, frozen=True):
    """A line as it was on the wire, without its end."""

    stamp_s: float
    direction: Direction
    line: bytes


class LineRefused(Record, frozen=True):
    """A line from the board that was no message."""

    stamp_s: float
    reason: str
    line: bytes
    detail: str


class TextReceived(Record, frozen=True):
    """A line of text from the board, such as its banner."""

    stamp_s: float
    text: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(Level.INFO, "board", self.text)


class EncodersCounted(Record, frozen=True):
    """Accumulated encoder counts per wheel, as on the wire.

    ``rate_counts_s`` is the speed of each counter by the times of its edges; None where only the counts are known.
    """

    stamp_s: float
    arrival_s: float
    board_s: float
    counts: tuple[int, ...]
    rate_counts_s: tuple[float, ...] | None = None


class EdgeBurst(Record, frozen=True):
    """Edges of a wheel's quadrature encoder, in their order: ``levels`` after each, A worth 2 and B worth 1.

    A wheel that stood has none. ``times_s`` are the board times of the last edges, at least one; earlier edges have no
    time. ``total`` is the number of edges up to the last of these, modulo 2^16; it includes edges that the board lost.
    """

    wheel: int
    total: int
    levels: tuple[int, ...]
    times_s: tuple[float, ...]


class EdgesSeen(Record, frozen=True):
    """The edges of a cycle that ended at ``board_s``: the bursts of each wheel in order, at least one per wheel."""

    stamp_s: float
    arrival_s: float
    board_s: float
    bursts: tuple[EdgeBurst, ...]


class UltrasonicEchoed(Record, frozen=True):
    """Whole centimetres from the ultrasonic sensor; 0 is no echo."""

    stamp_s: float
    arrival_s: float
    distance_cm: int


class AnalogueCounted(Record, frozen=True):
    """The raw ADC reading of one analogue input."""

    stamp_s: float
    arrival_s: float
    channel: int
    adc: float


class DutyEchoed(Record, frozen=True):
    """The motor command in force, as the board reports it."""

    stamp_s: float
    arrival_s: float
    duty: tuple[float, ...]


class OrientationReported(Record, frozen=True):
    """The IMU's quaternion as on the wire, not normalised."""

    stamp_s: float
    arrival_s: float
    x: float
    y: float
    z: float
    w: float


class InertialCounted(Record, frozen=True):
    """Raw IMU counts, acceleration and angular rate, each x y z."""

    stamp_s: float
    arrival_s: float
    acceleration: tuple[int, int, int]
    angular_rate: tuple[int, int, int]


class BatteryCounted(Record, frozen=True):
    """The raw ADC reading behind the battery's divider."""

    stamp_s: float
    arrival_s: float
    adc: float
