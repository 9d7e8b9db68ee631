"""Runs a simulated lidar in an event loop, on the robot that a simulated board drives."""

import asyncio
import math
from collections.abc import Callable

from chefbotd.clock import Clock
from chefbotd.sim.board import BoardRunner
from chefbotd.sim.lidar_faults import LidarFault, LidarLine
from chefbotd.sim.spinning import SpinningLidar


class LidarRunner:
    """Sends the lidar's packets each time its USB converter hands over.

    Its time is that of the board: both are powered on together.
    """

    def __init__(
        self,
        lidar: SpinningLidar,
        board: BoardRunner,
        send: Callable[[bytes], None],
        clock: Clock,
        *,
        handover_s: float = 0.01,
        seed: int = 0,
    ) -> None:
        self._lidar, self._board, self._send, self._clock = lidar, board, send, clock
        self._handover_s = handover_s
        self._line = LidarLine(seed, lidar.turn_packets)

    @property
    def fault(self) -> LidarFault | None:
        """What is wrong with the lidar."""
        return self._line.fault

    @fault.setter
    def fault(self, fault: LidarFault | None) -> None:
        now_s = self._board.board_s()
        if fault is LidarFault.STALLED:
            self._lidar.stall(now_s)
        elif self._line.fault is LidarFault.STALLED:
            self._lidar.release(now_s)
        self._line.fault = fault

    def receive(self, data: bytes) -> None:
        """Bytes from the host; the lidar answers at once, or not at all."""
        answer = self._lidar.receive(data)
        if answer and (carried := self._line.carry_answer(answer)):
            self._send(carried)

    def turn(self, by_rad: float) -> None:
        """Turn the lidar in its mount, which the configuration does not know."""
        self._lidar.turn(by_rad)

    async def run(self) -> None:
        """Measure and send until cancelled."""
        while True:
            now_s = self._board.board_s()
            due_s = (math.floor(now_s / self._handover_s + 1e-6) + 1) * self._handover_s
            await asyncio.sleep(due_s - now_s)
            self._send_what_has_left()

    def _send_what_has_left(self) -> None:
        now_s = self._board.board_s()
        trail = self._board.trail(self._lidar.measured_s)
        packets = self._lidar.advance(now_s, trail, self._board.crowd.discs)
        if data := self._line.carry(packets):
            self._send(data)
