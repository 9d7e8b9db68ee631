"""Numbers that other boards write in another way: read where the meaning is plain, refused where it is not."""

import pytest

from firmware_protocol.codec import CLASSIC, FOUR_WHEELS, from_board, to_board
from firmware_protocol.messages import (
    BoardTime,
    EncoderCounts,
    Malformed,
    Message,
    UltrasonicDistance,
)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (b"u\t57.3", UltrasonicDistance(57)),
        (b"u\t57.00", UltrasonicDistance(57)),
        (b"u\t0.00", UltrasonicDistance(0)),
        (b"u\t57.99", UltrasonicDistance(57)),  # rounded down, as the published sketch does
        (b"u\t-1", UltrasonicDistance(0)),  # what drivers of sensors say of no echo
        (b"u\t-1.00", UltrasonicDistance(0)),
        (b"u\t65535", UltrasonicDistance(0)),
        (b"u\t4294967295", UltrasonicDistance(0)),
        (b"u\tnan", UltrasonicDistance(0)),
        (b"u\tNaN", UltrasonicDistance(0)),
        (b"u\tinf", UltrasonicDistance(0)),
        (b"e\t1204.00\t-1188.00", EncoderCounts((1204, -1188))),
        (b"e\t-0.5\t0.5", EncoderCounts((-1, 0))),
        (b"e\t4294967290\t4294967295", EncoderCounts((-6, -1))),  # 2**32 - 6, 2**32 - 1
        (b"e\t4294967290\t7", EncoderCounts((-6, 7))),
        (b"e\t2147483648\t2147483647", EncoderCounts((-(2**31), 2**31 - 1))),
        (b"e\t4294967290.0\t7.0", EncoderCounts((-6, 7))),
        (b"t\t1200000.00\t0.05", BoardTime(1200000, 0.05)),
    ],
)
def test_a_plain_meaning_is_read(line: bytes, message: Message) -> None:
    """Decimals in whole numbers, counts as unsigned numbers of 32 bits, and other words for no echo."""
    assert from_board(CLASSIC).decode(line) == message


@pytest.mark.parametrize(
    "line",
    [
        b"e\t1204\t11.00",  # half of another line, glued to this one
        b"e\t1204.0\t11.00",
        b"e\t4294967296\t7",  # more than 32 bits
        b"e\t-2147483649\t7",
        b"e\t1204.\t11.",
        b"u\t-1.5",
        b"u\t-2",
        b"u\t-0.5",
        b"u\t65534",
        b"u\tnone",
        b"e\tnan\t7",
        b"e\tinf\tinf",
        b"t\t-1\t0.05",
        b"u\t40000.0",
        b"u\t5.7.3",
        b"u\t5-7",
        b"u\t.5",
        b"t\t-1.0\t0.05",
        b"t\t4294967296.0\t0.05",
        b"i\t0.10\t0.20\t9.81\t0.0\t0.1\t0.2",  # accelerations in SI units are no counts of the sensor
    ],
)
def test_what_may_mean_something_else_is_refused(line: bytes) -> None:
    """A wrong number is worse than none."""
    assert isinstance(from_board(CLASSIC).decode(line), Malformed)


def test_four_wheels_are_read_alike() -> None:
    """KHAN's boards print floats just as easily."""
    counts = from_board(FOUR_WHEELS).decode(b"e\t1.0\t2.0\t-3.0\t4294967292.0")
    assert counts == EncoderCounts((1, 2, -3, -4))


def test_the_board_itself_reads_as_strictly_as_ever() -> None:
    """What goes to the motors is written by us."""
    assert isinstance(to_board(CLASSIC).decode(b"s 10.5 10.5"), Malformed)
