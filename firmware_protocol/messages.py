"""Every line of the LaunchPad's wire as a value, both directions.

Numbers are exactly what the wire carries: counts, centimetres, ADC readings. Nothing here knows metres or
radians; ``docs/protocol.md`` says what each field means on the robot.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple, TypeAlias, TypeVar

M = TypeVar("M", bound=tuple[Any, ...])


def message(kind: type[M]) -> type[M]:
    """Have messages of this class be true, and equal to messages of the same class alone; tuples are neither.

    A named tuple is made in an eighth of a frozen dataclass's time, both the class and its values.
    """
    for name, method in (("__eq__", _is_equal), ("__ne__", _is_unequal), ("__bool__", _is_true)):
        setattr(kind, name, method)
    return kind


def _is_equal(one: tuple[Any, ...], other: object) -> bool:
    return type(other) is type(one) and tuple.__eq__(one, other)


def _is_unequal(one: tuple[Any, ...], other: object) -> bool:
    return not _is_equal(one, other)


def _is_true(_: tuple[Any, ...]) -> bool:
    return True


@message
class BoardTime(NamedTuple):
    """``t``: a cycle starts; ``micros`` is uint32 µs since boot, ``cycle_s`` the seconds since the last."""

    micros: int
    cycle_s: float


@message
class EncoderCounts(NamedTuple):
    """``e``: accumulated int32 counts per wheel, forward positive, in the order of the variant's wheels."""

    counts: tuple[int, ...]


@message
class UltrasonicDistance(NamedTuple):
    """``u``: whole centimetres, rounded down; 0 means that no echo came back."""

    distance_cm: int


@message
class DutyEcho(NamedTuple):
    """``s`` from the board: the motor command now in force, per wheel, in PWM counts."""

    duty: tuple[float, ...]


@message
class Orientation(NamedTuple):
    """``i`` with four fields: the IMU's quaternion as sent, only roughly of unit length."""

    x: float
    y: float
    z: float
    w: float


@message
class RawImu(NamedTuple):
    """``i`` with six fields: MPU-6050 int16 counts, acceleration then angular rate, each x y z."""

    acceleration: tuple[int, int, int]
    angular_rate: tuple[int, int, int]


@message
class BatteryLevel(NamedTuple):
    """``b``: the raw ADC reading, 0 to 4095 of the published boards' 12 bits, as the wire's float; up to 16 bits."""

    adc: float


@message
class AnalogueLevel(NamedTuple):
    """``a``, an extension: the raw ADC reading of one analogue input, as ``b``."""

    channel: int
    adc: float


@dataclass(frozen=True, slots=True)
class QuadratureEdges:
    """``q``, an extension: a burst of edges of one wheel's encoder, in the order in which they came.

    ``total`` is how many edges this wheel has had since boot (uint16, wraps), up to the last of these and also those
    that were never told. ``states`` are the levels after each edge, A in bit 1 and B in bit 0. ``micros`` is the last
    edge's time, uint32 µs since boot as in ``t``, and ``gaps_us`` are the times between the last edges, oldest first;
    edges before those have no time of their own. More gaps than lie between the edges raise ``ValueError``.
    """

    wheel: int
    total: int
    states: tuple[int, ...]
    micros: int
    gaps_us: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if len(self.gaps_us) >= max(len(self.states), 1):
            raise ValueError(f"{len(self.states)} edges have no {len(self.gaps_us)} gaps between them")


@message
class QuadratureStill(NamedTuple):
    """``q`` with two fields: this wheel's encoder had no edge since the cycle before; ``total`` as there."""

    wheel: int
    total: int


@message
class Banner(NamedTuple):
    """One line of the board's boot banner: the board has just started, so its counters did too."""

    text: str


@message
class ResetDone(NamedTuple):
    """The board's answer to ``r``: it will pull its reset pin in about a second."""


@message
class Text(NamedTuple):
    """Any other printable line (DMP examples, debug output): to be logged, never an error."""

    text: str


@message
class Firmware(NamedTuple):
    """``firmware``: our firmware names itself; the fields' values are in ``docs/firmware_wire.md``."""

    proto: int
    major: int
    minor: int
    board: int
    capabilities: int
    reset_cause: int


@message
class HelloAnswer(NamedTuple):
    """``hello`` from the board: the checked mode, its dead-man, and its clock when hello number ``of`` came in."""

    proto: int
    deadman_ms: int
    micros: int
    of: int


@message
class BoardAbout(NamedTuple):
    """``about`` from the board: what it counts, and which program it runs.

    The edges of an encoder's period that it counts, the most of them a second, the build, and the counts of a wheel's
    turn that it was given (0: none).
    """

    edges: int
    most_edges_s: int
    build: int
    counts_per_turn: int


@message
class CommandRefused(NamedTuple):
    """``refused``: line number ``of`` changed nothing, for the reason of this number."""

    what: int
    of: int


@message
class SequencedEcho(NamedTuple):
    """``s`` in the checked mode: the duty in force, and the number of the last command that was obeyed."""

    duty: tuple[int, ...]
    of: int


@message
class AgedDistance(NamedTuple):
    """``u`` in the checked mode: as ``UltrasonicDistance``, taken ``age_us`` before the ``t`` of its cycle."""

    distance_cm: int
    age_us: int


@message
class AgedImu(NamedTuple):
    """``i`` in the checked mode: as ``RawImu``, taken ``age_us`` before the ``t`` of its cycle."""

    acceleration: tuple[int, int, int]
    angular_rate: tuple[int, int, int]
    age_us: int


@message
class BoardState(NamedTuple):
    """``state``: 1 duty or 2 wheel loop; stops in force (1 dead-man, 2 e-stop, 4 stall); the newest e-stop's number."""

    mode: int
    stops: int
    estop: int
    reset_cause: int


@message
class BoardCounters(NamedTuple):
    """``counters``, uint16, which wrap: what was damaged, refused, lost and late on the board."""

    crc: int
    refused: int
    overrun: int
    gaps: int
    deadman: int
    late: int


@message
class ParameterSet(NamedTuple):
    """``g`` from the board: this parameter has this value now."""

    parameter: int
    value: int


@message
class SetDuty(NamedTuple):
    """``s`` to the board: signed PWM duty per wheel; zero brakes. It stays in force until the next one."""

    duty: tuple[int, ...]


@message
class ResetBoard(NamedTuple):
    """``r``: reset the board; counters restart and the banner is sent again."""


@message
class Hello(NamedTuple):
    """``hello`` to the board: begin the checked mode with this dead-man."""

    proto: int
    deadman_ms: int


@message
class AskAbout(NamedTuple):
    """``about`` to the board: what does it count, and which build is it? Older firmware refuses it (1)."""


@message
class SetWheelSpeeds(NamedTuple):
    """``w``: each wheel's speed in mrad/s, for the board's own wheel loop."""

    speed_mrad_s: tuple[int, ...]


@message
class SetParameter(NamedTuple):
    """``g`` to the board: give this parameter this value."""

    parameter: int
    value: int


@message
class Arm(NamedTuple):
    """``arm``: end the e-stop of this number, and a stall."""

    number: int


@message
class EmergencyStop(NamedTuple):
    """``estop``: stop until ``arm``; obeyed without a checksum, as the stop is."""


class Reason(StrEnum):
    """Why a line was refused; the stable names under which refusals are counted."""

    OVERLONG = "overlong"
    NOT_ASCII = "not_ascii"
    FIELD_COUNT = "field_count"
    NOT_A_NUMBER = "not_a_number"
    OUT_OF_RANGE = "out_of_range"
    NOT_UNIT = "not_unit"
    UNKNOWN = "unknown"
    CHECKSUM = "checksum"


@message
class Malformed(NamedTuple):
    """A line that is not a message: the reason, the bytes as read (bounded), and what was expected."""

    reason: Reason
    line: bytes
    detail: str


FromBoard: TypeAlias = (
    BoardTime
    | EncoderCounts
    | UltrasonicDistance
    | DutyEcho
    | Orientation
    | RawImu
    | BatteryLevel
    | AnalogueLevel
    | QuadratureEdges
    | QuadratureStill
    | Banner
    | ResetDone
    | Text
    | Firmware
    | HelloAnswer
    | BoardAbout
    | CommandRefused
    | SequencedEcho
    | AgedDistance
    | AgedImu
    | BoardState
    | BoardCounters
    | ParameterSet
)
ToBoard: TypeAlias = (
    SetDuty | ResetBoard | Hello | AskAbout | SetWheelSpeeds | SetParameter | Arm | EmergencyStop
)
Message: TypeAlias = FromBoard | ToBoard
