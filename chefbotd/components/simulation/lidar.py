"""Runs simulated lidars in an event loop, on the robot that a simulated board drives, with faults on their lines."""

import asyncio
import math
import random
from collections import deque
from collections.abc import Callable, Sequence
from enum import StrEnum

from chefbotd.clock import Clock
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.parameters.simulation import HANDOVER_S
from chefbotd.components.simulation.spinning import SpinningLidar

BITS_A_BYTE = 10
TURN_PACKETS = 38


class LidarFault(StrEnum):
    """A fault of the lidar, for as long as it is set.

    ``silent``: nothing comes. ``garbage``: other bytes, as many. ``cut``: each packet lacks some of its bytes.
    ``doubled``: each packet comes twice. ``frozen``: the last turn comes again and again. ``wrong_baud``: the host
    listens at half the rate. ``stalled``: something holds the motor.
    """

    SILENT = "silent"
    GARBAGE = "garbage"
    CUT = "cut"
    DOUBLED = "doubled"
    FROZEN = "frozen"
    WRONG_BAUD = "wrong_baud"
    STALLED = "stalled"


class LidarLine:
    """Carries packets to the host, changed by the ``fault`` in force."""

    def __init__(self, seed: int, turn_packets: int = TURN_PACKETS) -> None:
        self._chance = random.Random(seed)
        self._last_turn: deque[bytes] = deque(maxlen=turn_packets)
        self.fault: LidarFault | None = None

    def carry(self, packets: Sequence[bytes]) -> bytes:
        """The bytes that arrive of the next packets."""
        match self.fault:
            case None | LidarFault.STALLED:
                self._last_turn.extend(packets)
                return b"".join(packets)
            case LidarFault.SILENT:
                return b""
            case LidarFault.GARBAGE:
                return b"".join(self._chance.randbytes(len(packet)) for packet in packets)
            case LidarFault.CUT:
                return b"".join(self._cut(packet) for packet in packets)
            case LidarFault.DOUBLED:
                return b"".join(packet + packet for packet in packets)
            case LidarFault.FROZEN:
                return b"".join(self._again(packet) for packet in packets)
            case LidarFault.WRONG_BAUD:
                return heard_at(b"".join(packets), 0.5)

    def carry_answer(self, answer: bytes) -> bytes:
        """The bytes that arrive of an answer. It is no packet, so ``doubled`` and ``frozen`` do not affect it."""
        match self.fault:
            case LidarFault.SILENT:
                return b""
            case LidarFault.GARBAGE:
                return self._chance.randbytes(len(answer))
            case LidarFault.CUT:
                return self._cut(answer)
            case LidarFault.WRONG_BAUD:
                return heard_at(answer, 0.5)
            case _:
                return answer

    def _cut(self, packet: bytes) -> bytes:
        begin = self._chance.randrange(len(packet))
        return packet[:begin] + packet[begin + self._chance.randint(1, 20) :]

    def _again(self, packet: bytes) -> bytes:
        if not self._last_turn:
            return packet
        self._last_turn.rotate(-1)
        return self._last_turn[-1]


def heard_at(data: bytes, share: float) -> bytes:
    """The bytes that a receiver reads when it listens at a share of the sender's rate (8N1, sent without a pause)."""
    bits = [bit for byte in data for bit in (0, *(byte >> place & 1 for place in range(8)), 1)]
    heard, at, width = bytearray(), 0, 1 / share
    while at + BITS_A_BYTE * width <= len(bits):
        if bits[at]:
            at += 1
            continue
        sampled = [bits[int(at + (place + 0.5) * width)] for place in range(1, BITS_A_BYTE)]
        at = math.ceil(at + (BITS_A_BYTE - 0.5) * width)
        if sampled[-1]:  # otherwise there is no stop bit: a framing error, which is no byte
            heard.append(sum(bit << place for place, bit in enumerate(sampled[:8])))
    return bytes(heard)


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
        seed: int = 0,
    ) -> None:
        self._lidar, self._board, self._send, self._clock = lidar, board, send, clock
        self._line = LidarLine(seed, lidar.turn_packets)

    @property
    def fault(self) -> LidarFault | None:
        """The fault in force; None for a healthy lidar."""
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
        """Turn the lidar in its mount; the configuration does not know it."""
        self._lidar.turn(by_rad)

    async def run(self) -> None:
        """Measure and send until cancelled."""
        while True:
            now_s = self._board.board_s()
            due_s = (math.floor(now_s / HANDOVER_S + 1e-6) + 1) * HANDOVER_S
            await asyncio.sleep(due_s - now_s)
            self._send_what_has_left()

    def _send_what_has_left(self) -> None:
        now_s = self._board.board_s()
        trail = self._board.trail(self._lidar.measured_s)
        packets = self._lidar.send_packets(now_s, trail, self._board.crowd.discs)
        if data := self._line.carry(packets):
            self._send(data)
