"""Every shape of line has a reader that agrees with the grammar."""

from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_protocol.codec import CLASSIC, FROM_BOARD, KHAN, KHAN_EDGES, Variant, from_board
from firmware_protocol.line_codec import LineCodec
from firmware_protocol.lines import COMPONENT, INT16, Field, LineKind, Number
from firmware_protocol.messages import (
    AnalogueLevel,
    BatteryLevel,
    BoardTime,
    DutyEcho,
    EncoderCounts,
    Malformed,
    Message,
    QuadratureEdges,
    QuadratureStill,
    Reason,
    UltrasonicDistance,
)
from tests.budget import examples

TENTHS = Number(-10, 10, decimals=1)


@dataclass(frozen=True, slots=True)
class One:
    """A single number."""

    a: int


@dataclass(frozen=True, slots=True)
class OneInTuple:
    """A tuple of a single number."""

    a: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Two:
    """Two fields of a number each."""

    a: int
    b: float


@dataclass(frozen=True, slots=True)
class TwoInTuple:
    """One field of two numbers."""

    ab: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Mixed:
    """Numbers and a tuple."""

    a: int
    bc: tuple[float, ...]
    d: int


@dataclass(frozen=True, slots=True)
class UnitVector:
    """A vector of norm 1 in the plane."""

    x: float
    y: float


@dataclass(frozen=True, slots=True)
class Quaternion:
    """A vector of norm 1 in four dimensions."""

    x: float
    y: float
    z: float
    w: float


@dataclass(frozen=True)
class Slotless:
    """A message that keeps its fields in a dictionary."""

    a: int


@dataclass(frozen=True, slots=True)
class Checked:
    """A message that refuses some values itself."""

    a: int

    def __post_init__(self) -> None:
        """Odd numbers only."""
        if self.a % 2 == 0:
            raise ValueError(f"expected an odd number, got {self.a}")


SHAPES = [
    (LineKind("k", One, (Field("a", INT16),)), One(1)),
    (LineKind("k", Slotless, (Field("a", INT16),)), Slotless(1)),
    (LineKind("k", OneInTuple, (Field("a", INT16, 1),)), OneInTuple((1,))),
    (LineKind("k", Two, (Field("a", INT16), Field("b", TENTHS))), Two(1, 2.5)),
    (LineKind("k", TwoInTuple, (Field("ab", TENTHS, 2),)), TwoInTuple((1.5, -2.5))),
    (
        LineKind("k", Mixed, (Field("a", INT16), Field("bc", TENTHS, 2), Field("d", INT16))),
        Mixed(1, (2.5, -3.5), 4),
    ),
    (
        LineKind("k", UnitVector, (Field("x", COMPONENT), Field("y", COMPONENT)), unit=True),
        UnitVector(0.6, -0.8),
    ),
    (
        LineKind("k", Quaternion, tuple(Field(n, COMPONENT) for n in "xyzw"), unit=True),
        Quaternion(0.5, 0.5, -0.5, 0.5),
    ),
]
shapes = pytest.mark.parametrize(("row", "message"), SHAPES, ids=[row.message.__name__ for row, _ in SHAPES])


@shapes
def test_each_shape_of_message_survives_its_line(row: LineKind, message: object) -> None:
    """One number, two, a unit vector or any mix: the reader rebuilds the fields as they were."""
    codec = LineCodec(FROM_BOARD, [row])
    line = codec.encode(message).removesuffix(b"\n")  # type: ignore[arg-type]
    assert codec.decode(line) == message


@shapes
def test_each_shape_refuses_digits_before_its_kind(row: LineKind, message: object) -> None:
    """The tail of a cut line glued before a good one is not taken for the good one."""
    codec = LineCodec(FROM_BOARD, [row])
    line = b"12" + codec.encode(message).removesuffix(b"\n")  # type: ignore[arg-type]
    assert codec.decode(line) == Malformed(Reason.UNKNOWN, line, "expected one of k")


@shapes
def test_each_shape_refuses_a_number_out_of_its_range(row: LineKind, message: object) -> None:
    """The last number is too large for every type here; unit vectors say so in their own way."""
    codec = LineCodec(FROM_BOARD, [row])
    start, _, _ = codec.encode(message).rpartition(b"\t")  # type: ignore[arg-type]
    meaning = codec.decode(start + b"\t32768")
    assert isinstance(meaning, Malformed)
    assert meaning.reason is (Reason.NOT_UNIT if row.unit else Reason.OUT_OF_RANGE)


def test_a_message_may_refuse_numbers_itself() -> None:
    """A check in the message's own constructor is run, and its refusal is a value like any other."""
    codec: Any = LineCodec(FROM_BOARD, [LineKind("k", Checked, (Field("a", INT16),))])
    assert codec.decode(b"k\t3") == Checked(3)
    refusal = Malformed(Reason.OUT_OF_RANGE, b"k\t4", "Checked refuses these numbers itself")
    assert codec.decode(b"k\t4") == refusal


@shapes
@given(data=st.data())
@settings(max_examples=examples(100))
def test_a_reader_refuses_exactly_what_the_grammar_refuses(
    row: LineKind, message: object, data: st.DataObject
) -> None:
    """The fast path and the explanation never disagree about a line."""
    codec = LineCodec(FROM_BOARD, [row])
    text = st.text("0123456789.-", min_size=0, max_size=6).map(str.encode)
    texts = data.draw(st.lists(text, min_size=len(row.numbers), max_size=len(row.numbers)))
    fits = all(number.explain(each) is None for number, each in zip(row.numbers, texts, strict=True))
    norm_fits = fits and (not row.unit or 0.81 <= sum(float(each) ** 2 for each in texts) <= 1.21)
    assert isinstance(codec.decode(b"\t".join([b"k", *texts])), row.message if norm_fits else Malformed)


AT_THE_LIMITS: list[tuple[bytes, Message]] = [
    (b"u\t0", UltrasonicDistance(0)),
    (b"u\t32767", UltrasonicDistance(32767)),
    (b"b\t0.00", BatteryLevel(0.0)),
    (b"b\t4095.00", BatteryLevel(4095.0)),
    (b"b\t65535.00", BatteryLevel(65535.0)),
    (b"t\t0\t0.00", BoardTime(0, 0.0)),
    (b"t\t4294967295\t4295.00", BoardTime(4294967295, 4295.0)),
    (b"e\t-2147483648\t2147483647", EncoderCounts((-2147483648, 2147483647))),
    (b"e\t2147483647\t-2147483648", EncoderCounts((2147483647, -2147483648))),
    (b"s\t-32768.00\t32767.00", DutyEcho((-32768.0, 32767.0))),
    (b"s\t32767.00\t-32768.00", DutyEcho((32767.0, -32768.0))),
]


@pytest.mark.parametrize(("line", "message"), AT_THE_LIMITS, ids=[line.decode() for line, _ in AT_THE_LIMITS])
def test_the_limits_of_each_number_are_within_it(line: bytes, message: Message):
    """The least and the greatest that the wire can carry are read, on each side."""
    assert from_board(CLASSIC).decode(line) == message


@pytest.mark.parametrize("line", [b"u\t32768", b"b\t65535.01", b"t\t4294967296\t0.02", b"t\t1\t4295.01"])
def test_what_is_beyond_its_limit_is_refused(line: bytes):
    """By one, or by a hundredth."""
    refused = from_board(CLASSIC).decode(line)
    assert isinstance(refused, Malformed)
    assert refused.reason is Reason.OUT_OF_RANGE


def test_the_channels_and_wheels_of_the_variants():
    """Sixteen analogue inputs; four wheels of edges, a line of which is refused for any number in it that is wrong."""
    khan, edges = from_board(KHAN), from_board(KHAN_EDGES)
    assert khan.decode(b"a\t15\t4095.00") == AnalogueLevel(15, 4095.0)
    assert isinstance(khan.decode(b"a\t16\t1.00"), Malformed)
    assert edges.decode(b"q\t3\t65535") == QuadratureStill(3, 65535)
    assert isinstance(edges.decode(b"q\t3\t7\t8\t1010000\t500"), QuadratureEdges)
    for line in (b"q\t4\t7", b"q\t4\t7\t8\t1010000\t500", b"q\t3\t65536\t8\t1010000\t500"):
        assert isinstance(edges.decode(line), Malformed)


def test_a_robot_has_a_wheel_at_least_and_two_unless_told_otherwise():
    """One is enough, none is not."""
    assert Variant("plain").wheels == 2
    assert Variant("unicycle", wheels=1).wheels == 1
    with pytest.raises(ValueError, match="at least one wheel, got 0"):
        Variant("none", wheels=0)
