"""What may be wrong with a lidar's bytes."""

import pytest

from chefbotd.components.simulation.lidar import LidarFault, LidarLine, heard_at
from firmware_protocol.lidar.ld19 import Ld19Decoder, Ld19Packet, encode

SENT = [
    encode(Ld19Packet(3600, k * 900 % 36_000, (k * 900 + 880) % 36_000, (1000 + k,) * 12, (200,) * 12, k * 3))
    for k in range(100)
]


def through(fault: LidarFault | None, before: int = 50) -> tuple[list[Ld19Packet], Ld19Decoder, bytes]:
    """What a decoder reads of the packets after the fault has come, by threes; also the bytes."""
    line, decoder, read, heard = LidarLine(seed=3), Ld19Decoder(), [], b""
    line.carry(SENT[:before])
    line.fault = fault
    for number in range(before, len(SENT), 3):
        data = line.carry(SENT[number : number + 3])
        heard += data
        read += decoder.feed_bytes(data)
    return read, decoder, heard


def stamps(read: list[Ld19Packet]) -> list[int]:
    """Their times in milliseconds."""
    return [packet.stamp_ms for packet in read]


def test_a_good_line_changes_nothing() -> None:
    """Every packet, in its order."""
    assert through(None)[2] == b"".join(SENT[50:])


def test_silence_is_nothing() -> None:
    """Not a byte."""
    assert through(LidarFault.SILENT)[2] == b""


@pytest.mark.parametrize("fault", [LidarFault.GARBAGE, LidarFault.WRONG_BAUD])
def test_garbage_and_a_wrong_baud_rate_are_bytes_without_a_packet(fault: LidarFault) -> None:
    """Many bytes, none of them read as a packet."""
    read, _, heard = through(fault)
    assert read == []
    assert len(heard) > 20 * len(SENT[0])
    assert heard != b"".join(SENT[50:])


def test_cut_packets_are_refused() -> None:
    """Each lacks bytes: nothing is read, and the decoder counts why."""
    read, decoder, heard = through(LidarFault.CUT)
    assert len(read) == 0
    assert decoder.refused["checksum"] > 0
    assert 0.6 < len(heard) / (50 * 47) < 0.95


def test_doubled_packets_come_twice() -> None:
    """Each after itself."""
    read = through(LidarFault.DOUBLED)[0]
    assert stamps(read) == [k * 3 for k in range(50, 100) for _ in range(2)]


def test_a_frozen_turn_comes_again_and_again() -> None:
    """The last 38 packets before it, in their order, from the oldest."""
    read = through(LidarFault.FROZEN)[0]
    assert stamps(read) == [(12 + k % 38) * 3 for k in range(50)]


def test_a_receiver_at_half_the_rate_takes_every_other_bit() -> None:
    """Twice 0x55, whose bits change each time: 0,1 pairs are a start bit and ones. By hand for one byte of 0x0F.

    Bits sent 0 1111 0000 1: at half the rate the start bit takes bits 0 and 1, and the samples at bits 3, 5, 7, 9 are
    1, 0, 0, 1; there are no more.
    """
    assert heard_at(b"\x55\x55\x55\x55", 1.0) == b"\x55\x55\x55\x55"
    assert heard_at(b"\x0f", 0.5) == b""
    assert heard_at(b"", 0.5) == b""
