"""The protocol of LDROBOT LD06 and LD19: one-way packets of 47 bytes at 230400 baud, 8N1, little endian.

Source: LDROBOT's LD06 and LD19 development manuals. Angles are hundredths of a degree and grow clockwise, seen from
above. A packet has twelve points, evenly spaced from its start angle to its end angle; distance 0 is no reading.
"""

import struct
from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

HEADER = b"\x54\x2c"
POINTS = 12
PACKET = struct.Struct("<2sHH" + "HB" * POINTS + "HHB")
FULL_TURN_CDEG = 36_000
TIME_SPAN_MS = 30_000
BAUD = 230_400


@dataclass(frozen=True, slots=True)
class Ld19Packet:
    """Twelve points by ``distance_mm`` and ``intensity``; ``speed_deg_s`` is the motor's, ``stamp_ms`` wraps at 30 s."""

    speed_deg_s: int
    start_cdeg: int
    end_cdeg: int
    distance_mm: tuple[int, ...]
    intensity: tuple[int, ...]
    stamp_ms: int

    @property
    def span_cdeg(self) -> int:
        """The angle from the first point to the last, clockwise."""
        return (self.end_cdeg - self.start_cdeg) % FULL_TURN_CDEG

    def angles_cdeg(self) -> tuple[float, ...]:
        """The angle of each point, clockwise, in [0, 36000)."""
        step = self.span_cdeg / (POINTS - 1)
        return tuple([(self.start_cdeg + step * index) % FULL_TURN_CDEG for index in range(POINTS)])


def _crc_table() -> bytes:
    """CRC-8 with the polynomial 0x4D, most significant bit first, from 0."""
    table = []
    for value in range(256):
        for _ in range(8):
            value = (value << 1) ^ 0x4D if value & 0x80 else value << 1
        table.append(value & 0xFF)
    return bytes(table)


CRC_TABLE = _crc_table()


def crc8(data: bytes) -> int:
    """The checksum of a packet's first 46 bytes."""
    crc = 0
    for byte in data:
        crc = CRC_TABLE[crc ^ byte]
    return crc


def encode(packet: Ld19Packet) -> bytes:
    """The packet's bytes, as the device sends them.

    Raises:
        struct.error: a field does not fit the wire.
    """
    points = [value for pair in zip(packet.distance_mm, packet.intensity, strict=True) for value in pair]
    fields = (HEADER, packet.speed_deg_s, packet.start_cdeg, *points, packet.end_cdeg, packet.stamp_ms, 0)
    body = PACKET.pack(*fields)[:-1]
    return body + bytes([crc8(body)])


class Ld19DecoderState(NamedTuple):
    """The packet in progress, and what was counted."""

    rest: bytes
    packets: int
    refused: dict[str, int]


class Ld19Decoder:
    """Bytes to packets; how the bytes are chunked makes no difference, and no more than a packet is ever kept.

    ``packets`` counts the good ones. ``refused`` counts what was passed over: ``noise`` by byte, and packets whose
    checksum is wrong (``checksum``) or whose fields no device sends (``fields``).
    """

    def __init__(self) -> None:
        self._rest = b""
        self.packets = 0
        self.refused: Counter[str] = Counter()

    def state(self) -> Ld19DecoderState:
        """What it remembers."""
        return Ld19DecoderState(self._rest, self.packets, dict(self.refused))

    def restore(self, state: Ld19DecoderState) -> None:
        """Go on from there."""
        self._rest, self.packets, self.refused = state.rest, state.packets, Counter(state.refused)

    def feed_bytes(self, data: bytes) -> list[Ld19Packet]:
        """The packets that ``data`` completes."""
        data, at, packets = self._rest + data, 0, []
        while (start := self._next_header(data, at)) + PACKET.size <= len(data):
            packet = self._read_packet(data[start : start + PACKET.size])
            if packet is None:
                at = start + 1  # the header may have been part of another packet
                continue
            packets.append(packet)
            at = start + PACKET.size
        self._rest = data[start:]
        self.packets += len(packets)
        return packets

    def reset(self) -> None:
        """Forget the packet in progress: what comes next is from another connection."""
        self._rest = b""

    def _next_header(self, data: bytes, at: int) -> int:
        """Where the next packet can begin: at a header, or at the end, where half of one may stand."""
        start = data.find(HEADER, at)
        if start < 0:
            start = len(data) - data.endswith(HEADER[:1], at)
        if start > at:
            self.refused["noise"] += start - at
        return start

    def _read_packet(self, raw: bytes) -> Ld19Packet | None:
        if crc8(raw[:-1]) != raw[-1]:
            self.refused["checksum"] += 1
            return None
        _, speed, start, *points, end, stamp, _ = PACKET.unpack(raw)
        if start >= FULL_TURN_CDEG or end >= FULL_TURN_CDEG:
            self.refused["fields"] += 1
            return None
        return Ld19Packet(speed, start, end, tuple(points[::2]), tuple(points[1::2]), stamp)
