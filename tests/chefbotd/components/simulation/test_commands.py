"""What a sketch takes for commands."""

import pytest

from chefbotd.components.simulation.peripherals import CommandReader
from firmware_protocol.messages import ResetBoard, SetDuty


@pytest.mark.parametrize(
    ("sent", "obeyed"),
    [
        (b"s 66 -37\r", [SetDuty((66, -37))]),
        (b"s 6637\r", [SetDuty((6637, 0))]),
        (b"s 66s 37 40\r", [SetDuty((66, 37))]),
        (b"s 4x -\r", [SetDuty((4, 0))]),
        (b"s -250146 3000000000\r", [SetDuty((-250146, 2**31 - 1))]),
        (b"37 40\rr\r", [ResetBoard()]),
        (b"r s 5 6 7\r\n", [ResetBoard(), SetDuty((5, 6))]),
        (b"x s 5 6\r", [SetDuty((5, 6))]),
        (b"\r\r", []),
    ],
)
def test_pieces_are_obeyed_as_atol_reads_them(sent: bytes, obeyed: list[object]):
    """A word that is no number, or not there, is 0; whatever the chunking."""
    assert list(CommandReader(2).feed(sent)) == obeyed
    reader = CommandReader(2)
    assert [command for byte in sent for command in reader.feed(bytes([byte]))] == obeyed


def test_what_is_no_command_is_counted():
    """A line without ``s`` and ``r``, and one of 64 bytes."""
    reader = CommandReader(2)
    assert list(reader.feed(b"37 40\r" + b"s" * 64 + b"\r\n")) == []
    assert reader.ignored == 2


def test_a_reset_forgets_the_beginning_of_a_line():
    """What came before the sketch started is not glued to what comes after."""
    reader = CommandReader(2)
    assert list(reader.feed(b"s 9")) == []
    reader.reset()
    assert list(reader.feed(b"s 5 6\r")) == [SetDuty((5, 6))]
