"""How a sketch reads commands from the host's bytes, and how the board's PWM reads their numbers.

The published sketches use a library (Messenger) that cuts a line into words and reads numbers like C's ``atol``:
``66s`` is 66, and a missing word is 0. So if the middle of two commands is lost, the sketch obeys what is left of
them.
"""

import math
import re
from collections.abc import Iterator

from chefbotd.sim_parameters.sketches import PwmLaw
from firmware_protocol.messages import ResetBoard, SetDuty

BUFFER_BYTES = 64
NUMBER = re.compile(rb"[+-]?\d+")

Command = SetDuty | ResetBoard


class CommandReader:
    """Reads as the published sketches do: of a line the first ``s`` with its numbers, and each ``r`` before it.

    Beyond 64 bytes a line begins anew.
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
    found = NUMBER.match(word)
    return min(max(int(found.group()), -(1 << 31)), (1 << 31) - 1) if found else 0


BYTE = 256


def pwm_share(law: PwmLaw, full_scale: int, value: int) -> float:
    """The share of the period that the bridge is on for a command's ``value``; its sign is the direction."""
    magnitude = abs(value) % BYTE if law is PwmLaw.LOW_BYTE else abs(value)
    return math.copysign(min(magnitude, full_scale) / full_scale, value)
