"""Lidars in a room, as bytes: what an LD19 or an RPLIDAR sends, turn by turn, and the end of an RPLIDAR that answers."""

import itertools
import math
import random
from collections.abc import Callable, Iterator

from firmware_protocol.lidar import ld19, rplidar
from firmware_protocol.lidar.rplidar import HealthStatus

PACKET_CDEG = 960
"""37.5 packets are a turn, so that turns begin within packets too."""

LD19_STEP_CDEG = 80
"""Twelve points: 8.8 degrees from the first to the last, and as much to the next packet's first."""

Room = Callable[[float, float], int]
"""Distance in mm by the bearing (counter-clockwise, rad) and the lidar's time in s."""


def noisy_box(seed: int = 1, ahead_m: float = 2.0, left_m: float = 1.0) -> Room:
    """A box about the lidar: walls ``ahead_m`` before and behind, ``left_m`` left and right; noise of 5 mm."""
    rng = random.Random(seed)

    def distance_mm(bearing_rad: float, at_s: float) -> int:
        cos, sin = abs(math.cos(bearing_rad)) + 1e-9, abs(math.sin(bearing_rad)) + 1e-9
        return round(1000 * min(ahead_m / cos, left_m / sin) + rng.gauss(0, 5))

    return distance_mm


def ld19_packets(
    room: Room, *, start_cdeg: int = 12_340, start_ms: int = 29_500, speed_deg_s: int = 3600
) -> Iterator[tuple[float, bytes]]:
    """Each packet with the time of its last point, from 0 s on; the stamps wrap soon after the beginning."""
    for index in itertools.count():
        begin_cdeg = start_cdeg + index * PACKET_CDEG
        angles = [begin_cdeg + LD19_STEP_CDEG * point for point in range(ld19.POINTS)]
        at_s = (angles[-1] - start_cdeg) / 100 / speed_deg_s
        distances = tuple(room(-math.radians(angle / 100), at_s) for angle in angles)
        packet = ld19.Ld19Packet(
            speed_deg_s=speed_deg_s,
            start_cdeg=begin_cdeg % ld19.FULL_TURN_CDEG,
            end_cdeg=angles[-1] % ld19.FULL_TURN_CDEG,
            distance_mm=distances,
            intensity=(200,) * ld19.POINTS,
            stamp_ms=(start_ms + round(at_s * 1000)) % ld19.TIME_SPAN_MS,
        )
        yield at_s, ld19.encode(packet)


def ld19_bytes(room: Room, packets: int, **keywords: int) -> list[bytes]:
    """So many packets."""
    return [data for _, data in itertools.islice(ld19_packets(room, **keywords), packets)]


def stalled_ld19_packets(count: int) -> Iterator[tuple[float, bytes]]:
    """An LD19 whose motor stands still: packets as ever, all of the same angles."""
    for index in range(count):
        packet = ld19.Ld19Packet(0, 5_000, 5_010, (700 + index % 9,) * 12, (200,) * 12, index * 3 % 30_000)
        yield index * 0.003, ld19.encode(packet)


class FakeRplidar:
    """An RPLIDAR that answers requests; it sends a scan, ``step`` after ``step``, only while one is asked for."""

    def __init__(self, room: Room, *, model: int = 0x18, firmware: tuple[int, int] = (1, 17)) -> None:
        self.room, self.model, self.firmware = room, model, firmware
        self.health = HealthStatus.GOOD
        self.scanning: str | None = None
        self.requests: list[int] = []
        self.offers_express = True
        self.motor_turns = True
        self.now_s = 0.0
        self._nodes = 0
        self.sent: Callable[[bytes], None] = lambda data: None

    def receive(self, data: bytes) -> None:
        """Bytes from the host: requests, each whole."""
        while data:
            assert data[0] == rplidar.START
            command = data[1]
            size = 2 if command < 0x80 else 4 + data[2]
            self.requests.append(command)
            self._answer(command)
            data = data[size:]

    def _answer(self, command: int) -> None:
        if command == rplidar.RequestCode.STOP:
            self.scanning = None
        elif command == rplidar.RequestCode.GET_INFO:
            minor, major = self.firmware[1], self.firmware[0]
            self.sent(rplidar.descriptor(0x04) + bytes((self.model, minor, major, 5)) + bytes(range(16)))
        elif command == rplidar.RequestCode.GET_HEALTH:
            self.sent(rplidar.descriptor(0x06) + bytes((self.health, 0x34, 0x12)))
        elif command == rplidar.RequestCode.RESET:
            self.health = HealthStatus.GOOD
            self.sent(b"RP LIDAR System.\r\nFirmware Ver 1.17\r\n")
        elif command == rplidar.RequestCode.SCAN:
            self.scanning = "standard"
            self.sent(rplidar.descriptor(0x81))
        elif command == rplidar.EXPRESS_SCAN and self.offers_express:
            self.scanning = "express"
            self.sent(rplidar.descriptor(0x82))

    def turn(self) -> None:
        """Send what belongs to a hundredth of a second, at 10 turns a second."""
        self.now_s += 0.01
        if not self.motor_turns or self.scanning is None:
            return
        if self.scanning == "standard":
            for _ in range(36):
                self._send_node()
        else:
            self._send_capsule()

    def _send_node(self) -> None:
        degrees = self._nodes % 360
        self._nodes += 1
        distance = self.room(-math.radians(degrees), self.now_s)
        self.sent(rplidar.encode_node(rplidar.ScanNode(degrees == 0, 47, degrees << 6, distance * 4)))

    def _send_capsule(self) -> None:
        """32 points of 1.125 degrees are 36 degrees: ten capsules a turn."""
        begin_q6 = self._nodes * 72 % rplidar.FULL_TURN_Q6
        angles = [begin_q6 + 72 * index for index in range(rplidar.POINTS)]
        distances = tuple(self.room(-math.radians(angle / 64), self.now_s) for angle in angles)
        self._nodes += rplidar.POINTS
        capsule = rplidar.Capsule(False, begin_q6, distances, (0,) * rplidar.POINTS)
        self.sent(rplidar.encode_capsule(capsule))
