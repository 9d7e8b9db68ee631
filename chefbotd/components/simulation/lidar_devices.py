"""The simulated lidars: an LD19, which sends without a request, and an RPLIDAR A1 or A2, which answers requests.

An RPLIDAR sends a standard or an express scan once one is requested. The motor of an A1 is switched by DTR, which does
not pass a pseudo-terminal: it always turns. That of an A2 turns on request. Points and turns a second are those of
Slamtec's data sheets for the standard scan (A1M8: 2000 and 5.5; A2M8 at 115200 baud: 2000 and 10); 4000 points of an
express scan fill the line. No near point is off its even place in a capsule, as those of a real lidar are.
"""

from functools import reduce
from operator import xor
from typing import Final

import numpy as np

from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.parameters.simulation import ExpressScan, LidarFlaws
from chefbotd.components.simulation.spinning import LidarMount, LidarWire, Sight, SpinningLidar
from firmware_protocol.lidar import ld19
from firmware_protocol.lidar.rplidar import (
    BAUD,
    EXPRESS_SCAN,
    FULL_TURN_Q6,
    POINTS,
    SET_MOTOR_PWM,
    START,
    Capsule,
    HealthStatus,
    RequestCode,
    ScanNode,
    descriptor,
    encode_capsule,
    encode_node,
)

DISTANCE_MAX_MM = 65_535


class SimulatedLd19(SpinningLidar):
    """While its motor is held, it continues to measure in one direction (assumed)."""

    points = ld19.POINTS
    transmission_s = ld19.PACKET.size * 10 / ld19.BAUD

    def _packed(self, point_s: Vector, turned: Vector, distance_m: Vector, intensity: Vector) -> list[bytes]:
        distance_mm = np.minimum(np.rint(distance_m * 1000), DISTANCE_MAX_MM).astype(int)
        ends = turned.reshape(-1, ld19.POINTS)[:, [0, -1]]
        rows = zip(
            np.rint((ends[:, 1] - ends[:, 0]) * 360 / self._span_s).astype(int).tolist(),
            (np.rint(ends * ld19.FULL_TURN_CDEG) % ld19.FULL_TURN_CDEG).astype(int).tolist(),
            distance_mm.reshape(-1, ld19.POINTS).tolist(),
            intensity.astype(int).reshape(-1, ld19.POINTS).tolist(),
            point_s[ld19.POINTS - 1 :: ld19.POINTS].tolist(),
            strict=True,
        )
        packets = (
            ld19.Ld19Packet(
                speed, first, last, tuple(distances), tuple(bright), int(end_s * 1000) % ld19.TIME_SPAN_MS
            )
            for speed, (first, last), distances, bright, end_s in rows
        )
        return [ld19.encode(packet) for packet in packets]

    @property
    def _span_s(self) -> float:
        return (ld19.POINTS - 1) / self._flaws.points_per_s


NODE_BYTES, CAPSULE_BYTES = 5, 84
INFO, HEALTH, SCAN, EXPRESS = 0x04, 0x06, 0x81, 0x82
"""The kinds of its answers."""

POINTS_PER_S, EXPRESS_POINTS_PER_S = 2000.0, 4000.0
TURNS_PER_S: Final = {LidarWire.RPLIDAR_A1: 5.5, LidarWire.RPLIDAR_A2: 10.0}
MODEL: Final = {LidarWire.RPLIDAR_A1: 0x18, LidarWire.RPLIDAR_A2: 0x28}
NEAREST_M: Final = 0.15
FIRMWARE_MINOR: Final = {ExpressScan.OFFERED: 29, ExpressScan.PROMISED: 29, ExpressScan.ABSENT: 15}
FIRMWARE_MAJOR, HARDWARE = 1, 5
BOOT_TEXT: Final = b"RP LIDAR System.\r\nFirmware Ver 1.%d, HW Ver 5\r\n"
"""What an A1 prints after a reset (assumed)."""

FARTHEST_Q2, FARTHEST_MM = 0xFFFF, 0x3FFF


class SimulatedRplidar(SpinningLidar):
    """``health`` is what it says of itself; with an error it does not scan before a reset."""

    points = 1
    transmission_s = NODE_BYTES * 10 / BAUD

    def __init__(self, flaws: LidarFlaws, mount: LidarMount, sight: Sight, seed: int) -> None:
        rates = {"points_per_s": POINTS_PER_S, "turns_per_s": TURNS_PER_S[mount.wire]}
        nearest_m = max(flaws.min_range_m, NEAREST_M)
        super().__init__(flaws.model_copy(update={**rates, "min_range_m": nearest_m}), mount, sight, seed)
        self._unread = b""
        self._is_scanning = self._is_express = self._is_first = False
        self._turns_motor = mount.wire is LidarWire.RPLIDAR_A1
        self._turn: int | None = None
        self._serial = bytes((seed + index) % 256 for index in range(16))
        self.health = HealthStatus.GOOD

    @property
    def sends(self) -> bool:
        """Whether a scan was requested and the motor turns; while it stands, there are no points (assumed)."""
        return self._is_scanning and self._turns_motor and not self.is_stalled

    def receive(self, data: bytes) -> bytes:
        """Take requests in pieces of any size; bytes that begin no request are skipped."""
        self._unread += data
        answers = b""
        while (size := self._request_size()) is not None:
            if size:
                answers += self._answer(self._unread[:size])
            self._unread = self._unread[max(size, 1) :]
        return answers

    def _request_size(self) -> int | None:
        """The length of the request that begins here; 0 if none begins here, None if it is not complete yet."""
        unread = self._unread
        if unread and unread[0] != START:
            return 0
        if len(unread) < 2:
            return None
        if unread[1] < 0x80:
            return 2
        if len(unread) < 3 or len(unread) < unread[2] + 4:
            return None
        size = unread[2] + 4
        return size if reduce(xor, unread[: size - 1]) == unread[size - 1] else 0

    def _answer(self, request: bytes) -> bytes:
        match request[1]:
            case RequestCode.STOP:
                self._is_scanning = False
            case RequestCode.RESET:
                self._is_scanning, self.health = False, HealthStatus.GOOD
                return BOOT_TEXT % FIRMWARE_MINOR[self._flaws.express]
            case RequestCode.GET_INFO:
                minor = FIRMWARE_MINOR[self._flaws.express]
                info = bytes((MODEL[self._mount.wire], minor, FIRMWARE_MAJOR, HARDWARE))
                return descriptor(INFO) + info + self._serial
            case RequestCode.GET_HEALTH:
                return descriptor(HEALTH) + bytes((self.health, 0, 0))
            case RequestCode.SCAN if self.health is not HealthStatus.ERROR:
                self._is_scanning, self._is_express, self._turn = True, False, None
                self._send_packets_of(1, NODE_BYTES * 10 / BAUD, POINTS_PER_S)
                return descriptor(SCAN)
            case code if code == EXPRESS_SCAN and self._does_express:
                self._is_scanning = self._is_express = self._is_first = True
                self._send_packets_of(POINTS, CAPSULE_BYTES * 10 / BAUD, EXPRESS_POINTS_PER_S)
                return descriptor(EXPRESS)
            case code if code == SET_MOTOR_PWM and self._mount.wire is LidarWire.RPLIDAR_A2:
                self._turns_motor = any(request[3:5])
        return b""

    @property
    def _does_express(self) -> bool:
        return self._flaws.express is ExpressScan.OFFERED and self.health is not HealthStatus.ERROR

    def _packed(self, point_s: Vector, turned: Vector, distance_m: Vector, intensity: Vector) -> list[bytes]:
        if self._is_express:
            return self._capsules(turned, distance_m)
        angle_q6 = (np.floor(turned * FULL_TURN_Q6) % FULL_TURN_Q6).astype(int).tolist()
        distance_q2 = np.minimum(np.rint(distance_m * 4000), FARTHEST_Q2).astype(int).tolist()
        quality = (intensity.astype(int) >> 2).tolist()
        turns = np.floor(turned).astype(int).tolist()
        nodes = []
        for turn, angle, distance, good in zip(turns, angle_q6, distance_q2, quality, strict=True):
            starts, self._turn = self._turn is not None and turn != self._turn, turn
            nodes.append(encode_node(ScanNode(starts, min(good, 0x3F), angle, distance)))
        return nodes

    def _capsules(self, turned: Vector, distance_m: Vector) -> list[bytes]:
        start_q6 = (np.floor(turned[::POINTS] * FULL_TURN_Q6) % FULL_TURN_Q6).astype(int).tolist()
        distance_mm = np.minimum(np.rint(distance_m * 1000), FARTHEST_MM).astype(int).reshape(-1, POINTS)
        capsules = []
        for start, distances in zip(start_q6, distance_mm.tolist(), strict=True):
            capsules.append(encode_capsule(Capsule(self._is_first, start, tuple(distances), (0,) * POINTS)))
            self._is_first = False
        return capsules
