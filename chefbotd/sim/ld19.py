"""A simulated LD19 on the robot: it sends packets without a request."""

import numpy as np

from chefbotd.sim.arrays import Vector
from chefbotd.sim.spinning import SpinningLidar
from firmware_protocol.lidar.ld19 import (
    BAUD,
    FULL_TURN_CDEG,
    PACKET,
    POINTS,
    TIME_SPAN_MS,
    Ld19Packet,
    encode,
)

DISTANCE_MAX_MM = 65_535


class SimulatedLd19(SpinningLidar):
    """While something holds its motor, it goes on measuring in one direction (assumed)."""

    points = POINTS
    transmission_s = PACKET.size * 10 / BAUD

    def _packed(self, point_s: Vector, turned: Vector, distance_m: Vector, intensity: Vector) -> list[bytes]:
        distance_mm = np.minimum(np.rint(distance_m * 1000), DISTANCE_MAX_MM)
        cdeg = (np.rint(turned * FULL_TURN_CDEG) % FULL_TURN_CDEG).astype(int).reshape(-1, POINTS)
        speed = np.rint((turned[POINTS - 1 :: POINTS] - turned[::POINTS]) * 360 / self._span_s).astype(int)
        stamps_ms = (point_s[POINTS - 1 :: POINTS] * 1000).astype(int) % TIME_SPAN_MS
        rows = zip(
            speed.tolist(),
            cdeg[:, 0].tolist(),
            cdeg[:, -1].tolist(),
            distance_mm.astype(int).reshape(-1, POINTS).tolist(),
            intensity.astype(int).reshape(-1, POINTS).tolist(),
            stamps_ms.tolist(),
            strict=True,
        )
        return [encode(Ld19Packet(*row)) for row in rows]

    @property
    def _span_s(self) -> float:
        return (POINTS - 1) / self._flaws.points_per_s
