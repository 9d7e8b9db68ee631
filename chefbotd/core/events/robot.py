"""Events of the robot in SI units: wheels, odometry, sensors, and what the robot may do."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, ClassVar

from msgspec import Meta

from chefbotd.core.geometry import Pose2D, PoseCovariance, Twist2D
from chefbotd.core.record import Level, LogLine, Record, because, state_line
from chefbotd.core.sentence import Sentence


class WheelsMeasured(Record, frozen=True):
    """The angles and speeds of the wheels, in the order of the configured wheels.

    ``travel_rad`` is each wheel's turn since the previous event of this class. No travel is lost between two events, and
    a refused reading adds none. ``excluded`` are the indices of wheels that disagree with the others of their side.
    """

    stamp_s: float
    arrival_s: float
    board_s: float
    position_rad: tuple[float, ...]
    travel_rad: tuple[float, ...]
    velocity_rad_s: tuple[float, ...]
    excluded: tuple[int, ...] = ()


class WheelsDriven(Record, frozen=True):
    """A control step: what the wheels did, what they should do, and the duty that was commanded.

    ``excluded`` as in ``WheelsMeasured``.
    """

    stamp_s: float
    position_rad: tuple[float, ...]
    velocity_rad_s: tuple[float, ...]
    target_rad_s: tuple[float, ...]
    duty: tuple[int, ...]
    excluded: tuple[int, ...] = ()


class ImuTrust(StrEnum):
    """What odometry makes of the IMU. Only ``OK`` and ``OUTLIERS`` are used.

    ``DISAGREES``: it turns otherwise than the wheels, in every turn; it is left out until the board restarts.

    ``UNUSED``: there is none, or it is not asked. ``LATE``: the board was silent for long, so its IMU's queue hands out
    old samples. ``FROZEN``: its values do not change although the wheels turn. ``LOST``: it sends nothing.
    ``OUTLIERS``: some of its values are refused.
    """

    UNUSED = "unused"
    OK = "ok"
    LATE = "late"
    FROZEN = "frozen"
    LOST = "lost"
    OUTLIERS = "outliers"
    DISAGREES = "disagrees"


class MotionAnomaly(StrEnum):
    """What makes odometry less certain than usual.

    ``SLIP``: the wheels and the IMU disagree about a turn. ``STALLED``: wheels that are driven stand. ``PUSHED``: the
    robot turns while its wheels stand. ``LIFTED``: it is tilted too far to stand on its wheels.
    """

    NONE = "none"
    SLIP = "slip"
    STALLED = "stalled"
    PUSHED = "pushed"
    LIFTED = "lifted"


class OdometryUpdated(Record, frozen=True):
    """Dead reckoning: ``odom_from_base`` with its covariance, and the twist in the base frame."""

    drawn_as: ClassVar[str] = "odometry"

    stamp_s: float
    arrival_s: float
    odom_from_base: Pose2D
    twist: Twist2D
    covariance: PoseCovariance


class OdometryConditionData(Record, frozen=True):
    """What odometry makes of its sensors and of the motion; while there is an anomaly it is less certain."""

    imu: ImuTrust = ImuTrust.UNUSED
    anomaly: MotionAnomaly = MotionAnomaly.NONE
    reason: Annotated[str, Meta(description="why the IMU is left out, and what to do; empty otherwise")] = ""


class OdometryConditionChanged(OdometryConditionData, frozen=True, kw_only=True):
    """What odometry makes of its sensors and of the motion has changed."""

    retained: ClassVar[bool] = True

    stamp_s: float

    def log_line(self) -> LogLine:
        """The line in the log."""
        usual = self.anomaly is MotionAnomaly.NONE and self.imu in (ImuTrust.OK, ImuTrust.UNUSED)
        level = Level.INFO if usual else Level.WARNING
        states = {"imu": str(self.imu), "anomaly": str(self.anomaly)}
        if self.reason:
            text = Sentence(
                "log.odometry_because",
                "imu: {imu}; anomaly: {anomaly}; {reason}",
                **states,
                reason=self.reason,
            )
        else:
            text = Sentence("log.odometry", "imu: {imu}; anomaly: {anomaly}", **states)
        return LogLine(level, "odometry", text)


class OdometryReset(Record, frozen=True):
    """A client declared the robot's pose: the pose ``before`` in ``odom`` is now ``after``. Nothing moved."""

    drawn_as: ClassVar[str] = "odometry_reset"

    stamp_s: float
    before: Pose2D
    after: Pose2D


class RangeStatus(StrEnum):
    """The meaning of a range reading; only ``OK`` has a distance. ``AMBIGUOUS``: it may be near or far."""

    OK = "ok"
    TOO_NEAR = "too_near"
    TOO_FAR = "too_far"
    NO_ECHO = "no_echo"
    AMBIGUOUS = "ambiguous"


class RangeMeasured(Record, frozen=True):
    """One beam: ``range_m`` is None unless ``status`` is ``OK``; the field of view is the cone's full angle."""

    stamp_s: float
    arrival_s: float
    sensor: str
    status: RangeStatus
    range_m: float | None
    min_range_m: float
    max_range_m: float
    field_of_view_rad: float


class ImuData(Record, frozen=True):
    """The IMU; what this variant does not measure is null."""

    orientation: Annotated[
        tuple[float, float, float, float] | None, Meta(description="unit quaternion x, y, z, w")
    ] = None
    heading_rad: float | None = None
    angular_velocity_rad_s: tuple[float, float, float] | None = None
    linear_acceleration_m_s2: tuple[float, float, float] | None = None


class ImuMeasured(ImuData, frozen=True, kw_only=True):
    """The IMU's values, and their times."""

    stamp_s: float
    arrival_s: float


class BatteryLevelStatus(StrEnum):
    """How urgent the battery is."""

    OK = "ok"
    LOW = "low"
    CRITICAL = "critical"


class BatteryData(Record, frozen=True):
    """The battery."""

    voltage_v: float
    percentage: float
    status: BatteryLevelStatus


class BatteryMeasured(BatteryData, frozen=True, kw_only=True):
    """The battery in volts, as a percentage of its useful range, and how urgent that is."""

    stamp_s: float
    arrival_s: float


class SafetyChanged(Record, frozen=True):
    """The gate's state: its mode, why, and whose command is in force (None: nobody's).

    ``fault`` is the stable name of the fault that latched (None: none did). ``limited_by`` says what keeps the command
    from being followed as it was given: ``encoders_stale``, ``no_echo``, ``obstacle:`` and the sensor that sees it, or
    ``silent:`` and the lidar that sees nothing any more. ``latch`` counts the e-stops and faults that have latched,
    ``stop_number`` those and the stops. ``guard_warning`` says that sensors see obstacles while the guard is off
    (empty: they do not, or it is on).
    """

    retained: ClassVar[bool] = True

    stamp_s: float
    mode: str
    reason: str
    source: str | None
    fault: str | None = None
    limited_by: str | None = None
    latch: int = 0
    stop_number: int = 0
    guard_warning: str = ""

    def log_line(self) -> LogLine:
        """The line in the log."""
        text = because(self.mode, self.reason) if self.reason else self.mode
        if self.limited_by:
            text = Sentence("log.limited", "{text} (limited by {by})", text=text, by=self.limited_by)
        if self.fault is not None:
            text = Sentence("log.fault", "{text} [{fault}]", text=text, fault=self.fault)
            return LogLine(Level.ERROR, "safety", text)
        return LogLine(Level.INFO, "safety", text)


class DriveWarned(Record, frozen=True):
    """Wheels do not follow their commands, though nothing stops the robot; ``reason`` is empty once that is over."""

    retained: ClassVar[bool] = True

    stamp_s: float
    reason: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        if self.reason:
            return LogLine(Level.WARNING, "drive", self.reason)
        return LogLine(
            Level.INFO, "drive", Sentence("log.follows_again", "the wheels follow their commands again")
        )


class ClientDisconnected(Record, frozen=True):
    """A client's connection has ended; ``client`` is its number. What the robot did for it alone ends."""

    stamp_s: float
    client: int


class ControlChanged(Record, frozen=True):
    """The control leases: the client's name for each source of commands that a client controls."""

    retained: ClassVar[bool] = True

    stamp_s: float
    holders: dict[str, str]

    def log_line(self) -> LogLine:
        """The line in the log."""
        drivers = ", ".join(f"{source}: {name}" for source, name in self.holders.items())
        return LogLine(Level.INFO, "control", drivers or "nobody has control")


class TruthSimulated(Record, frozen=True):
    """The simulated robot's true pose (``world_from_base``) and twist, and whether it touches a wall.

    ``discs`` are the people and things around it: x, y and radius in metres.
    """

    stamp_s: float
    world_from_base: Pose2D
    twist: Twist2D
    in_contact: bool
    discs: tuple[tuple[float, float, float], ...] = ()


class StatsSampled(Record, frozen=True):
    """Every figure of the registry by its name, sampled once a second."""

    stamp_s: float
    figures: Mapping[str, int | float | Mapping[str, int] | None]


class WorkerData(Record, frozen=True):
    """The state of the worker process; ``reason`` says what it is doing, or why it is not ready."""

    state: Annotated[
        str, Meta(description="stopped, starting, warming, ready, restarting or unavailable")
    ] = "stopped"
    pid: int | None = None
    restarts: int = 0
    rss_mb: Annotated[float | None, Meta(description="resident memory")] = None
    cpu: Annotated[float | None, Meta(description="share of one core in the last second")] = None
    reason: str = ""


class WorkerReported(WorkerData, frozen=True, kw_only=True):
    """The state of the worker, with each change and once a second."""

    retained: ClassVar[bool] = True

    stamp_s: float

    def log_line(self) -> LogLine:
        """The line in the log."""
        return state_line("worker", self.state, self.reason)


class RecordingData(Record, frozen=True):
    """The recorder's state; ``reason`` says why recording has ended or is not possible."""

    state: Annotated[str, Meta(description="idle, recording or failed")] = "idle"
    name: str | None = None
    file: Annotated[str | None, Meta(description="the one being written, or the last one")] = None
    seconds: float = 0.0
    bytes_written: int = 0
    messages: int = 0
    dropped: Annotated[int, Meta(description="events that were dropped since the daemon started")] = 0
    waiting: int = 0
    ring_s: float = 0.0
    ring_bytes: int = 0
    free_bytes: int | None = None
    saved: Annotated[str | None, Meta(description="the file that was last saved from memory")] = None
    reason: str = ""


class RecordingChanged(RecordingData, frozen=True, kw_only=True):
    """The recorder's progress, once a second."""

    stamp_s: float


class EventsDropped(Record, frozen=True):
    """A gap in the recording: this many events were dropped just before; ``reason`` is for people."""

    stamp_s: float
    count: int
    reason: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(
            Level.ERROR,
            "recording",
            Sentence(
                "log.events_missing",
                "{count} events are missing: {reason}",
                count=self.count,
                reason=self.reason,
            ),
        )


class MapPoseUpdated(Record, frozen=True):
    """The robot's pose in the map at ``stamp_s``, its covariance, and how well the scan fitted (0 to 1).

    ``map_from_odom`` holds until the next event: with it, odometry gives the present pose in the map. ``state`` is
    mapping, wheel_slip (the odometry was wrong just now), uncertain (scans do not fit, the pose follows odometry), lost,
    or searching (lost, and looking for a known place); ``searched`` is the finished share of that search. ``map`` is the
    map that the pose is in; None: a new one that is being made. With the state ended, there is no pose in that map any
    more: another one is in use, or none.
    """

    drawn_as: ClassVar[str] = "map_pose"

    stamp_s: float
    map_from_base: Pose2D
    map_from_odom: Pose2D
    covariance: PoseCovariance
    fit: float
    state: str
    searched: float = 0.0
    map: str | None = None


POSE_ENDED = "ended"
"""The state of a pose that holds no longer."""
