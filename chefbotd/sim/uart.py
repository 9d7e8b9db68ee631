"""The board's serial port: bytes take time to leave, buffers are finite, and overflowing bytes are lost."""

import math
from collections import deque


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
        self._left.append((self._handed_over_s(self._idle_s), line))
        return max(at_s, self._idle_s - self._transmit_buffer_bytes * self._byte_s)

    def _handed_over_s(self, sent_s: float) -> float:
        period_s = self._handover_s
        return math.ceil(sent_s / period_s) * period_s if period_s else sent_s

    @property
    def next_s(self) -> float:
        """When the last byte of the next line leaves; inf when there is none."""
        return self._left[0][0] if self._left else math.inf

    def take_lines(self, to_s: float) -> list[tuple[float, bytes]]:
        """The lines whose last byte has left by ``to_s``, each with its time."""
        taken = []
        while self.next_s <= to_s:
            taken.append(self._left.popleft())
        return taken

    def receive(self, data: bytes) -> None:
        """Bytes from the host; those that find the buffer full are lost and counted."""
        room = self._receive_buffer_bytes - len(self._received)
        self._received += data[:room]
        self.received_dropped += max(len(data) - room, 0)

    def read(self) -> bytes:
        """Everything received and not yet read."""
        data = bytes(self._received)
        self._received.clear()
        return data
