"""Faults of a lidar's bytes on the way to the host."""

import math
import random
from collections import deque
from collections.abc import Sequence
from enum import StrEnum

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
    """Carries packets to the host, as the ``fault`` in force lets it."""

    def __init__(self, seed: int, turn_packets: int = TURN_PACKETS) -> None:
        self._chance = random.Random(seed)
        self._last_turn: deque[bytes] = deque(maxlen=turn_packets)
        self.fault: LidarFault | None = None

    def carry(self, packets: Sequence[bytes]) -> bytes:
        """The bytes of the next packets that arrive."""
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
        """What arrives of an answer: it is no packet, so it neither comes twice nor again."""
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
    """The bytes that a receiver reads (8N1, sent without a pause) which listens at a share of the sender's rate."""
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
