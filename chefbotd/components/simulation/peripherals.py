"""What the board's program works with: a reader of commands, a serial port, encoder edges, and a motion processor.

The published sketches use a library (Messenger) that cuts a line into words and reads numbers like C's ``atol``:
``66s`` is 66, and a missing word is 0. So if the middle of two commands is lost, the sketch obeys what is left of
them.
"""

import math
import re
from collections import deque
from collections.abc import Iterator, Sequence

from chefbotd.components.simulation.axles import Wheels
from chefbotd.components.simulation.parameters.sketches import PwmLaw
from chefbotd.components.simulation.robot import Robot
from chefbotd.components.simulation.sensors import ImuMotion
from chefbotd.core.record import Record
from firmware_protocol.messages import ResetBoard, SetDuty

BUFFER_BYTES = 64
NUMBER = re.compile(rb"[+-]?\d+")

Command = SetDuty | ResetBoard


class CommandReader:
    """Reads as the published sketches do: each ``r`` of a line up to its first ``s``, and that ``s`` with its numbers.

    After 64 bytes without an end, a new line begins.
    """

    def __init__(self, wheels: int) -> None:
        self._wheels = wheels
        self._line = bytearray()
        self.ignored = 0

    def feed(self, data: bytes) -> Iterator[Command]:
        """The commands in the next bytes."""
        for byte in data:
            if byte == 0x0D:
                words = bytes(self._line).split(b" ")
                self._line.clear()
                yield from self._obey([word for word in words if word])
            elif byte not in (0x00, 0x0A):
                self._line.append(byte)
                if len(self._line) >= BUFFER_BYTES:
                    self._line.clear()
                    self.ignored += 1

    def reset(self) -> None:
        """Forget the beginning of a line."""
        self._line.clear()

    def _obey(self, words: list[bytes]) -> Iterator[Command]:
        is_command = not words
        for at, word in enumerate(words):
            if word == b"r":
                is_command = True
                yield ResetBoard()
            elif word == b"s":
                numbers = [*words[at + 1 :], *[b""] * self._wheels]
                yield SetDuty(tuple(map(_number, numbers[: self._wheels])))
                return
        self.ignored += not is_command


def _number(word: bytes) -> int:
    """As ``atol`` reads it."""
    match = NUMBER.match(word)
    return min(max(int(match.group()), -(1 << 31)), (1 << 31) - 1) if match else 0


BYTE = 256


def pwm_share(law: PwmLaw, full_scale: int, value: int) -> float:
    """The share of the PWM period for which the bridge is on; its sign is the direction."""
    magnitude = abs(value) % BYTE if law is PwmLaw.LOW_BYTE else abs(value)
    return math.copysign(min(magnitude, full_scale) / full_scale, value)


class Uart:
    """Sends lines at the line rate, and keeps received bytes until they are read.

    A USB converter that hands over every ``handover_s`` keeps a line until then (an FTDI's latency timer).
    """

    def __init__(
        self,
        rate_bytes_s: float,
        transmit_buffer_bytes: int,
        receive_buffer_bytes: int,
        handover_s: float = 0.0,
    ) -> None:
        self._byte_s = 1 / rate_bytes_s
        self._transmit_buffer_bytes, self._receive_buffer_bytes = transmit_buffer_bytes, receive_buffer_bytes
        self._idle_s, self._handover_s = 0.0, handover_s
        self._left: deque[tuple[float, bytes]] = deque()
        self._received = bytearray()
        self.received_dropped = 0

    def send(self, line: bytes, at_s: float) -> float:
        """Queue a line; the sender may go on at the time returned, when the rest fits the buffer."""
        self._idle_s = max(at_s, self._idle_s) + len(line) * self._byte_s
        self.hand_over(line, self._idle_s)
        return max(at_s, self._idle_s - self._transmit_buffer_bytes * self._byte_s)

    def hand_over(self, line: bytes, left_s: float) -> None:
        """Pass on a line whose last byte leaves the board at this time."""
        self._left.append((self._handed_over_s(left_s), line))

    def _handed_over_s(self, sent_s: float) -> float:
        period_s = self._handover_s
        return math.ceil(sent_s / period_s) * period_s if period_s else sent_s

    @property
    def next_s(self) -> float:
        """When the last byte of the next line leaves; inf when there is none."""
        return self._left[0][0] if self._left else math.inf

    def take_lines(self, to_s: float) -> list[tuple[float, bytes]]:
        """The lines whose last byte has left by ``to_s``, each with its time."""
        lines = []
        while self.next_s <= to_s:
            lines.append(self._left.popleft())
        return lines

    def receive(self, data: bytes) -> None:
        """Bytes from the host; those that find the buffer full are lost and counted."""
        room = self._receive_buffer_bytes - len(self._received)
        self._received += data[:room]
        self.received_dropped += max(len(data) - room, 0)

    def read(self) -> bytes:
        """Take everything that was received and not read yet."""
        data = bytes(self._received)
        self._received.clear()
        return data


LEVELS = (0b00, 0b10, 0b11, 0b01)
"""The lines of an encoder that turns forward: A, worth 2, before B, worth 1."""


class Edge(Record, frozen=True):
    """The two levels after an edge, and the edge's time."""

    at_s: float
    levels: int


class CycleEdges(Record, frozen=True):
    """A wheel's edges, and the number of all its edges since the board booted, including lost ones."""

    total: int
    edges: list[Edge]


class EdgeRecorder:
    """Finds the edges of turning wheels, a step at a time, and keeps them until they are taken.

    The board has room for ``buffer_edges`` of each wheel; it counts later ones and drops them.
    """

    def __init__(self, counts_per_rad: Sequence[float], buffer_edges: int) -> None:
        """``counts_per_rad`` has a number a wheel, negative where the encoder counts backwards."""
        self._counts_per_rad, self._buffer_edges = tuple(counts_per_rad), buffer_edges
        self._edges: tuple[deque[Edge], ...] = tuple(deque() for _ in counts_per_rad)
        self._totals = [0] * len(self._counts_per_rad)

    def watch(self, from_s: float, to_s: float, before_rad: Wheels, after_rad: Wheels) -> None:
        """Note that the wheels turned by these angles in this time, each at a constant speed."""
        wheels = zip(before_rad, after_rad, self._counts_per_rad, self._edges, strict=True)
        for before, after, per_rad, edges in wheels:
            edges.extend(_edges(from_s, to_s, before * per_rad, after * per_rad))

    def boot(self, at_s: float) -> None:
        """Begin with the board's program, which knows no earlier edge."""
        self.take_edges(at_s)
        self._totals = [0] * len(self._totals)

    def take_edges(self, to_s: float) -> list[CycleEdges]:
        """Take each wheel's edges up to this time out of the buffer."""
        return [self._take(wheel, to_s) for wheel in range(len(self._edges))]

    def _take(self, wheel: int, to_s: float) -> CycleEdges:
        edges = _take(self._edges[wheel], to_s)
        kept = edges[: self._buffer_edges]
        total = self._totals[wheel] + len(kept)
        self._totals[wheel] += len(edges)
        return CycleEdges(total, kept)


def _edges(from_s: float, to_s: float, before: float, after: float) -> list[Edge]:
    """The whole numbers that an angle in counts crosses, in the order of crossing."""
    first, last = math.floor(before), math.floor(after)
    if first == last:
        return []
    per_count_s = (to_s - from_s) / (after - before)
    if last > first:
        crossed = [(n, n) for n in range(first + 1, last + 1)]
    else:
        crossed = [(n, n - 1) for n in range(first, last, -1)]
    return [Edge(from_s + (n - before) * per_count_s, LEVELS[now % 4]) for n, now in crossed]


def _take(edges: deque[Edge], to_s: float) -> list[Edge]:
    due = []
    while edges and edges[0].at_s <= to_s:
        due.append(edges.popleft())
    return due


FIFO_SAMPLES = 24
"""1024 bytes of FIFO (register map RM-MPU-6000A, section 4.33) at 42 bytes each."""


class MotionSample(Record, frozen=True):
    """A motion, and when it was sampled."""

    at_s: float
    motion: ImuMotion


class MotionProcessor:
    """Samples a robot's motion on a grid of its own, from when it was started."""

    def __init__(self, robot: Robot, period_s: float) -> None:
        self._robot, self._period_s = robot, period_s
        self._samples: deque[MotionSample] = deque()
        self._next_s = period_s
        robot.watch(self._watch)

    def start(self, at_s: float) -> None:
        """An empty FIFO; the first sample comes a period later."""
        self._samples.clear()
        self._next_s = at_s + self._period_s

    @property
    def ready_s(self) -> float:
        """When the oldest sample is available."""
        return self._samples[0].at_s if self._samples else self._next_s

    def read(self, now_s: float) -> MotionSample | None:
        """The oldest sample; None where there is none, or the FIFO has overflowed, which empties it."""
        waiting = sum(sample.at_s <= now_s for sample in self._samples)
        if waiting > FIFO_SAMPLES:
            for _ in range(waiting):
                self._samples.popleft()
            return None
        return self._samples.popleft() if waiting else None

    def _watch(self, from_s: float, to_s: float, before_rad: Wheels, after_rad: Wheels) -> None:
        while self._next_s <= to_s:
            self._samples.append(MotionSample(self._next_s, self._robot.motion))
            self._next_s += self._period_s
