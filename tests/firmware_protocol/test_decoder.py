"""Bytes to lines, however they are cut."""

import tracemalloc
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_protocol.codec import CLASSIC, from_board, to_board
from firmware_protocol.decoder import Decoded, Decoder
from firmware_protocol.messages import (
    Banner,
    EncoderCounts,
    Malformed,
    RawImu,
    Reason,
    ResetBoard,
    SetDuty,
    Text,
    UltrasonicDistance,
)
from tests.budget import examples

BOARD = from_board(CLASSIC)
HOST = to_board(CLASSIC)
NOISY = (
    b"23\t456\n"  # the tail of a line that began before the port was opened
    b"t\t1000\t0.02\ne\t1\t2\nu\t50\n\n"
    b"e\t12\xff\x00\t3\n"  # noise
    b"e\t4\tu\t51\n"  # glued
    b"i\t1\t2\t3\t4\t5\t6\r\n\n" + b"#" * 400 + b"\nb\t3000.00\ns\t1.0"  # cut by a reset
    b"Initializing I2C devices...\r\nMPU6050 connection successful\r\nu\t9\n"
)


def decode_in_chunks(data: bytes, cuts: list[int], decoder: Decoder) -> list[Decoded]:
    """What the decoder says when the data arrives cut at these places."""
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    return [pair for start, stop in pairwise(edges) for pair in decoder.feed(data[start:stop])]


def test_a_noisy_capture_yields_its_good_lines_and_says_what_the_others_were() -> None:
    """Cut, noisy, glued and overlong lines are refused one by one, and the next line end begins anew."""
    meanings = [meaning for _, meaning in Decoder(BOARD).feed(NOISY)]
    names = [str(m.reason) if isinstance(m, Malformed) else type(m).__name__ for m in meanings]
    assert names == [
        *(
            "unknown",
            "BoardTime",
            "EncoderCounts",
            "UltrasonicDistance",
            "not_ascii",
            "field_count",
            "RawImu",
        ),
        *("overlong", "BatteryLevel", "field_count", "Banner", "UltrasonicDistance"),
    ]


@given(st.lists(st.integers(0, len(NOISY)), max_size=30))
@settings(max_examples=examples(100))
def test_chunking_never_matters_to_a_noisy_capture(cuts: list[int]) -> None:
    """The capture cut anywhere decodes as the whole does, line by line and in the counters."""
    whole, cut = Decoder(BOARD), Decoder(BOARD)
    assert decode_in_chunks(NOISY, cuts, cut) == whole.feed(NOISY)
    assert (cut.accepted, cut.malformed) == (whole.accepted, whole.malformed)


def test_byte_by_byte_is_the_same_as_whole() -> None:
    """The finest chunking there is."""
    assert decode_in_chunks(NOISY, list(range(len(NOISY))), Decoder(BOARD)) == Decoder(BOARD).feed(NOISY)


@given(
    st.lists(
        st.sampled_from([b"\r", b"\n", b"e\t1\t2", b"s 1 2", b"r", b"xx", b"\x00", b"123456"]), max_size=40
    ),
    st.lists(st.integers(0, 200), max_size=20),
    st.sampled_from([BOARD, HOST]),
)
@settings(max_examples=examples(300))
def test_chunking_never_matters_to_arbitrary_line_ends_and_overlong_lines(
    pieces: list[bytes], cuts: list[int], codec: object
) -> None:
    """With a limit of 8 bytes most lines are near it, on it or over it, and CR and LF stand anywhere."""
    data = b"".join(pieces)
    whole, cut = Decoder(codec, max_line=8), Decoder(codec, max_line=8)  # type: ignore[arg-type]
    assert decode_in_chunks(data, cuts, cut) == whole.feed(data)
    assert cut.malformed == whole.malformed


@given(st.lists(st.binary(max_size=300), max_size=10))
@settings(max_examples=examples(100))
def test_no_bytes_make_a_decoder_raise(chunks: list[bytes]) -> None:
    """Arbitrary bytes give values, each no longer than the limit, and each is counted."""
    for codec in (BOARD, HOST):
        decoder = Decoder(codec)
        pairs = [pair for chunk in chunks for pair in decoder.feed(chunk)]
        assert all(0 < len(line) <= codec.framing.max_line for line, _ in pairs)
        assert sum(decoder.accepted.values()) + decoder.malformed.total() == len(pairs)


def test_a_line_that_never_ends_takes_no_memory() -> None:
    """Another megabyte without a line end leaves less than a kilobyte behind, and there is one report."""
    decoder = Decoder(BOARD)
    chunk = b"x" * 4096
    reports = [report for _ in range(256) for report in decoder.feed(chunk)]
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    for _ in range(256):
        reports += decoder.feed(chunk)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after - before < 1024
    assert len(reports) == 1


def test_an_overlong_line_is_reported_once_while_it_is_still_coming() -> None:
    """The report has the first bytes; the rest is skipped to its end, and the next line is read."""
    decoder = Decoder(BOARD, max_line=8)
    report = (b"xxxxxxxx", Malformed(Reason.OVERLONG, b"xxxxxxxx", "longer than 8 bytes"))
    assert decoder.feed(b"x" * 10) == [report]
    assert decoder.feed(b"x" * 1000) == []
    assert decoder.feed(b"xx\nu\t7\n") == [(b"u\t7", UltrasonicDistance(7))]
    assert decoder.malformed == {Reason.OVERLONG: 1}


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_a_line_of_just_the_limit_is_read(end: bytes) -> None:
    """The limit counts the line without its end, whether that is one byte or two."""
    decoder = Decoder(BOARD, max_line=8)
    assert decode_in_chunks(b"12345678" + end, list(range(10)), decoder)[0][1] == Malformed(
        Reason.UNKNOWN, b"12345678", "numbers without a kind"
    )
    assert decoder.feed(b"abcdefgh" + end) == [(b"abcdefgh", Text("abcdefgh"))]


def test_only_one_cr_belongs_to_the_line_end() -> None:
    """A second CR is a control byte in the line."""
    ((line, meaning),) = Decoder(BOARD).feed(b"e\t1\t2\r\r\n")
    assert line == b"e\t1\t2\r"
    assert isinstance(meaning, Malformed)
    assert meaning.reason is Reason.NOT_ASCII


def test_empty_lines_are_no_lines() -> None:
    """The raw-IMU line's extra LF, and any other, leaves no trace."""
    decoder = Decoder(BOARD)
    message = RawImu((1, 2, 3), (4, 5, 6))
    assert decoder.feed(b"\n\r\n" + BOARD.encode(message)) == [(b"i\t1\t2\t3\t4\t5\t6", message)]
    assert decoder.accepted == {"RawImu": 1}


def test_the_board_hears_commands_ended_by_cr_and_ignores_lf() -> None:
    """LF vanishes wherever it stands."""
    commands = Decoder(HOST).feed(b"s 1 -2\rr\r\ns 3\n 4\r\r")
    assert commands == [(b"s 1 -2", SetDuty((1, -2))), (b"r", ResetBoard()), (b"s 3 4", SetDuty((3, 4)))]


def test_the_board_s_buffer_holds_64_bytes() -> None:
    """A command beyond the sketch's buffer is refused whole, and the next one is heard."""
    decoder = Decoder(HOST)
    assert [m for _, m in decoder.feed(b"s 0" + b"0" * 59 + b" 0\r" + b"s 1" + b"0" * 60 + b" 0\rr\r")] == [
        SetDuty((0, 0)),
        Malformed(Reason.OVERLONG, b"s 1" + b"0" * 60 + b" ", "longer than 64 bytes"),
        ResetBoard(),
    ]


@pytest.mark.parametrize("before", [b"e\t1", b"x" * 500])
def test_reset_forgets_the_line_in_progress(before: bytes) -> None:
    """After a reconnect the old half line, or the skipping of one, does not touch the new bytes."""
    decoder = Decoder(BOARD)
    decoder.feed(before)
    decoder.reset()
    assert decoder.feed(b"e\t3\t4\n") == [(b"e\t3\t4", EncoderCounts((3, 4)))]


def test_lines_are_counted_by_class_and_refusals_by_reason() -> None:
    """The counters are what the statistics show; they outlive a reset."""
    decoder = Decoder(BOARD)
    decoder.feed(b"u\t1\nu\t2\nMPU6050 connection failed\nhello\n")
    decoder.reset()
    decoder.feed(b"u\t1\nu\t\nu\nu\n")
    assert decoder.accepted == {"UltrasonicDistance": 3, "Banner": 1, "Text": 1}
    assert decoder.malformed == {Reason.NOT_A_NUMBER: 1, Reason.FIELD_COUNT: 2}


def test_a_banner_ended_by_crlf_is_a_banner() -> None:
    """Text lines end in CR LF, and the CR is no part of them."""
    banner = Banner("Testing device connections...")
    assert Decoder(BOARD).feed(BOARD.encode(banner)) == [(banner.text.encode(), banner)]


def test_a_decoder_without_room_for_a_line_cannot_be_made() -> None:
    """The limit must hold at least a byte."""
    with pytest.raises(ValueError, match="max_line must be at least 1 byte, got 0"):
        Decoder(BOARD, max_line=0)


CUT_BEGINNINGS = [b"41\t-839\n", b"\t0\t1\n", b"e\t12\n", b"\xff0.02\r\n", b"1" * 300 + b"\n"]


@pytest.mark.parametrize("cut", CUT_BEGINNINGS)
@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_the_first_line_of_a_connection_may_be_cut(cut: bytes, chunk: int):
    """Whatever is left of the line at the opening is no malformed line; the next that means nothing is one."""
    decoder = Decoder(from_board(CLASSIC))
    decoder.reset()
    data = cut + b"u\t57\ne\t12\n"
    meanings = [
        meaning
        for start in range(0, len(data), chunk)
        for _, meaning in decoder.feed(data[start : start + chunk])
    ]
    assert meanings[0] == UltrasonicDistance(57)
    assert [type(meaning) for meaning in meanings[1:]] == [Malformed]
    assert dict(decoder.malformed) == {Reason.FIELD_COUNT: 1}


def test_a_whole_first_line_is_taken():
    """A board that restarts as it is opened begins with its banner, which must not be missed."""
    decoder = Decoder(from_board(CLASSIC))
    decoder.reset()
    ((_, meaning),) = decoder.feed(b"Initializing I2C devices...\r\n")
    assert meaning == Banner("Initializing I2C devices...")


def test_lines_are_counted_right_whatever_shape_of_a_read_came_first() -> None:
    """The first of its shape is damaged: the good ones after it count by their class, also from a restored state."""
    decoder = Decoder(BOARD)
    reads = [
        b"b\t--2\nu\t7\n",
        b"b\t2.5\nu\t7\n",
        b"b\t2.5\nu\t8\n",
        b"b\t-2.\nu\t99999\n",
        b"b\t9.5\nu\t8\n",
    ]
    for read in reads:
        whole = [pair for line in read.splitlines(keepends=True) for pair in Decoder(BOARD).feed(line)]
        assert decoder.feed(read) == whole
    assert decoder.accepted == {"BatteryLevel": 3, "UltrasonicDistance": 4}
    assert decoder.malformed.total() == 3
    again = Decoder(BOARD)
    again.restore(decoder.state())
    assert again.accepted == decoder.accepted
