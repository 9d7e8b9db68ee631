"""The checked lines of our own firmware, and the codec that tells its two modes apart."""

from itertools import combinations, pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.simulation.peripherals import CommandReader
from firmware_protocol.checked import (
    FirmwareCodec,
    Sealer,
    checked_from_board,
    checked_to_board,
    crc_16,
    seal,
    unseal,
)
from firmware_protocol.codec import CLASSIC, FOUR_WHEELS
from firmware_protocol.decoder import Decoder
from firmware_protocol.messages import (
    AgedDistance,
    AgedImu,
    Arm,
    BoardCounters,
    BoardState,
    BoardTime,
    CommandRefused,
    EmergencyStop,
    EncoderCounts,
    Firmware,
    Hello,
    HelloAnswer,
    Malformed,
    Message,
    ParameterSet,
    Reason,
    ResetBoard,
    ResetDone,
    SequencedEcho,
    SetDuty,
    SetParameter,
    SetWheelSpeeds,
    Text,
    UltrasonicDistance,
)
from tests.budget import examples

FROM_BOARD = {
    b"t\t1234567\t0.010": BoardTime(1234567, 0.01),
    b"e\t841\t-839": EncoderCounts((841, -839)),
    b"s\t120\t-80\t255": SequencedEcho((120, -80), 255),
    b"u\t123\t4500": AgedDistance(123, 4500),
    b"i\t1\t-2\t16384\t4\t-5\t6\t900": AgedImu((1, -2, 16384), (4, -5, 6), 900),
    b"state\t1\t3\t7\t4": BoardState(1, 3, 7, 4),
    b"counters\t1\t2\t3\t4\t5\t65535": BoardCounters(1, 2, 3, 4, 5, 65535),
    b"hello\t1\t250\t4294967295\t9": HelloAnswer(1, 250, 4294967295, 9),
    b"g\t4\t-70000": ParameterSet(4, -70000),
    b"refused\t5\t200": CommandRefused(5, 200),
}
TO_BOARD = {
    b"s 120 -80": SetDuty((120, -80)),
    b"w 6283 -50000": SetWheelSpeeds((6283, -50000)),
    b"g 3 1024": SetParameter(3, 1024),
    b"arm 17": Arm(17),
    b"r": ResetBoard(),
    b"estop": EmergencyStop(),
    b"hello 1 250": Hello(1, 250),
}
NAMED = b"firmware\t1\t0\t1\t2\t3\t1"


def crc_by_bits(data: bytes) -> int:
    """The definition, a bit at a time: polynomial 0x1021, from 0xFFFF, not reflected."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1
            crc &= 0xFFFF
    return crc


@given(st.binary(max_size=64))
@settings(max_examples=examples(50))
def test_the_crc_is_the_published_one(data: bytes) -> None:
    """It agrees with its definition bit by bit, and 123456789 gives the catalogue's check value 0x29B1."""
    assert crc_16(data) == crc_by_bits(data)
    assert crc_16(b"123456789") == 0x29B1


@pytest.mark.parametrize(("body", "message"), FROM_BOARD.items())
def test_a_checked_line_of_the_board_means_its_message_and_is_written_so(
    body: bytes, message: Message
) -> None:
    """Each body of the contract's table decodes to its message, which encodes to the same body."""
    codec = checked_from_board(CLASSIC)
    assert codec.decode(body) == message
    assert codec.encode(message) == body + b"\n"


@pytest.mark.parametrize(("body", "message"), TO_BOARD.items())
def test_a_checked_line_to_the_board_means_its_message_and_is_written_so(
    body: bytes, message: Message
) -> None:
    """Each body of the contract's table decodes to its message, which encodes to the same body."""
    codec = checked_to_board(CLASSIC)
    assert codec.decode(body) == message
    assert codec.encode(message) == body + b"\r"


def test_sealed_lines_are_numbered_and_0_follows_255() -> None:
    """The first line has number 0, the 256th 255 and the next one 0 again; each CRC fits what stands before it."""
    sealer = Sealer(checked_to_board(CLASSIC))
    lines = [sealer.encode(SetDuty((120, -80))) for _ in range(257)]
    assert lines[0] == b"s 120 -80 0*%04X\r" % crc_by_bits(b"s 120 -80 0")
    assert lines[255] == b"s 120 -80 255*%04X\r" % crc_by_bits(b"s 120 -80 255")
    assert lines[256] == lines[0]


def test_a_robot_with_four_wheels_has_four_numbers_in_its_lines() -> None:
    """The tables follow the variant: `s` of four wheels, and its echo with the number that was obeyed."""
    assert checked_to_board(FOUR_WHEELS).decode(b"s 1 -2 3 -4") == SetDuty((1, -2, 3, -4))
    assert checked_from_board(FOUR_WHEELS).decode(b"s\t1\t-2\t3\t-4\t9") == SequencedEcho((1, -2, 3, -4), 9)


def flipped(line: bytes, bits: tuple[int, ...]) -> bytes:
    """The line with these bits turned over."""
    damaged = bytearray(line)
    for bit in bits:
        damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


def test_no_error_of_one_or_two_bits_passes() -> None:
    """A command of 17 bytes has 136 single and 9180 double errors: not one of them is a checked line."""
    line = seal(b"s 120 -80", 42, b" ")
    assert unseal(line, b" ") == (b"s 120 -80", 42)
    errors = [bits for count in (1, 2) for bits in combinations(range(8 * len(line)), count)]
    assert len(errors) == 136 + 9180
    assert not any(unseal(flipped(line, bits), b" ") for bits in errors)


@given(st.sets(st.integers(0, 135), min_size=3, max_size=3))
@settings(max_examples=examples(300))
def test_no_error_of_three_bits_passes(bits: set[int]) -> None:
    """Any three bits of a command turned over leave a line that is refused: by its CRC, or else by its body.

    A bit of a letter of the CRC may be more than one bit of the number that it stands for.
    """
    unsealed = unseal(flipped(seal(b"s 120 -80", 42, b" "), tuple(bits)), b" ")
    assert unsealed is None or isinstance(checked_to_board(CLASSIC).decode(unsealed[0]), Malformed)


@pytest.mark.parametrize("text", [b"256", b"-1", b"+7", b"1_0", b"", b"0007", b"x"])
def test_a_sequence_number_is_a_whole_number_up_to_255(text: bytes) -> None:
    """Any other text in its place is refused, though the CRC fits."""
    body = b"e\t1\t2\t" + text
    assert unseal(body + b"*%04X" % crc_16(body), b"\t") is None


def test_a_classic_sketch_obeys_a_checked_command() -> None:
    """Its parser reads the numbers it knows and leaves what follows: duty 120 and -80."""
    line = Sealer(checked_to_board(CLASSIC)).encode(SetDuty((120, -80)))
    assert list(CommandReader(2).feed(line)) == [SetDuty((120, -80))]


def checked(body: bytes, sequence: int) -> bytes:
    """A checked line of the board."""
    return seal(body, sequence, b"\t")


def test_the_first_checked_line_begins_the_checked_mode() -> None:
    """Before it a classic line counts; after it the same line, without its CRC, is refused as `checksum`."""
    codec = FirmwareCodec(CLASSIC)
    assert codec.decode(b"e\t1\t2") == EncoderCounts((1, 2))
    assert codec.decode(NAMED) == Firmware(1, 0, 1, 2, 3, 1)
    assert not codec.is_checked
    assert codec.decode(checked(b"hello\t1\t250\t1000\t0", 0)) == HelloAnswer(1, 250, 1000, 0)
    assert codec.is_checked
    refused = codec.decode(b"e\t1\t2")
    assert isinstance(refused, Malformed)
    assert (refused.reason, refused.line) == (Reason.CHECKSUM, b"e\t1\t2")


def test_a_refusal_does_not_begin_the_checked_mode() -> None:
    """A board in the classic mode refuses a checked command by a checked line, and stays classic."""
    codec = FirmwareCodec(CLASSIC)
    assert codec.decode(checked(b"refused\t1\t9", 3)) == CommandRefused(1, 9)
    assert not codec.is_checked


@pytest.mark.parametrize("line", [NAMED, b"Initializing I2C devices...", b"Reset Done"])
def test_a_board_that_has_restarted_is_classic_again(line: bytes) -> None:
    """Its name, its banner and `Reset Done` carry no CRC, and no damage makes them."""
    codec = FirmwareCodec(CLASSIC)
    codec.decode(checked(b"e\t1\t2", 5))
    assert not isinstance(codec.decode(line), Malformed)
    assert codec.decode(b"e\t1\t2") == EncoderCounts((1, 2))


def test_three_classic_lines_in_a_row_end_the_checked_mode() -> None:
    """Two may be damage, if a checked line follows them: the third in a row counts, and so do the two before it."""
    codec = FirmwareCodec(CLASSIC)
    lines = [checked(b"e\t1\t2", 0), b"u\t5", b"u\t6", checked(b"e\t1\t2", 1), b"u\t5", b"u\t6", b"u\t7"]
    refused = [isinstance(codec.decode(line), Malformed) for line in lines]
    assert refused == [False, True, True, False, True, True, False]
    assert not codec.is_checked
    decoded = Decoder(FirmwareCodec(CLASSIC)).feed(b"".join(line + b"\n" for line in lines))
    regained = [message.distance_cm for _, message in decoded if isinstance(message, UltrasonicDistance)]
    assert regained == [5, 6, 7]


def test_two_changes_of_the_mode_in_one_read_lose_no_line() -> None:
    """As byte by byte: each time the third classic line brings the two before it back."""
    codec = Decoder(FirmwareCodec(CLASSIC))
    lines = [line for at in (0, 1) for line in (checked(b"e\t1\t2", at), b"u\t5", b"u\t6", b"u\t7")]
    decoded = codec.feed(b"".join(line + b"\n" for line in lines))
    regained = [message.distance_cm for _, message in decoded if isinstance(message, UltrasonicDistance)]
    assert regained == 2 * [5, 6, 7]


def test_text_does_not_end_the_checked_mode() -> None:
    """A line that lost its form looks like text, so in the checked mode it is refused; before, it is text."""
    codec = FirmwareCodec(CLASSIC)
    assert codec.decode(b"debug") == Text("debug")
    codec.decode(checked(b"e\t1\t2", 0))
    assert [type(codec.decode(b"debug")) for _ in range(5)] == [Malformed] * 5


def test_checked_lines_that_did_not_come_are_counted() -> None:
    """Of 254, 255, 0, 3 the numbers 1 and 2 are missing: two lines are lost, and a damaged one is a third."""
    codec = FirmwareCodec(CLASSIC)
    for sequence in (254, 255, 0, 3):
        codec.decode(checked(b"u\t5\t0", sequence))
    assert codec.lost == 2
    codec.decode(flipped(checked(b"u\t5\t0", 4), (9,)))
    codec.decode(checked(b"u\t5\t0", 5))
    assert codec.lost == 3


def test_another_connection_begins_in_the_classic_mode() -> None:
    """After `reset` a classic line counts, and a checked one is known all the same."""
    codec = FirmwareCodec(CLASSIC)
    codec.decode(checked(b"e\t1\t2", 0))
    codec.reset()
    assert codec.decode(b"u\t5") is not None
    assert not codec.is_checked
    assert codec.decode(checked(b"u\t5\t10", 9)) == AgedDistance(5, 10)


def test_a_codec_goes_on_from_the_state_of_another() -> None:
    """Mode, expected number and losses are taken over: number 9 after 5 makes three lost lines."""
    codec, other = FirmwareCodec(CLASSIC), FirmwareCodec(CLASSIC)
    codec.decode(checked(b"e\t1\t2", 5))
    other.restore(codec.state())
    assert other.is_checked
    other.decode(checked(b"e\t1\t2", 9))
    assert other.lost == 3


CAPTURE = b"".join(
    (
        b"e\t1\t2\n" + NAMED + b"\n",
        checked(b"hello\t1\t250\t1000\t0", 0) + b"\n",
        b"e\t3\t4\n",
        checked(b"s\t0\t0\t255", 1) + b"\n",
        flipped(checked(b"e\t5\t6", 2), (20,)) + b"\n",
        b"u\t1\nu\t2\nu\t3\nu\t4\n",
        checked(b"e\t5\t6", 3) + b"\n",
        b"Reset Done\r\n",
        b"u\t9\ne\t0\t0\n",
    )
)


@given(st.lists(st.integers(0, len(CAPTURE)), max_size=8))
@settings(max_examples=examples(50))
def test_how_the_bytes_are_cut_makes_no_difference_in_either_mode(cuts: list[int]) -> None:
    """Classic lines, the change to the checked mode and the change back mean the same in any chunks."""
    whole = Decoder(FirmwareCodec(CLASSIC)).feed(CAPTURE)
    edges = [0, *sorted(cuts), len(CAPTURE)]
    decoder = Decoder(FirmwareCodec(CLASSIC))
    assert [pair for start, stop in pairwise(edges) for pair in decoder.feed(CAPTURE[start:stop])] == whole
    kinds = [type(message) for _, message in whole]
    assert kinds[2:6] == [HelloAnswer, Malformed, SequencedEcho, Malformed]
    assert kinds[6:12] == [Malformed, Malformed, *[UltrasonicDistance] * 4]
    assert kinds[13] is ResetDone
