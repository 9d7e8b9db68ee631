"""The protocol of Slamtec RPLIDAR A1 and A2: requests and answers at 115200 baud, 8N1, little endian.

Source: Slamtec's "RPLIDAR Interface Protocol and Application Notes". A request is A5 and a command; an answer begins
with a descriptor, A5 5A, that tells its length and kind, and scans go on until they are stopped. Angles are 64ths of a
degree and grow clockwise, seen from above; distances are quarters of a millimetre, 0 is no reading.
"""

import struct
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import reduce
from operator import xor
from typing import NamedTuple, TypeAlias

BAUD = 115_200
OTHER_BAUDS = (256_000, 460_800, 1_000_000)
"""What other models than A1 and A2M8 speak, as the launch files of the maker's ROS driver have it.

256000: A2M7, A2M12, A3, S1; 460800: C1; 1000000: S2, S3.
"""
START = 0xA5
DESCRIPTOR = struct.Struct("<HIB")
DESCRIPTOR_START = b"\xa5\x5a"
FULL_TURN_Q6 = 360 << 6
CABINS = 16
POINTS = 2 * CABINS


class RequestCode(IntEnum):
    """The commands that take no payload."""

    STOP = 0x25
    RESET = 0x40
    SCAN = 0x20
    GET_INFO = 0x50
    GET_HEALTH = 0x52


EXPRESS_SCAN = 0x82
"""Has a payload: its mode, 0 for the legacy one, and four reserved bytes. Since firmware 1.17."""


class HealthStatus(IntEnum):
    """What the device says of itself; after ``ERROR`` it does not scan before a reset."""

    GOOD = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Which device this is; ``model`` 0x18 is an A1, 0x28 an A2M4-R4 (the upper half is the series)."""

    model: int
    firmware: tuple[int, int]
    hardware: int
    serial: str


@dataclass(frozen=True, slots=True)
class DeviceHealth:
    """The device's health, and its own number of what is wrong."""

    status: HealthStatus
    error_code: int


@dataclass(frozen=True, slots=True)
class SampleRate:
    """Microseconds a point, in the standard and in the express scan."""

    standard_us: int
    express_us: int


@dataclass(frozen=True, slots=True)
class ScanNode:
    """One point of a standard scan; ``starts_turn`` marks the first of a turn."""

    starts_turn: bool
    quality: int
    angle_q6: int
    distance_q2: int


@dataclass(frozen=True, slots=True)
class Capsule:
    """Thirty-two points of an express scan, which ``angles_q6`` places once the next capsule's start is known.

    ``is_first`` marks the first capsule after the request. ``offset_q3`` are eighths of a degree.
    """

    is_first: bool
    start_q6: int
    distance_mm: tuple[int, ...]
    offset_q3: tuple[int, ...]

    def angles_q6(self, next_start_q6: int) -> tuple[float, ...]:
        """The angle of each point, clockwise, in [0, 23040): even steps to the next capsule, less the point's offset.

        The manual calls the offset's top bit a sign; the maker's own driver takes six bits without one, and only so can
        it hold the up to 7.5 degrees by which a near point is off the axis. We follow the driver.
        """
        step = ((next_start_q6 - self.start_q6) % FULL_TURN_Q6) / POINTS
        return tuple(
            [
                (self.start_q6 + step * index - 8 * offset) % FULL_TURN_Q6
                for index, offset in enumerate(self.offset_q3)
            ]
        )


Answer: TypeAlias = DeviceInfo | DeviceHealth | SampleRate | ScanNode | Capsule


def request(command: RequestCode) -> bytes:
    """The bytes of a request."""
    return bytes((START, command))


def express_request() -> bytes:
    """The bytes that start an express scan: command, payload's size, payload, and the XOR of all before."""
    message = bytes((START, EXPRESS_SCAN, 5, 0, 0, 0, 0, 0))
    return message + bytes((reduce(xor, message),))


SET_MOTOR_PWM = 0xF0
"""Of the accessory board between an A2 and its USB plug: how fast the motor is to turn, 0 to 1023."""


def motor_request(pwm: int) -> bytes:
    """The bytes that set an A2's motor; 0 stops it.

    Raises:
        struct.error: it does not fit the wire.
    """
    message = struct.pack("<BBBH", START, SET_MOTOR_PWM, 2, pwm)
    return message + bytes((reduce(xor, message),))


def _read_info(raw: bytes) -> DeviceInfo:
    model, minor, major, hardware = raw[:4]
    return DeviceInfo(model, (major, minor), hardware, raw[4:].hex().upper())


def _read_health(raw: bytes) -> DeviceHealth | None:
    status, code = struct.unpack("<BH", raw)
    return DeviceHealth(HealthStatus(status), code) if status in HealthStatus.__members__.values() else None


def _read_sample_rate(raw: bytes) -> SampleRate:
    return SampleRate(*struct.unpack("<HH", raw))


def _read_node(raw: bytes) -> ScanNode | None:
    """None where the check bits say that this is no node: S and its inverse, and the constant 1."""
    flags, angle, distance = struct.unpack("<BHH", raw)
    if flags & 1 == flags >> 1 & 1 or not angle & 1 or angle >> 1 >= FULL_TURN_Q6:
        return None
    return ScanNode(bool(flags & 1), flags >> 2, angle >> 1, distance)


def _read_capsule(raw: bytes) -> Capsule | None:
    """None where the sync nibbles or the checksum say that this is no capsule."""
    if raw[0] >> 4 != 0xA or raw[1] >> 4 != 0x5:
        return None
    if reduce(xor, raw[2:]) != raw[0] & 0xF | raw[1] << 4 & 0xF0:
        return None
    (start,) = struct.unpack_from("<H", raw, 2)
    if start & 0x7FFF >= FULL_TURN_Q6:
        return None
    distance_mm: list[int] = []
    offset_q3: list[int] = []
    for first, second, offsets in struct.iter_unpack("<HHB", raw[4:]):
        distance_mm += (first >> 2, second >> 2)
        offset_q3 += ((first & 3) << 4 | offsets & 0xF, (second & 3) << 4 | offsets >> 4)
    return Capsule(bool(start >> 15), start & 0x7FFF, tuple(distance_mm), tuple(offset_q3))


@dataclass(frozen=True, slots=True)
class _Kind:
    """A row of the table of answers: one payload's size, whether more follow, and how it is read."""

    size: int
    repeats: bool
    read: Callable[[bytes], Answer | None]
    sure_after: int = 1


KINDS = {
    0x04: _Kind(20, False, _read_info),
    0x06: _Kind(3, False, _read_health),
    0x15: _Kind(4, False, _read_sample_rate),
    0x81: _Kind(5, True, _read_node, sure_after=4),
    0x82: _Kind(84, True, _read_capsule),
}
"""By the descriptor's last byte. A node has three check bits only: four good ones in a row end a search for the next."""


class RplidarDecoderState(NamedTuple):
    """The answer in progress by its code in ``KINDS`` (None: a descriptor is awaited), and what was passed over."""

    data: bytes
    code: int | None
    is_sure: bool
    refused: dict[str, int]


class RplidarDecoder:
    """Bytes to answers; how the bytes are chunked makes no difference, and no more than a few payloads are ever kept.

    ``refused`` counts what was passed over, by byte: ``noise`` where a descriptor should be, ``scan`` within a scan.
    """

    def __init__(self) -> None:
        self._data, self._at = b"", 0
        self._kind: _Kind | None = None
        self._is_sure = True
        self.refused: Counter[str] = Counter()

    def state(self) -> RplidarDecoderState:
        """What it remembers."""
        code = next((code for code, kind in KINDS.items() if kind is self._kind), None)
        return RplidarDecoderState(self._data[self._at :], code, self._is_sure, dict(self.refused))

    def restore(self, state: RplidarDecoderState) -> None:
        """Go on from there; raises ``KeyError`` for a code that no answer has."""
        self._data, self._at, self._is_sure = state.data, 0, state.is_sure
        self._kind, self.refused = None if state.code is None else KINDS[state.code], Counter(state.refused)

    def reset(self) -> None:
        """Forget the answer in progress: a request has been sent, or the connection is another."""
        self._data, self._at, self._kind, self._is_sure = b"", 0, None, True

    def feed_bytes(self, data: bytes) -> list[Answer]:
        """The answers that ``data`` completes."""
        self._data, self._at = self._data[self._at :] + data, 0
        answers: list[Answer] = []
        while self._find_descriptor() if self._kind is None else self._read_payload(self._kind, answers):
            pass
        return answers

    def _find_descriptor(self) -> bool:
        """Whether one was there; what stands before it is noise."""
        start = self._data.find(DESCRIPTOR_START, self._at)
        if start < 0:
            start = len(self._data) - self._data.endswith(DESCRIPTOR_START[:1], self._at)
        self._skip(start - self._at, "noise")
        if len(self._data) - self._at < DESCRIPTOR.size:
            return False
        _, length, code = DESCRIPTOR.unpack_from(self._data, self._at)
        kind = KINDS.get(code)
        if kind is None or length & 0x3FFFFFFF != kind.size:
            self._skip(1, "noise")
            return True
        self._at, self._kind, self._is_sure = self._at + DESCRIPTOR.size, kind, True
        return True

    def _read_payload(self, kind: _Kind, answers: list[Answer]) -> bool:
        """Whether a payload was there, or a byte to be passed over."""
        if len(self._data) - self._at < kind.size * (1 if self._is_sure else kind.sure_after):
            return False
        answer = self._read_at(kind, self._at)
        good = answer is not None and (self._is_sure or self._more_follow(kind))
        if not kind.repeats:
            self._kind = None
        self._is_sure = good
        if answer is None or not good:
            self._skip(1, "scan" if kind.repeats else "noise")
            return True
        self._at += kind.size
        answers.append(answer)
        return True

    def _more_follow(self, kind: _Kind) -> bool:
        """Whether the payloads after this one are good too: by chance alone they would not be."""
        starts = [self._at + kind.size * index for index in range(1, kind.sure_after)]
        return all(self._read_at(kind, start) is not None for start in starts)

    def _read_at(self, kind: _Kind, start: int) -> Answer | None:
        return kind.read(self._data[start : start + kind.size])

    def _skip(self, size: int, why: str) -> None:
        if size:
            self.refused[why] += size
            self._at += size


def descriptor(code: int) -> bytes:
    """The descriptor before an answer of this kind, as the device sends it."""
    kind = KINDS[code]
    return DESCRIPTOR_START + DESCRIPTOR.pack(0, kind.size | kind.repeats << 30, code)[2:]


def encode_node(node: ScanNode) -> bytes:
    """The device's bytes of one point of a standard scan."""
    flags = node.quality << 2 | (1 if node.starts_turn else 2)
    return struct.pack("<BHH", flags, node.angle_q6 << 1 | 1, node.distance_q2)


def encode_capsule(capsule: Capsule) -> bytes:
    """The device's bytes of one capsule of an express scan."""
    body = struct.pack("<H", capsule.start_q6 | capsule.is_first << 15)
    pairs = zip(capsule.distance_mm, capsule.offset_q3, strict=True)
    for (first_mm, first_q3), (second_mm, second_q3) in zip(pairs, pairs, strict=True):
        first, second = first_mm << 2 | first_q3 >> 4, second_mm << 2 | second_q3 >> 4
        body += struct.pack("<HHB", first, second, first_q3 & 0xF | (second_q3 & 0xF) << 4)
    check = reduce(xor, body)
    return bytes((0xA0 | check & 0xF, 0x50 | check >> 4)) + body
