"""The LD06 and LD19's packets: golden bytes from the maker's manual, and whatever a line can do to them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_protocol.lidar.ld19 import PACKET, Ld19Decoder, Ld19Packet, crc8, encode

GOLDEN = bytes.fromhex(
    "54 2C 68 08 AB 7E E0 00 E4 DC 00 E2 D9 00 E5 D5 00 E3 D3 00 E4 D0 00 E9"
    "CD 00 E4 CA 00 E2 C7 00 E9 C5 00 E5 C2 00 E5 C0 00 E5 BE 82 3A 1A 50"
)
"""The example of the LD06's development manual."""

MANUAL = Ld19Packet(
    speed_deg_s=2152,
    start_cdeg=32427,
    end_cdeg=33470,
    distance_mm=(224, 220, 217, 213, 211, 208, 205, 202, 199, 197, 194, 192),
    intensity=(228, 226, 229, 227, 228, 233, 228, 226, 233, 229, 229, 229),
    stamp_ms=6714,
)

PACKETS = st.builds(
    Ld19Packet,
    speed_deg_s=st.integers(0, 65535),
    start_cdeg=st.integers(0, 35999),
    end_cdeg=st.integers(0, 35999),
    distance_mm=st.tuples(*[st.integers(0, 65535)] * 12),
    intensity=st.tuples(*[st.integers(0, 255)] * 12),
    stamp_ms=st.integers(0, 29999),
)


def test_the_manual_s_packet_is_read_as_the_manual_reads_it() -> None:
    """Speed, angles, twelve points and the stamp, by the bytes of the maker's example."""
    assert Ld19Decoder().feed_bytes(GOLDEN) == [MANUAL]


def test_a_packet_is_written_as_the_device_writes_it() -> None:
    """The checksum too: 0x50."""
    assert encode(MANUAL) == GOLDEN
    assert crc8(GOLDEN[:-1]) == 0x50


def test_points_are_evenly_spaced_between_the_two_angles() -> None:
    """10.43 degrees in eleven steps: the second point is 94.8 hundredths of a degree after the first."""
    angles = MANUAL.angles_cdeg()
    assert angles[0] == 32427
    assert angles[1] == pytest.approx(32427 + 1043 / 11)
    assert angles[-1] == pytest.approx(33470)


def test_angles_go_through_zero() -> None:
    """From 359.4 to 0.5 degrees are 1.1 degrees in eleven steps of 0.1."""
    packet = Ld19Packet(3600, 35940, 50, (1000,) * 12, (1,) * 12, 0)
    assert packet.span_cdeg == 110
    assert packet.angles_cdeg() == pytest.approx(
        [35940, 35950, 35960, 35970, 35980, 35990, 0, 10, 20, 30, 40, 50]
    )


@given(st.lists(PACKETS, max_size=4), st.binary(max_size=60), st.integers(1, 60))
def test_chunks_make_no_difference(packets: list[Ld19Packet], noise: bytes, size: int) -> None:
    """The same packets and the same counts, whole and in pieces."""
    data = noise + b"".join(map(encode, packets))
    whole, pieces = Ld19Decoder(), Ld19Decoder()
    read = whole.feed_bytes(data)
    assert read == [p for at in range(0, len(data), size) for p in pieces.feed_bytes(data[at : at + size])]
    assert whole.refused == pieces.refused
    assert whole.packets == pieces.packets == len(read)


@given(st.lists(PACKETS, min_size=1, max_size=4))
def test_what_is_written_is_read_again(packets: list[Ld19Packet]) -> None:
    """Nothing is lost, refused or changed on a good line."""
    decoder = Ld19Decoder()
    assert decoder.feed_bytes(b"".join(map(encode, packets))) == packets
    assert not decoder.refused


@pytest.mark.parametrize("bit", range(0, 8 * PACKET.size, 7))
def test_a_flipped_bit_costs_that_packet_and_no_other(bit: int) -> None:
    """The packets before and after are read; what was damaged is counted."""
    damaged = bytearray(GOLDEN)
    damaged[bit // 8] ^= 1 << bit % 8
    decoder = Ld19Decoder()
    assert decoder.feed_bytes(GOLDEN + bytes(damaged) + GOLDEN) == [MANUAL, MANUAL]
    assert decoder.refused


def test_a_lost_byte_costs_one_packet() -> None:
    """The next header is found again."""
    decoder = Ld19Decoder()
    assert decoder.feed_bytes(GOLDEN[:20] + GOLDEN[21:] + GOLDEN * 2) == [MANUAL, MANUAL]


def test_a_line_that_begins_in_the_middle_loses_only_that_packet() -> None:
    """The device never waits for anybody: the first bytes are the rest of a packet."""
    decoder = Ld19Decoder()
    assert decoder.feed_bytes(GOLDEN[30:] + GOLDEN) == [MANUAL]
    assert decoder.refused == {"noise": 17}


def test_an_angle_that_no_device_sends_is_refused() -> None:
    """360.00 degrees with a good checksum."""
    raw = encode(Ld19Packet(3600, 36000, 100, (1,) * 12, (1,) * 12, 0))
    decoder = Ld19Decoder()
    assert decoder.feed_bytes(raw) == []
    assert decoder.refused["fields"] == 1


def test_noise_without_end_is_not_kept() -> None:
    """A megabyte that never is a packet leaves at most the byte that may begin one."""
    decoder = Ld19Decoder()
    for _ in range(256):
        assert decoder.feed_bytes(b"\x54" * 4096) == []
    assert decoder.refused["noise"] == 256 * 4096 - 1


def test_another_connection_begins_anew() -> None:
    """Half a packet of the old one is not joined to the new one's."""
    decoder = Ld19Decoder()
    decoder.feed_bytes(GOLDEN[:25])
    decoder.reset()
    assert decoder.feed_bytes(GOLDEN) == [MANUAL]
    assert not decoder.refused
