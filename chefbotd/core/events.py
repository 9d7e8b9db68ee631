"""What has happened: the events on the bus, each named in the past tense.

``stamp_s`` is the host's monotonic time at which the bytes behind the event were read (or, where there were none, at
which it happened). ``board_s`` is the board's own time, unwrapped, in seconds; only differences of it mean anything.
"""

from dataclasses import dataclass, field
from enum import StrEnum

from chefbotd.core.geometry import Pose2D, PoseCovariance, Twist2D


@dataclass(frozen=True, slots=True)
class LinkOpened:
    """The serial device is open and being read."""

    stamp_s: float
    device: str


@dataclass(frozen=True, slots=True)
class LinkClosed:
    """The serial device is gone; ``reason`` is for people."""

    stamp_s: float
    device: str
    reason: str


@dataclass(frozen=True, slots=True)
class LinkJudged:
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


@dataclass(frozen=True, slots=True)
class WheelsMeasured:
    """Where the wheels are and how fast they turn, in the order of the configured wheels.

    ``travel_rad`` is how far each has turned since the previous event of this class: nothing is lost between two of
    them, and a refused reading adds nothing. ``left_out`` are the indices of wheels that are not to be believed, because
    they disagree with their mates on the same side.
    """

    stamp_s: float
    board_s: float
    position_rad: tuple[float, ...]
    travel_rad: tuple[float, ...]
    velocity_rad_s: tuple[float, ...]
    left_out: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class WheelsDriven:
    """A control step: what the wheels did, what they should do, and the duty that was commanded.

    ``left_out`` as in ``WheelsMeasured``.
    """

    stamp_s: float
    position_rad: tuple[float, ...]
    velocity_rad_s: tuple[float, ...]
    target_rad_s: tuple[float, ...]
    duty: tuple[int, ...]
    left_out: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class OdometryUpdated:
    """Dead reckoning: ``odom_from_base`` with its covariance, and the twist in the base frame."""

    stamp_s: float
    odom_from_base: Pose2D
    twist: Twist2D
    covariance: PoseCovariance


class RangeStatus(StrEnum):
    """What a range reading says; only ``OK`` carries a distance. ``AMBIGUOUS``: near or far, it cannot be told."""

    OK = "ok"
    TOO_NEAR = "too_near"
    TOO_FAR = "too_far"
    NO_ECHO = "no_echo"
    AMBIGUOUS = "ambiguous"


@dataclass(frozen=True, slots=True)
class RangeMeasured:
    """One beam: ``range_m`` is None unless ``status`` is ``OK``; the field of view is the cone's full angle."""

    stamp_s: float
    sensor: str
    status: RangeStatus
    range_m: float | None
    min_range_m: float
    max_range_m: float
    field_of_view_rad: float


@dataclass(frozen=True, slots=True)
class ImuMeasured:
    """The IMU in SI units: a unit quaternion (x, y, z, w), or rates and accelerations; what it lacks is None."""

    stamp_s: float
    orientation: tuple[float, float, float, float] | None = None
    heading_rad: float | None = None
    angular_velocity_rad_s: tuple[float, float, float] | None = None
    linear_acceleration_m_s2: tuple[float, float, float] | None = None


class BatteryLevelStatus(StrEnum):
    """How urgent the battery is."""

    OK = "ok"
    LOW = "low"
    CRITICAL = "critical"


@dataclass(frozen=True, slots=True)
class BatteryMeasured:
    """The battery in volts, as a percentage of its useful range, and how urgent that is."""

    stamp_s: float
    voltage_v: float
    percentage: float
    status: BatteryLevelStatus


@dataclass(frozen=True, slots=True)
class SafetyChanged:
    """The gate's state: its mode, why, and whose command is in force (None: nobody's).

    ``fault`` is the stable name of the fault that latched (None: none did). ``limited_by`` says what keeps the command
    from being followed as it was given: ``encoders_stale``, or ``obstacle:`` and the sensor that sees it.
    """

    stamp_s: float
    mode: str
    reason: str
    source: str | None
    fault: str | None = None
    limited_by: str | None = None


@dataclass(frozen=True, slots=True)
class ControlChanged:
    """Who drives: for each source of commands that someone has control of, the client's name."""

    stamp_s: float
    holders: dict[str, str]


@dataclass(frozen=True, slots=True)
class TruthSimulated:
    """Where the simulated robot really is (``world_from_base``), how it moves, and whether it touches a wall."""

    stamp_s: float
    world_from_base: Pose2D
    twist: Twist2D
    in_contact: bool


@dataclass(frozen=True, slots=True)
class StatsSampled:
    """Counters since the daemon started, and the worst of the last second, sampled once a second.

    ``frames`` counts accepted lines by message name, ``refused`` the malformed ones by reason, ``bus_dropped`` events
    given up by class, ``handler_faults`` requests that broke their handler by method, ``clients_refused`` connections
    that the socket refused or ended by the kind of error, ``internal_errors`` control steps that failed,
    ``service_failures`` services that were started again, by name. ``loop_lag_s`` is the latest the event loop
    was to a timer in the last second.
    """

    stamp_s: float
    uptime_s: float
    frames: dict[str, int]
    refused: dict[str, int]
    lines_out: int
    setpoints_replaced: int
    link_opens: int
    board_restarts: int
    encoder_readings_refused: int
    control_steps: int
    bus_dropped: dict[str, int]
    clients: int
    telemetry_dropped: int
    loop_lag_s: float
    board_clock_skew_ppm: float | None
    board_clock_jitter_s: float | None
    clients_refused: dict[str, int] = field(default_factory=dict)
    handler_faults: dict[str, int] = field(default_factory=dict)
    internal_errors: int = 0
    service_failures: dict[str, int] = field(default_factory=dict)
    board_clock_suspects: int = 0
    encoder_transitions_illegal: int = 0
    encoder_levels_repeated: int = 0
    encoder_edges_lost: int = 0
    bytes_in: int = 0
