"""The tables of the wire: one per direction, made from a robot's variant.

The daemon decodes ``from_board`` and encodes ``to_board``; the simulated board does it the other way round
with the same tables. Another robot is another ``Variant``: another number of wheels, more rows.
"""

from dataclasses import dataclass, replace
from typing import Any

from firmware_protocol.line_codec import RESET_DONE, Framing, LineCodec
from firmware_protocol.lines import (
    ADC,
    CENTIMETRES,
    COMPONENT,
    CYCLE_SECONDS,
    DUTY,
    INT16,
    INT32,
    UINT16,
    UINT32,
    Field,
    LineKind,
    Number,
    PackedLevels,
)
from firmware_protocol.messages import (
    AnalogueLevel,
    Banner,
    BatteryLevel,
    BoardTime,
    DutyEcho,
    EncoderCounts,
    Message,
    Orientation,
    QuadratureEdges,
    QuadratureStill,
    RawImu,
    ResetBoard,
    ResetDone,
    SetDuty,
    UltrasonicDistance,
)

PUBLISHED_BANNER = (
    "Initializing I2C devices...",
    "Testing device connections...",
    "MPU6050 connection successful",
)
PUBLISHED_FAILURES = ("MPU6050 connection failed",)

FROM_BOARD = Framing(b"\t", b"\n", replaced=(b"\r\n", b"\n"), max_line=256)
TEXT_END = b"\r\n"
TO_BOARD = Framing(b" ", b"\r", replaced=(b"\n", b""), max_line=64)  # the size of the sketch's buffer


@dataclass(frozen=True, slots=True)
class Variant:
    """What tells one robot's wire from another's: its wheels, its boot banner, line kinds of its own.

    ``banner`` is what its board prints as it starts when all is well, and ``failed_banner`` what may stand in a line's
    place. ``excluded`` are the classic messages that its board never sends: on its wire such a line is text.
    """

    name: str
    wheels: int = 2
    banner: tuple[str, ...] = PUBLISHED_BANNER
    failed_banner: tuple[str, ...] = PUBLISHED_FAILURES
    excluded: tuple[type[Any], ...] = ()
    extra_from_board: tuple[LineKind, ...] = ()
    extra_to_board: tuple[LineKind, ...] = ()

    def __post_init__(self) -> None:
        if self.wheels < 1:
            raise ValueError(f"a robot has at least one wheel, got {self.wheels}")
        longest = len(TO_BOARD.separator.join([b"s", *[str(INT16.low).encode()] * self.wheels]))
        if longest > TO_BOARD.max_line:
            raise ValueError(
                f"the longest 's' line of {self.wheels} wheels is {longest} bytes, the board's buffer holds "
                f"{TO_BOARD.max_line}"
            )

    def speaks(self, message: type[Any]) -> bool:
        """Whether the board has a line kind for this message."""
        return any(row.message is message for row in rows_from_board(self))


MOST_EDGES_A_LINE = 384
MOST_TIMES_A_LINE = 4
"""The last edges' times: one of each of the four transitions, so that every one can be held against its like."""

ANALOGUE_INPUTS = 16

ANALOGUE = LineKind("a", AnalogueLevel, (Field("channel", Number(0, ANALOGUE_INPUTS - 1)), Field("adc", ADC)))


def quadrature(wheels: int) -> tuple[LineKind, ...]:
    """The rows of ``q`` for so many wheels: without edges, and one for each number of gaps that a line can hold."""
    wheel = Field("wheel", Number(0, wheels - 1)), Field("total", UINT16)
    edges = Field("states", PackedLevels(MOST_EDGES_A_LINE)), Field("micros", UINT32)
    timed = [Field("gaps_us", UINT32, gaps) for gaps in range(MOST_TIMES_A_LINE)]
    return (
        LineKind("q", QuadratureStill, wheel),
        *(LineKind("q", QuadratureEdges, (*wheel, *edges, gaps)) for gaps in timed),
    )


CLASSIC = Variant("classic", wheels=2)
FOUR_WHEELS = Variant("four_wheels", wheels=4)
KHAN = Variant("khan", wheels=4, extra_from_board=(ANALOGUE,))
KHAN_EDGES = Variant(
    "khan_edges", wheels=4, excluded=(EncoderCounts,), extra_from_board=(ANALOGUE, *quadrature(4))
)
VARIANTS = {variant.name: variant for variant in (CLASSIC, FOUR_WHEELS, KHAN, KHAN_EDGES)}


def from_board(variant: Variant) -> LineCodec:
    """What the board says: frames, its banner, and any other text."""
    return LineCodec(FROM_BOARD, rows_from_board(variant), phrases(variant), text_end=TEXT_END)


def phrases(variant: Variant) -> dict[str, Message]:
    """The board's lines of text that mean something."""
    banner = {text: Banner(text) for text in (*variant.banner, *variant.failed_banner)}
    return {**banner, RESET_DONE: ResetDone()}


def rows_from_board(variant: Variant) -> tuple[LineKind, ...]:
    """The board's kinds of lines."""
    classic = (
        LineKind("t", BoardTime, (Field("micros", _lenient(UINT32)), Field("cycle_s", CYCLE_SECONDS))),
        LineKind("e", EncoderCounts, (Field("counts", _lenient(INT32), variant.wheels),)),
        LineKind("u", UltrasonicDistance, (Field("distance_cm", _lenient(CENTIMETRES)),)),
        LineKind("s", DutyEcho, (Field("duty", DUTY, variant.wheels),)),
        LineKind("i", Orientation, tuple(Field(axis, COMPONENT) for axis in "xyzw"), unit=True),
        LineKind(
            "i", RawImu, (Field("acceleration", INT16, 3), Field("angular_rate", INT16, 3)), end=b"\r\n\n"
        ),
        LineKind("b", BatteryLevel, (Field("adc", ADC),)),
    )
    return (*(row for row in classic if row.message not in variant.excluded), *variant.extra_from_board)


def _lenient(number: Number) -> Number:
    return replace(number, lenient=True)


def to_board(variant: Variant) -> LineCodec:
    """What the board understands: motor commands and the reset."""
    rows = (
        LineKind("s", SetDuty, (Field("duty", INT16, variant.wheels),)),
        LineKind("r", ResetBoard),
    )
    return LineCodec(TO_BOARD, (*rows, *variant.extra_to_board))
