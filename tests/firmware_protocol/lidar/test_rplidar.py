"""The RPLIDAR's requests and answers: the manual's bytes, and whatever a line can do to them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_protocol.lidar.rplidar import (
    Answer,
    Capsule,
    DeviceHealth,
    DeviceInfo,
    HealthStatus,
    RequestCode,
    RplidarDecoder,
    SampleRate,
    ScanNode,
    descriptor,
    encode_capsule,
    encode_node,
    express_request,
    request,
)

SCAN, EXPRESS = 0x81, 0x82
NODES = st.builds(
    ScanNode,
    starts_turn=st.booleans(),
    quality=st.integers(0, 63),
    angle_q6=st.integers(0, 360 * 64 - 1),
    distance_q2=st.integers(0, 65535),
)
CAPSULES = st.builds(
    Capsule,
    is_first=st.booleans(),
    start_q6=st.integers(0, 360 * 64 - 1),
    distance_mm=st.tuples(*[st.integers(0, 16383)] * 32),
    offset_q3=st.tuples(*[st.integers(0, 63)] * 32),
)


@pytest.mark.parametrize(
    ("command", "raw"),
    [
        (RequestCode.STOP, "A5 25"),
        (RequestCode.RESET, "A5 40"),
        (RequestCode.SCAN, "A5 20"),
        (RequestCode.GET_INFO, "A5 50"),
        (RequestCode.GET_HEALTH, "A5 52"),
    ],
)
def test_requests_are_the_manual_s(command: RequestCode, raw: str) -> None:
    """Two bytes each."""
    assert request(command) == bytes.fromhex(raw)


def test_the_express_request_carries_its_payload_and_checksum() -> None:
    """The manual's own bytes for the legacy mode."""
    assert express_request() == bytes.fromhex("A5 82 05 00 00 00 00 00 22")


@pytest.mark.parametrize(
    ("raw", "answer"),
    [
        (
            "A5 5A 14 00 00 00 04 18 1D 01 07 " + "0F" * 15 + "A1",
            DeviceInfo(0x18, (1, 29), 7, "0F" * 15 + "A1"),
        ),
        ("A5 5A 03 00 00 00 06 00 00 00", DeviceHealth(HealthStatus.GOOD, 0)),
        ("A5 5A 03 00 00 00 06 02 34 12", DeviceHealth(HealthStatus.ERROR, 0x1234)),
        ("A5 5A 04 00 00 00 15 F8 01 FC 00", SampleRate(504, 252)),
        # A point at 181.5 degrees and 1.25 m, not the first of its turn, quality 15.
        ("A5 5A 05 00 00 40 81 3E C1 5A 88 13", ScanNode(False, 15, 181 * 64 + 32, 5000)),
        ("A5 5A 05 00 00 40 81 3D 01 00 00 00", ScanNode(True, 15, 0, 0)),
    ],
)
def test_answers_are_read_as_the_manual_reads_them(raw: str, answer: Answer) -> None:
    """One descriptor and one payload each, by hand from the manual's tables."""
    decoder = RplidarDecoder()
    assert decoder.feed_bytes(bytes.fromhex(raw)) == [answer]
    assert not decoder.refused


def test_a_capsule_s_points_lie_evenly_before_the_next_less_their_offsets() -> None:
    """From 359 to 3 degrees are 4 in 32 steps of 1/8 degree; an offset of 8 eighths takes a degree off the third."""
    capsule = Capsule(False, 359 * 64, (1000,) * 32, (0, 0, 8, *[0] * 29))
    angles = capsule.angles_q6(3 * 64)
    assert angles[0] == 359 * 64
    assert angles[1] == 359 * 64 + 8
    assert angles[2] == 358.25 * 64
    assert angles[8] == 0
    assert angles[31] == pytest.approx(2.875 * 64)


def test_a_capsule_is_packed_as_the_manual_packs_it() -> None:
    """The first cabin: 1000 mm with offset 0x25, 2000 mm with 0x13; checksum nibbles beside A and 5."""
    capsule = Capsule(True, 0x1234, (1000, 2000, *[0] * 30), (0x25, 0x13, *[0] * 30))
    raw = encode_capsule(capsule)
    assert raw[2:9] == bytes.fromhex("34 92 A2 0F 41 1F 35")
    check = 0x34 ^ 0x92 ^ 0xA2 ^ 0x0F ^ 0x41 ^ 0x1F ^ 0x35
    assert raw[:2] == bytes((0xA0 | check & 0xF, 0x50 | check >> 4))
    assert RplidarDecoder().feed_bytes(descriptor(EXPRESS) + raw) == [capsule]


@given(st.lists(st.one_of(NODES), max_size=12), st.integers(1, 40), st.binary(max_size=20))
def test_chunks_make_no_difference(nodes: list[ScanNode], size: int, noise: bytes) -> None:
    """The same answers and counts, whole and in pieces, also with noise in between."""
    data = (
        descriptor(SCAN)
        + b"".join(map(encode_node, nodes[:6]))
        + noise
        + b"".join(map(encode_node, nodes[6:]))
    )
    whole, pieces = RplidarDecoder(), RplidarDecoder()
    read = whole.feed_bytes(data)
    assert read == [a for at in range(0, len(data), size) for a in pieces.feed_bytes(data[at : at + size])]
    assert whole.refused == pieces.refused


@given(st.lists(CAPSULES, min_size=1, max_size=3))
def test_capsules_that_are_written_are_read_again(capsules: list[Capsule]) -> None:
    """Nothing is lost, refused or changed on a good line."""
    decoder = RplidarDecoder()
    assert decoder.feed_bytes(descriptor(EXPRESS) + b"".join(map(encode_capsule, capsules))) == capsules
    assert not decoder.refused


@given(st.lists(NODES, min_size=1, max_size=20))
def test_nodes_that_are_written_are_read_again(nodes: list[ScanNode]) -> None:
    """Nothing is lost, refused or changed on a good line."""
    decoder = RplidarDecoder()
    assert decoder.feed_bytes(descriptor(SCAN) + b"".join(map(encode_node, nodes))) == nodes
    assert not decoder.refused


def _ramp(count: int) -> list[ScanNode]:
    return [ScanNode(index == 0, 20 + index % 7, index * 61, 4000 + 37 * index) for index in range(count)]


@pytest.mark.parametrize("lost", range(100, 110))
def test_a_scan_finds_its_points_again_after_a_lost_byte(lost: int) -> None:
    """At most the damaged point and three more are lost, and none is made up."""
    nodes = _ramp(60)
    raw = b"".join(map(encode_node, nodes))
    decoder = RplidarDecoder()
    read = decoder.feed_bytes(descriptor(SCAN) + raw[:lost] + raw[lost + 1 :])
    made_up = [node for node in read if node not in nodes]
    assert len(made_up) <= 1  # three check bits in five bytes let one through now and then
    assert len(read) >= len(nodes) - 5


def test_a_damaged_capsule_costs_itself_only() -> None:
    """Its checksum tells."""
    capsules = [Capsule(False, 100 * index, (index + 1,) * 32, (index,) * 32) for index in range(4)]
    raw = bytearray(b"".join(map(encode_capsule, capsules)))
    raw[84 + 40] ^= 0x10
    decoder = RplidarDecoder()
    assert decoder.feed_bytes(descriptor(EXPRESS) + bytes(raw)) == [capsules[0], *capsules[2:]]


def test_a_request_begins_a_new_answer() -> None:
    """After a stop, what is left of a scan is noise before the next descriptor."""
    decoder = RplidarDecoder()
    scan = b"".join(map(encode_node, _ramp(10)))
    decoder.feed_bytes(descriptor(SCAN) + scan)
    decoder.reset()
    health = bytes.fromhex("A5 5A 03 00 00 00 06 00 00 00")
    assert decoder.feed_bytes(scan[:7] + health) == [DeviceHealth(HealthStatus.GOOD, 0)]
    assert decoder.refused == {"noise": 7}


def test_a_descriptor_of_no_known_kind_is_noise() -> None:
    """Such as a health answer that claims a scan's length."""
    decoder = RplidarDecoder()
    assert decoder.feed_bytes(bytes.fromhex("A5 5A 05 00 00 00 06 A5 5A 03 00 00 00 06 01 00 00")) == [
        DeviceHealth(HealthStatus.WARNING, 0)
    ]


def test_noise_without_end_is_not_kept() -> None:
    """64 KB that are no answer, before a descriptor and within a scan."""
    for begin in (b"", descriptor(SCAN), descriptor(EXPRESS)):
        decoder = RplidarDecoder()
        decoder.feed_bytes(begin)
        for _ in range(16):
            assert decoder.feed_bytes(b"\x00" * 4096) == []
        assert decoder.refused.total() >= 16 * 4096 - 84
