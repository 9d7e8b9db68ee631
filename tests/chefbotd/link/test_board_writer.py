"""The stops that open, overtake and close: what is in force at the board after them, whatever was cut or damaged."""

from collections.abc import Iterator

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import ManualClock
from chefbotd.core.events import LineSeen
from chefbotd.link.board_writer import BoardWriter, LineRing
from chefbotd.link.port import PortTransport
from firmware_protocol import messages as wire
from firmware_protocol.codec import CLASSIC, FOUR_WHEELS, Variant, to_board
from firmware_protocol.decoder import Decoder
from tests.budget import sample
from tests.fakes.classic_sketch import duty_in_force

LARGEST_DIGIT = 9


class Wire(PortTransport):
    """A port that takes everything at once, and remembers what it took."""

    def __init__(self) -> None:
        super().__init__()
        self.taken = b""
        self.closed = False
        self.unsent = 0

    def get_write_buffer_size(self) -> int:
        """As told."""
        return self.unsent

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Take it."""
        self.taken += data

    def write_from_thread(self, words: bytes) -> bool:
        """Take it."""
        self.taken += words
        return True

    def abort(self) -> None:
        """Take nothing any more."""
        self.closed = True


def speaking(variant: Variant = CLASSIC) -> tuple[BoardWriter, Wire, Bus, LineRing]:
    """A writer on an open port."""
    bus, lines, port = Bus(), LineRing(), Wire()
    stop = to_board(variant).encode(wire.SetDuty((0,) * variant.wheels))
    writer = BoardWriter(bus, ManualClock(5.0), lines, stop)
    writer.begin(port)
    return writer, port, bus, lines


def motion(variant: Variant) -> tuple[tuple[int, ...], bytes]:
    """A motor command whose pieces would all move the robot, and its line."""
    duty = (-203, 201, 199, -197)[: variant.wheels]
    return duty, to_board(variant).encode(wire.SetDuty(duty))


def understood(variant: Variant, data: bytes) -> Iterator[tuple[int, ...]]:
    """The motor command in force after ``data``, by our strict decoder and by the classic sketch's lenient one."""
    before, _ = motion(variant)
    decoded = [message for _, message in Decoder(to_board(variant)).feed(data)]
    yield next((m.duty for m in reversed(decoded) if isinstance(m, wire.SetDuty)), before)
    yield duty_in_force(data, before)


def damaged(words: bytes) -> Iterator[bytes]:
    """The words with each byte lost, doubled, and with each of its bits flipped."""
    for index, byte in enumerate(words):
        yield words[:index] + words[index + 1 :]
        yield words[:index] + bytes([byte, byte]) + words[index + 1 :]
        for bit in range(8):
            yield words[:index] + bytes([byte ^ 1 << bit]) + words[index + 1 :]


def said_last(variant: Variant) -> bytes:
    """The shutdown stop."""
    writer, port, _, _ = speaking(variant)
    writer.stop_last()
    return port.taken


def said_first(variant: Variant) -> bytes:
    """What opens, and what overtakes."""
    writer, port, _, _ = speaking(variant)
    writer.stop_first(5.0)
    return port.taken


ROBOTS = pytest.mark.parametrize("variant", [CLASSIC, FOUR_WHEELS], ids=lambda variant: variant.name)


@ROBOTS
def test_a_stop_holds_whatever_piece_of_a_line_stands_before_it(variant: Variant):
    """A line cut after any of its bytes, here or in the board's own buffer: zero is in force after it."""
    _, line = motion(variant)
    for cut in range(len(line) + 1):
        for words in (said_first(variant), said_last(variant)):
            assert set(understood(variant, line[:cut] + words)) == {(0,) * variant.wheels}


@pytest.mark.parametrize("variant", sample([CLASSIC, FOUR_WHEELS]), ids=lambda variant: variant.name)
def test_one_damaged_byte_does_not_undo_the_shutdown_stop(variant: Variant):
    """After any cut line, any byte lost, doubled or with a bit flipped: zero, or a digit made of one of its zeros."""
    _, line = motion(variant)
    for cut in range(len(line) + 1):
        for words in damaged(said_last(variant)):
            for duty in understood(variant, line[:cut] + words):
                assert max(map(abs, duty)) <= LARGEST_DIGIT, (line[:cut], words)


def test_no_empty_line_is_ever_said():
    """What the classic sketch makes of one is undefined: the stop itself ends what was cut short."""
    for words in (said_first(CLASSIC), said_last(CLASSIC)):
        assert not words.startswith(b"\r")
        assert b"\r\r" not in words


def test_every_line_is_counted_kept_and_published():
    """A command, the stop that overtakes it and the shutdown stop: each line of them, with its time."""
    writer, _, bus, lines = speaking()
    seen = bus.subscribe(LineSeen)
    writer.write(b"s 1 2\r", 5.0)
    writer.stop_first(5.0)
    writer.stop_last()
    told = [b"s 1 2", *[b"s 0 0"] * 6]
    assert [seen.take_event().line for _ in range(len(seen))] == told
    assert list(lines.said) == [(5.0, line) for line in told]
    assert writer.memory.lines_out == 7


def test_after_the_shutdown_stop_nothing_is_said():
    """The port is given up: neither a command, nor a stop, nor one from another thread."""
    writer, port, _, _ = speaking()
    writer.stop_last()
    taken = port.taken
    writer.write(b"s 1 2\r", 5.0)
    writer.stop_first(5.0)
    writer.stop_last()
    assert not writer.stop_from_thread()
    assert port.closed
    assert port.taken == taken
    assert not writer.has_drained()
