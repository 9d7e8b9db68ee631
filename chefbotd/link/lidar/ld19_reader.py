"""Reads LD06 and LD19: packets with the lidar's own time become whole turns.

Source: LDROBOT's LD06 and LD19 development manuals. That a packet's stamp is the time of its last point is assumed.
"""

import math
from collections import Counter

import numpy as np
from msgspec import field

from chefbotd.core.record import MutableState, Record, StatefulPart
from chefbotd.link.board_clock import ClockRelation
from chefbotd.link.lidar.turn import LEAST_COVERED, LidarTurn
from firmware_protocol.lidar.ld19 import (
    FULL_TURN_CDEG,
    PACKET,
    POINTS,
    TIME_SPAN_MS,
    Ld19Decoder,
    Ld19DecoderState,
    Ld19Packet,
)

HALF_TURN_CDEG = FULL_TURN_CDEG // 2

WIDEST_PACKET_CDEG = 6_000
"""Twelve points of 4500 a second span 13 degrees at 13 turns a second, the fastest that the manual has."""

LONGEST_GAP_MS = 35
"""In more than that a lidar may turn by half a turn: what was heard of the present one is dropped."""

LONGEST_STEP_MS = 1_000
"""A stamp so far ahead is a stamp that went back: it wraps."""

LONGEST_SILENCE_S = 1.0

SURE_OF_RESTART = 200
"""So many packets in a row that follow each other and not what came before: half a second of a lidar that restarted."""

LONGEST_POINT_S = 0.002
"""Between two points, whatever a packet says of its speed: of 4500 a second it takes 0.2 ms."""


class _Placed(Record, frozen=True, array_like=True):
    """A packet with its start angle and its time, both unwrapped."""

    start_cdeg: int
    device_ms: int
    packet: Ld19Packet


class Ld19State(MutableState, tag="ld19"):
    """The lidar's clock, its angle, and the packets of the turn in progress.

    ``end_cdeg`` is where the present turn ends; None: the turn was not heard from its beginning.
    """

    decoder: Ld19DecoderState
    passed_over: Counter[str] = field(default_factory=Counter)
    relation: ClockRelation = field(default_factory=ClockRelation)
    last: _Placed | None = None
    last_read_s: float = -math.inf
    odd: Ld19Packet | None = None
    odd_in_a_row: int = 0
    placed: list[_Placed] = []
    end_cdeg: int | None = None


class Ld19Reader(StatefulPart[Ld19State]):
    """Follows the lidar's clock and its angle; packets whose time goes back belong to no turn."""

    def __init__(self, baud: int) -> None:
        self._decoder = Ld19Decoder()
        self._packet_s = PACKET.size * 10 / baud
        self.complaint, self.awaits_scan = "", False
        self.memory, self.parts = Ld19State(self._decoder.state()), {"decoder": self._decoder}

    def _start_anew(self) -> None:
        """Nothing is known of the lidar's clock, nor of where it looks."""
        self.memory = Ld19State(self._decoder.state(), self.memory.passed_over)

    def _drop_turn(self) -> None:
        self.memory.placed, self.memory.end_cdeg = [], None

    @property
    def packets(self) -> int:
        """Good packets so far."""
        return self._decoder.packets

    @property
    def refused(self) -> Counter[str]:
        """Bytes (``noise``) and packets that were passed over."""
        return self._decoder.refused + self.memory.passed_over

    def begin(self, now_s: float) -> bytes:
        """Another connection: nothing of the old one is continued. The lidar needs no words."""
        self._decoder.reset()
        self._start_anew()
        return b""

    def poll(self, now_s: float) -> bytes:
        """Nothing: the line goes one way."""
        return b""

    def end(self) -> bytes:
        """Nothing: the lidar turns as long as it has power."""
        return b""

    def read_bytes(self, data: bytes, now_s: float) -> list[LidarTurn]:
        """The turns that these bytes complete.

        Of all packets of a read the last has waited least: the lidar's clock is compared with the host's by that one.
        A turn whose time is not known is none: of a clock that has just begun, or of one that ended within the read.
        """
        packets = self._decoder.feed_bytes(data)
        ended: list[tuple[list[_Placed], int] | None] = []
        for packet in packets:
            before = self.memory.relation
            is_placed = self._place(packet, now_s)
            if self.memory.relation is not before:
                ended.clear()
            if is_placed:
                ended.append(self._whole_turn())
        if packets and self.memory.last is not None and self.memory.last.packet == packets[-1]:
            self.memory.relation.observe(self.memory.last.device_ms * 1e-3, now_s - self._packet_s)
        if not self.memory.relation.is_known:
            return []
        turns = [self._turn_of(*turn, now_s) for turn in ended if turn is not None]
        return [turn for turn in turns if turn is not None]

    def _place(self, packet: Ld19Packet, now_s: float) -> bool:
        """Whether the packet follows what came before."""
        if packet.span_cdeg > WIDEST_PACKET_CDEG:
            self.memory.passed_over["fields"] += 1
            return False
        if self.memory.last is None or now_s - self.memory.last_read_s > LONGEST_SILENCE_S:
            self._start_anew()
            return self._accept_packet(_Placed(packet.start_cdeg, packet.stamp_ms, packet), now_s)
        last = self.memory.last
        step_ms = (packet.stamp_ms - last.packet.stamp_ms) % TIME_SPAN_MS
        if packet == last.packet:
            self.memory.passed_over["repeated"] += 1
            return False
        if step_ms > LONGEST_STEP_MS:
            return self._is_restart(packet, now_s)
        if step_ms > LONGEST_GAP_MS:
            self._drop_turn()
        advance = (packet.start_cdeg - last.packet.start_cdeg + HALF_TURN_CDEG) % FULL_TURN_CDEG
        start_cdeg = last.start_cdeg + advance - HALF_TURN_CDEG
        return self._accept_packet(_Placed(start_cdeg, last.device_ms + step_ms, packet), now_s)

    def _accept_packet(self, placed: _Placed, now_s: float) -> bool:
        self.memory.last, self.memory.last_read_s = placed, now_s
        self.memory.odd, self.memory.odd_in_a_row = None, 0
        self.memory.placed.append(placed)
        return True

    def _is_restart(self, packet: Ld19Packet, now_s: float) -> bool:
        """Whether the lidar has restarted, judged by packets in a row whose time went back."""
        before, self.memory.odd = self.memory.odd, packet
        follows = before and 0 < (packet.stamp_ms - before.stamp_ms) % TIME_SPAN_MS <= LONGEST_GAP_MS
        self.memory.odd_in_a_row = self.memory.odd_in_a_row + 1 if follows else 1
        if self.memory.odd_in_a_row < SURE_OF_RESTART:
            self.memory.passed_over["out_of_order"] += 1
            return False
        self._start_anew()
        return self._accept_packet(_Placed(packet.start_cdeg, packet.stamp_ms, packet), now_s)

    def _whole_turn(self) -> tuple[list[_Placed], int] | None:
        """The packets of a turn that the newest one ends, and the angle of its end; that packet begins the next."""
        newest = self.memory.placed[-1]
        last_cdeg = newest.start_cdeg + newest.packet.span_cdeg
        if self.memory.end_cdeg is not None and last_cdeg < self.memory.end_cdeg:
            return None
        next_end_cdeg = (last_cdeg // FULL_TURN_CDEG + 1) * FULL_TURN_CDEG
        if (
            self.memory.end_cdeg is None
            and last_cdeg // FULL_TURN_CDEG == self.memory.placed[0].start_cdeg // FULL_TURN_CDEG
        ):
            return None  # the zero mark has not been passed yet
        placed, end_cdeg = self.memory.placed, self.memory.end_cdeg
        self.memory.placed, self.memory.end_cdeg = [newest], next_end_cdeg
        return None if end_cdeg is None else (placed, end_cdeg)

    def _turn_of(self, placed: list[_Placed], end_cdeg: int, now_s: float) -> LidarTurn | None:
        """The points of the turn that ends at this angle; None where too much of it is missing."""
        packets = [item.packet for item in placed]
        start, span = np.array([(item.start_cdeg, item.packet.span_cdeg) for item in placed], float).T
        share = np.arange(POINTS) / (POINTS - 1)
        angle = start[:, None] + span[:, None] * share - (end_cdeg - FULL_TURN_CDEG)
        inside = (angle >= 0) & (angle < FULL_TURN_CDEG)
        if span.sum() * POINTS / (POINTS - 1) < LEAST_COVERED * FULL_TURN_CDEG:
            self.memory.passed_over["incomplete"] += 1
            return None
        speed_cdeg_s = np.array([100.0 * max(packet.speed_deg_s, 1) for packet in packets])
        packet_s = np.minimum(span / speed_cdeg_s, LONGEST_POINT_S * (POINTS - 1))
        sent_s = np.array([self.memory.relation.host_s(item.device_ms * 1e-3) for item in placed])
        stamp_s = np.minimum(sent_s[:, None] - packet_s[:, None] * (1 - share), now_s)
        range_m = np.array([packet.distance_mm for packet in packets]) * 1e-3
        beam_s = np.maximum.accumulate(stamp_s[inside])  # the lidar's milliseconds are whole ones
        strength = np.array([packet.intensity for packet in packets], float)[inside]
        return LidarTurn(angle[inside] * (math.pi / HALF_TURN_CDEG), range_m[inside], beam_s, strength)
