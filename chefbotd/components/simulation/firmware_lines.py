"""What our own firmware reads and writes: a line from the host as a word and numbers, and the lines of the board.

A model of ``firmware/core`` (``request.c``, ``transmit.c``), which obeys and refuses as that does.
"""

import re
from collections import deque
from collections.abc import Callable
from enum import Enum

from chefbotd.core.record import Record
from firmware_protocol.checked import SEQUENCE_SPAN, crc_16, seal

NUMBERS_OF = {"s": 2, "w": 2, "g": 2, "arm": 1, "r": 0, "hello": 2, "about": 0, "estop": 0}
"""The words, and how many numbers each has."""

INT32_MAX = 2**31 - 1
NO_NUMBER = -(2**31)
SEAL_CHARACTERS = len(b"*29B1")
LINE_BYTES = 64
RING_BYTES, MOST_ENDS = 128, 32
PAUSE_US = 1_000_000
"""A line that was cut ends with a pause so long."""

ESTOP = b"estop"
"""The word that the receive interrupt knows."""

CR, LF, DAMAGE = 0x0D, 0x0A, 0x00

_NUMBER = re.compile(rb"-?[0-9]+")
_PRINTABLE = re.compile(rb"[\x20-\x7e]*")


class Seal(Enum):
    """Whether a line ends in its CRC."""

    NONE = 0
    GOOD = 1
    WRONG = 2


class FirmwareRequest(Record, frozen=True):
    """A word (empty: none that is known), and the numbers after it."""

    word: str
    numbers: tuple[int, ...]

    @property
    def sequence(self) -> int | None:
        """The last number, if it is a sequence number."""
        return self.numbers[-1] if self.numbers and 0 <= self.numbers[-1] < SEQUENCE_SPAN else None


def seal_of(line: bytes) -> Seal:
    """Whether a line ends in its CRC."""
    if line[-SEAL_CHARACTERS : 1 - SEAL_CHARACTERS] != b"*":
        return Seal.NONE
    body = line[:-SEAL_CHARACTERS]
    return Seal.GOOD if line[1 - SEAL_CHARACTERS :] == b"%04X" % crc_16(body) else Seal.WRONG


def parse(body: bytes) -> FirmwareRequest:
    """The fields of a line without its seal."""
    word, *texts = body.split(b" ")
    name = word.decode("ascii", "replace")
    return FirmwareRequest(name if name in NUMBERS_OF else "", tuple(map(_number, texts)))


def _number(text: bytes) -> int:
    if not _NUMBER.fullmatch(text):
        return NO_NUMBER
    value = int(text)
    return value if abs(value) <= INT32_MAX else NO_NUMBER


class Line(Record, frozen=True):
    """A line without its end, and when that came in; LF are left out, and told where they stood inside."""

    text: bytes
    at_us: int
    has_line_feed: bool = False

    @property
    def is_damaged(self) -> bool:
        """Whether it is too long, or not printable ASCII, and so refused whole."""
        return len(self.text) > LINE_BYTES or not _PRINTABLE.fullmatch(self.text)


class FirmwareReceiver:
    """The receive ring: bytes come in at any time, and a pass of the main loop takes the lines that wait.

    ``estops`` counts the lines that ended in the e-stop's word, of which the receive interrupt tells. ``cut_lines``
    counts those that a pause has ended.
    """

    def __init__(self) -> None:
        self._ring: deque[int] = deque()
        self._ends_us: deque[int] = deque()
        self._line = b""
        self._has_lost = self._has_line_feed = self._is_inside = False
        self._heard, self._taken_us = b"", 0
        self.estops = self.overrun = self.cut_lines = 0

    def lose(self) -> None:
        """A byte was lost: its line is damaged."""
        self._has_lost = True
        self.overrun += 1

    def receive(self, data: bytes, now_us: int) -> None:
        """Bytes that came in now; those for which there is no room are lost."""
        for byte in data:
            self._take_byte(byte)
            if self._has_lost and len(self._ring) <= RING_BYTES - 2:
                self._store(DAMAGE)
                self._has_lost = False
            if byte in (CR, LF) and not self._has_lost and not self._is_inside:
                continue
            is_too_many = byte == CR and len(self._ends_us) >= MOST_ENDS
            if self._has_lost or len(self._ring) >= RING_BYTES or is_too_many:
                self.lose()
                continue
            if byte == CR:
                self._ends_us.append(now_us)
            self._store(byte)

    def _store(self, byte: int) -> None:
        self._ring.append(byte)
        self._is_inside = byte != CR

    def _take_byte(self, byte: int) -> None:
        if byte == CR:
            self.estops += self._heard == ESTOP
            self._heard = b""
        elif byte != LF:
            self._heard = (self._heard + bytes((byte,)))[-len(ESTOP) :]

    def next_line(self, now_us: int) -> Line | None:
        """The next line that is not empty; what is no whole line yet leaves the ring, too."""
        if self._ring:
            if self._line and now_us - self._taken_us >= PAUSE_US:
                self._line, self._has_line_feed = b"", False
                self.cut_lines += 1
            self._taken_us = now_us
        while self._ring:
            byte = self._ring.popleft()
            if byte == LF:
                self._has_line_feed |= bool(self._line)
                continue
            if byte != CR:
                self._line = (self._line + bytes((byte,)))[: LINE_BYTES + 1]
                continue
            text, self._line, at_us = self._line, b"", self._ends_us.popleft()
            has_line_feed, self._has_line_feed = self._has_line_feed, False
            if text:
                return Line(text, at_us, has_line_feed)
        return None


class FirmwarePrinter:
    """Sends the board's lines while there is room for them; ``send`` puts bytes on the wire."""

    def __init__(self, send: Callable[[bytes], None], room_bytes: Callable[[], int]) -> None:
        self._send, self._room_bytes = send, room_bytes
        self._sequence = 0

    def has_room(self, size: int) -> bool:
        """Whether so many bytes fit the ring."""
        return self._room_bytes() >= size

    def plain(self, text: str) -> bool:
        """A line with its end; whether there was room for it."""
        if not self.has_room(len(text)):
            return False
        self._send(text.encode())
        return True

    def sealed(self, word: str, *numbers: object) -> bool:
        """A checked line; whether there was room for it."""
        body = "\t".join([word, *map(str, numbers)]).encode()
        line = seal(body, self._sequence, b"\t") + b"\n"
        if not self.has_room(len(line)):
            return False
        self._sequence = (self._sequence + 1) % SEQUENCE_SPAN
        self._send(line)
        return True
