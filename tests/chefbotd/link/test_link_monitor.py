"""Listening to whatever comes in."""

from chefbotd.link.health import Condition, LinkMonitor
from firmware_protocol.codec import CLASSIC, from_board
from firmware_protocol.decoder import Decoder


def hearing(*chunks: bytes) -> LinkMonitor:
    """Listening to these since time 10."""
    decoder = Decoder(from_board(CLASSIC))
    listening = LinkMonitor(decoder, CLASSIC, health_after_s=2.0)
    listening.begin(10.0)
    for chunk in chunks:
        decoder.feed(chunk)
        listening.count_bytes(chunk)
    return listening


def test_text_is_heard_and_is_no_frame():
    """Twenty lines of text: bytes are counted, and it is another device that talks."""
    listening = hearing(b"hello\r\n" * 20)
    health = listening.judge(10.1)
    assert listening.memory.bytes_in == 140
    assert health is not None
    assert health.condition is Condition.WRONG_DEVICE
    assert "140 bytes, 20 lines, 0 of them frames" in health.reason


def test_a_new_port_is_judged_anew():
    """What was heard before the port was opened again says nothing about it."""
    listening = hearing(b"u\t1\n" * 100)
    listening.begin(20.0)
    assert listening.judge(21.0) is None
    health = listening.judge(22.0)
    assert health is not None
    assert health.condition is Condition.SILENT


def test_bytes_without_a_line_end_are_judged_by_their_looks():
    """The newest bytes in however small chunks: mostly none of text."""
    health = hearing(*[bytes([0x80 + n]) for n in range(100)]).judge(12.0)
    assert health is not None
    assert health.condition is Condition.WRONG_BAUD


def test_before_the_first_port_nothing_is_proven():
    """Whoever asks is answered, though nothing was opened yet."""
    assert not LinkMonitor(Decoder(from_board(CLASSIC)), CLASSIC, health_after_s=2.0).proven


def test_lines_that_were_refused_are_lines():
    """Three of numbers without a kind among twenty of text: 23 lines."""
    health = hearing(b"hello\r\n" * 20 + b"1\t2\n" * 3).judge(12.5)
    assert health is not None
    assert "23 lines, 0 of them frames" in health.reason


def test_only_the_newest_128_bytes_are_looked_at():
    """Noise as the device started, and text without an end since: another device, and no wrong baud rate."""
    health = hearing(bytes([0x91]) * 1000, b"some words " * 12).judge(12.5)
    assert health is not None
    assert health.condition is Condition.WRONG_DEVICE
    health = hearing(bytes([0x91]) * 1000, b"some words").judge(12.5)
    assert health is not None
    assert health.condition is Condition.WRONG_BAUD
