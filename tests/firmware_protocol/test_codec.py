"""The tables of both directions, line by line."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_protocol import messages
from firmware_protocol.codec import (
    CLASSIC,
    FOUR_WHEELS,
    FROM_BOARD,
    KHAN,
    KHAN_EDGES,
    MOST_EDGES_A_LINE,
    MOST_TIMES_A_LINE,
    PUBLISHED_BANNER,
    VARIANTS,
    Variant,
    from_board,
    to_board,
)
from firmware_protocol.line_codec import LineCodec
from firmware_protocol.lines import INT16, Field, LineKind, Number
from firmware_protocol.messages import (
    AnalogueLevel,
    Banner,
    BatteryLevel,
    BoardTime,
    DutyEcho,
    EncoderCounts,
    Malformed,
    Orientation,
    QuadratureEdges,
    RawImu,
    Reason,
    ResetBoard,
    ResetDone,
    SetDuty,
    Text,
    UltrasonicDistance,
)
from tests.budget import examples

VECTORS = Path(__file__).parent.parent / "vectors"
BOARD = from_board(CLASSIC)
HOST = to_board(CLASSIC)
CODECS = {
    "from_board": BOARD,
    "to_board": HOST,
    "from_khan": from_board(KHAN),
    "from_khan_edges": from_board(KHAN_EDGES),
    "to_khan": to_board(KHAN_EDGES),
}


def golden(direction: str) -> list[Any]:
    """A test parameter for each pair of a vector file."""
    pairs = json.loads((VECTORS / f"{direction}.json").read_text())
    return [pytest.param(CODECS[direction], pair, id=f"{direction} {pair['line']!r}") for pair in pairs]


GOLDEN = [pair for direction in CODECS for pair in golden(direction)]


@pytest.mark.parametrize(("codec", "pair"), GOLDEN)
def test_every_golden_line_means_what_the_vectors_say(codec: LineCodec, pair: dict[str, Any]) -> None:
    """A line of the published wire decodes to its message, or is refused for the stated reason."""
    line = pair["line"].encode("latin-1")
    meaning = codec.decode(line)
    if isinstance(meaning, Malformed):
        assert (meaning.reason, meaning.line) == (pair["refused"], line)
        assert meaning.detail
    else:
        fields = json.loads(json.dumps({name: getattr(meaning, name) for name in meaning.__match_args__}))
        assert (type(meaning).__name__, fields) == (pair["means"], pair["fields"])


@pytest.mark.parametrize(("codec", "pair"), GOLDEN)
def test_every_canonical_golden_line_is_encoded_to_its_very_bytes(
    codec: LineCodec, pair: dict[str, Any]
) -> None:
    """A message whose vector states a line end encodes to exactly that line and end."""
    if "end" in pair:
        line = pair["line"].encode()
        message = codec.decode(line)
        assert not isinstance(message, Malformed)
        assert codec.encode(message) == line + pair["end"].encode()


def hundredths(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers that two decimals hold exactly."""
    return st.integers(math.ceil(low * 100), math.floor(high * 100)).map(lambda n: n / 100)


def rounded_unit_quaternions() -> st.SearchStrategy[Orientation]:
    """Unit quaternions as the wire rounds them."""
    angles = st.floats(0, math.tau)

    def quaternion(a: float, b: float, c: float) -> Orientation:
        x, y = math.sin(a) * math.sin(b), math.sin(a) * math.cos(b)
        z, w = math.cos(a) * math.sin(c), math.cos(a) * math.cos(c)
        return Orientation(round(x, 2), round(y, 2), round(z, 2), round(w, 2))

    return st.builds(quaternion, angles, angles, angles)


INT16S = st.integers(-(2**15), 2**15 - 1)
INT32S = st.integers(-(2**31), 2**31 - 1)
FROM_BOARD_MESSAGES = st.one_of(
    st.builds(BoardTime, st.integers(0, 2**32 - 1), hundredths(0, 4295)),
    st.builds(EncoderCounts, st.tuples(INT32S, INT32S)),
    st.builds(UltrasonicDistance, st.integers(0, 2**15 - 1)),
    st.builds(DutyEcho, st.tuples(hundredths(-32768, 32767), hundredths(-32768, 32767))),
    rounded_unit_quaternions(),
    st.builds(RawImu, st.tuples(INT16S, INT16S, INT16S), st.tuples(INT16S, INT16S, INT16S)),
    st.builds(BatteryLevel, hundredths(0, 65535)),
    st.builds(Banner, st.sampled_from(PUBLISHED_BANNER)),
    st.just(ResetDone()),
    st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=250).map(
        lambda t: Text(f"> {t}")
    ),
)
TO_BOARD_MESSAGES = st.one_of(st.builds(SetDuty, st.tuples(INT16S, INT16S)), st.just(ResetBoard()))


@given(FROM_BOARD_MESSAGES)
@settings(max_examples=examples(200))
def test_what_the_board_encodes_the_daemon_decodes(message: messages.FromBoard) -> None:
    """Every message from the board survives its line."""
    assert BOARD.decode(BOARD.encode(message).rstrip(b"\r\n")) == message


@given(TO_BOARD_MESSAGES)
@settings(max_examples=examples(50))
def test_what_the_daemon_encodes_the_board_decodes(message: messages.ToBoard) -> None:
    """Every command survives its line."""
    assert HOST.decode(HOST.encode(message).removesuffix(b"\r")) == message


@given(st.one_of(st.binary(max_size=80), st.text("tesuib-.0123456789\t ", max_size=30).map(str.encode)))
@settings(max_examples=examples(300))
def test_no_line_makes_a_codec_raise(line: bytes) -> None:
    """Whatever the bytes, decoding gives a value; a refusal carries the very bytes."""
    for codec in (BOARD, HOST):
        meaning = codec.decode(line)
        assert not isinstance(meaning, Malformed) or meaning.line == line


@pytest.mark.parametrize("line", [b"e\t" + b"0" * 5000 + b"\t1", b"s\t" + b"9" * 5000 + b"\t1"])
def test_absurdly_long_numbers_are_refused(line: bytes) -> None:
    """Digits beyond what Python itself converts are no number, not an exception."""
    meaning = BOARD.decode(line)
    assert isinstance(meaning, Malformed)
    assert meaning.reason is Reason.NOT_A_NUMBER


def test_a_refusal_says_what_was_expected() -> None:
    """The detail names the range and the text that missed it."""
    meaning = BOARD.decode(b"u\t40000")
    assert isinstance(meaning, Malformed)
    assert meaning.detail == "expected a whole number from 0 to 32767, got 40000"


def test_a_quaternion_off_its_norm_says_which_norm_it_has() -> None:
    """sqrt(0.6^2 + 0.8^2 + 0.6^2 + 0.8^2) = sqrt(2) = 1.414 is named beside the limits."""
    meaning = BOARD.decode(b"i\t0.60\t0.80\t0.60\t0.80")
    assert isinstance(meaning, Malformed)
    assert meaning.detail == "expected a norm from 0.9 to 1.1, got 1.414"


@pytest.mark.parametrize(
    ("codec", "message", "complaint"),
    [
        (HOST, SetDuty((40000, 0)), "duty: expected a whole number from -32768 to 32767, got 40000"),
        (HOST, SetDuty((0, 0, 0, 0)), "duty: expected 2 numbers, got"),
        (BOARD, EncoderCounts((2**31, 0)), "counts: expected .* to 2147483647, got 2147483648"),
        (BOARD, BatteryLevel(65535.5), "adc: expected a number from 0 to 65535, got 65535.5"),
        (BOARD, BatteryLevel(math.nan), "adc: expected .*, got nan"),
        (BOARD, DutyEcho((math.inf, 0.0)), "duty: expected .*, got inf"),
        (BOARD, Orientation(math.inf, 0.0, 0.0, 0.0), "Orientation: expected a norm from 0.9 to 1.1"),
        (BOARD, Orientation(0.0, 0.0, 0.0, 0.0), "Orientation: expected a norm from 0.9 to 1.1"),
        (BOARD, Banner("Hello"), "would not be read as Banner"),
        (BOARD, Text(""), "would not be read as Text"),
        (BOARD, Text("e\t1\t2"), "would not be read as Text"),
        (BOARD, Text("two\nlines"), "would not be read as Text"),
        (BOARD, Text("Grüße"), "would not be read as Text"),
        (BOARD, Text("x" * 257), "a line holds 256 bytes, got 257"),
    ],
)
def test_what_the_wire_cannot_carry_is_not_encoded(
    codec: LineCodec, message: messages.Message, complaint: str
) -> None:
    """A value that the far end would refuse or misread raises, naming value and range."""
    with pytest.raises(ValueError, match=complaint):
        codec.encode(message)


@pytest.mark.parametrize(
    ("codec", "message"), [(HOST, Text("hi")), (HOST, ResetDone()), (BOARD, SetDuty((0, 0)))]
)
def test_a_message_of_the_other_direction_is_not_encoded(codec: LineCodec, message: messages.Message) -> None:
    """Each direction speaks its own messages only."""
    with pytest.raises(TypeError, match=type(message).__name__):
        codec.encode(message)


def test_four_wheels_are_the_same_lines_with_four_numbers() -> None:
    """KHAN's ``e`` and ``s`` carry four numbers each way, and two are too few."""
    codec, commands = from_board(FOUR_WHEELS), to_board(FOUR_WHEELS)
    assert codec.decode(b"e\t1\t-2\t3\t-4") == EncoderCounts((1, -2, 3, -4))
    assert codec.encode(DutyEcho((1.0, 2.0, -3.0, 4.5))) == b"s\t1.00\t2.00\t-3.00\t4.50\n"
    assert commands.encode(SetDuty((1, 2, 3, 4))) == b"s 1 2 3 4\r"
    assert commands.decode(b"s 1 2 3 4") == SetDuty((1, 2, 3, 4))
    assert isinstance(codec.decode(b"e\t1\t2"), Malformed)
    assert isinstance(codec.decode(b"e\t1\t2\t3\t4294967296"), Malformed)
    assert codec.decode(b"1e\t1\t2\t3\t4") == Text("1e\t1\t2\t3\t4")


def bursts() -> st.SearchStrategy[QuadratureEdges]:
    """Bursts of every length that a line holds, with as many times."""

    def burst(draw: Any, edges: int) -> QuadratureEdges:
        levels = st.lists(st.integers(0, 3), min_size=edges, max_size=edges)
        gaps = st.lists(st.integers(0, 2**32 - 1), max_size=min(edges, MOST_TIMES_A_LINE) - 1)
        wheel, total, micros = st.integers(0, 3), st.integers(0, 2**16 - 1), st.integers(0, 2**32 - 1)
        return QuadratureEdges(draw(wheel), draw(total), tuple(draw(levels)), draw(micros), tuple(draw(gaps)))

    return st.composite(lambda draw: burst(draw, draw(st.integers(1, MOST_EDGES_A_LINE))))()


@given(bursts())
@settings(max_examples=examples(100))
def test_a_burst_of_edges_survives_its_line_at_any_length(message: QuadratureEdges) -> None:
    """One to 384 edges, one to four times: the row is found by their number when writing as when reading."""
    codec = CODECS["from_khan_edges"]
    assert codec.decode(codec.encode(message).removesuffix(b"\n")) == message


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (QuadratureEdges(0, 0, (), 0), "states: expected 1 to 384 levels from 0 to 3, packed, got"),
        (QuadratureEdges(0, 0, (0,) * 385, 0), "states: expected 1 to 384 levels"),
        (QuadratureEdges(0, 0, (0, 4), 0), r"states: expected 1 to 384 levels .*got \(0, 4\)"),
        (QuadratureEdges(0, 0, (0,) * 9, 0, (1,) * 4), "no line holds as many numbers as .*states="),
        (QuadratureEdges(4, 0, (0,), 0), "wheel: expected a whole number from 0 to 3, got 4"),
        (QuadratureEdges(0, -1, (0,), 0), "total: expected a whole number from 0 to 65535, got -1"),
        (AnalogueLevel(16, 0.0), "channel: expected a whole number from 0 to 15, got 16"),
    ],
)
def test_a_burst_that_no_line_holds_is_not_encoded(message: messages.FromBoard, complaint: str) -> None:
    """None, too many, too many times, a wheel or an input that the robot does not have."""
    with pytest.raises(ValueError, match=complaint):
        CODECS["from_khan_edges"].encode(message)


def test_more_gaps_than_lie_between_its_edges_are_no_burst() -> None:
    """Two edges have one gap: with two the message cannot be made."""
    with pytest.raises(ValueError, match="2 edges have no 2 gaps between them"):
        QuadratureEdges(0, 2, (0, 2), 100, (5, 5))


def test_a_refused_burst_says_what_its_levels_should_be() -> None:
    """The detail names what was expected, and what stood there or how many."""
    codec = CODECS["from_khan_edges"]
    garbled, overfull = codec.decode(b"q\t0\t1\t~\t100"), codec.decode(b"q\t0\t1\t" + b"=" * 129 + b"\t100")
    assert isinstance(garbled, Malformed)
    assert isinstance(overfull, Malformed)
    assert garbled.detail == "expected 1 to 384 levels from 0 to 3, packed, got '~'"
    assert overfull == Malformed(
        Reason.OUT_OF_RANGE, overfull.line, "expected 1 to 384 levels from 0 to 3, packed, got 387"
    )


@pytest.mark.parametrize("line", [b"a\t0\t2048.00", b"q\t0\t1\t+\t1000"])
def test_the_classic_robot_never_meets_the_extensions(line: bytes) -> None:
    """Its own wire takes such lines for text, and has no way to write them."""
    assert BOARD.decode(line) == Text(line.decode())
    message = CODECS["from_khan_edges"].decode(line)
    assert not isinstance(message, Malformed | Text)
    with pytest.raises(TypeError, match="no line kind for"):
        BOARD.encode(message)


def test_a_variant_says_what_it_speaks() -> None:
    """KHAN's boards have an analogue line; the one that decodes nothing itself sends edges, and no counts."""
    of_interest = (UltrasonicDistance, AnalogueLevel, EncoderCounts, QuadratureEdges)
    assert [CLASSIC.speaks(message) for message in of_interest] == [True, False, True, False]
    assert [KHAN.speaks(message) for message in of_interest] == [True, True, True, False]
    assert [KHAN_EDGES.speaks(message) for message in of_interest] == [True, True, False, True]
    assert {name: variant.wheels for name, variant in VARIANTS.items()} == {
        "classic": 2,
        "four_wheels": 4,
        "khan": 4,
        "khan_edges": 4,
    }


@dataclass(frozen=True, slots=True)
class LampVoltage:
    """A message that no robot here has."""

    volts: float


@dataclass(frozen=True, slots=True)
class Blink:
    """A command that the classic robot does not have: a lamp, and for how long on and off."""

    lamp: int
    on_off_ms: tuple[int, int]


PROTOTYPE = Variant(
    "prototype",
    wheels=4,
    banner=("Prototype ready",),
    extra_from_board=(LineKind("v", LampVoltage, (Field("volts", Number(0, 5, decimals=3)),)),),
    extra_to_board=(LineKind("blink", Blink, (Field("lamp", INT16), Field("on_off_ms", INT16, 2))),),
)


def test_another_robot_is_another_table() -> None:
    """Kinds added as rows are read, written, range-checked and refused like the classic ones."""
    codec: Any = from_board(PROTOTYPE)
    commands: Any = to_board(PROTOTYPE)
    assert codec.decode(b"v\t2.705") == LampVoltage(2.705)
    assert codec.encode(LampVoltage(0.4)) == b"v\t0.400\n"
    assert codec.decode(b"v\t5.001") == Malformed(
        Reason.OUT_OF_RANGE, b"v\t5.001", "expected a number from 0 to 5, got 5.001"
    )
    assert commands.decode(b"blink 3 500 250") == Blink(3, (500, 250))
    assert commands.encode(Blink(3, (500, 250))) == b"blink 3 500 250\r"
    assert BOARD.decode(b"v\t2.705") == Text("v\t2.705")


def test_another_robot_has_a_banner_of_its_own() -> None:
    """The banner is data too: the classic one is mere text to a robot that does not print it."""
    codec = from_board(PROTOTYPE)
    assert codec.decode(b"Prototype ready") == Banner("Prototype ready")
    assert codec.decode(PUBLISHED_BANNER[0].encode()) == Text(PUBLISHED_BANNER[0])


@pytest.mark.parametrize(
    ("rows", "complaint"),
    [
        ((LineKind("a1", LampVoltage),), "made of letters, got 'a1'"),
        ((LineKind("", LampVoltage),), "made of letters, got ''"),
        ((LineKind("a", LampVoltage), LineKind("a", Blink)), "two line kinds 'a' with 0 numbers"),
        ((LineKind("a", LampVoltage), LineKind("b", LampVoltage)), "two line kinds for LampVoltage"),
    ],
)
def test_rows_that_cannot_be_told_apart_are_refused(rows: tuple[LineKind, ...], complaint: str) -> None:
    """A table that would be ambiguous on the wire cannot be made."""
    with pytest.raises(ValueError, match=complaint):
        LineCodec(FROM_BOARD, rows)


def test_a_robot_without_wheels_has_no_wire() -> None:
    """The variant is checked when it is made."""
    with pytest.raises(ValueError, match="at least one wheel, got 0"):
        Variant("sled", wheels=0)


def test_more_wheels_than_a_line_to_the_board_holds_are_refused() -> None:
    """Nine wheels at the end of int16 are 1 + 9 * 7 = 64 bytes, the sketch's buffer; ten are 71 and have no wire."""
    widest = to_board(Variant("sled", wheels=9)).encode(SetDuty((-32768,) * 9))
    assert len(widest) == 64 + 1
    told = "longest 's' line of 10 wheels is 71 bytes, the board's buffer holds 64"
    with pytest.raises(ValueError, match=told):
        Variant("sled", wheels=10)
