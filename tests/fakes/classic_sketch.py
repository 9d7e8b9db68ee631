"""What the classic sketch makes of bytes: its parser takes more than our decoder does (see docs/protocol.md)."""

import re

ROOM = 63
NUMBER = re.compile(rb"[ \t]*([+-]?[0-9]+)")


def duty_in_force(data: bytes, before: tuple[int, ...]) -> tuple[int, ...]:
    """The motor command in force after these bytes, with ``before`` in force before them; a reset ends in zeros.

    LF is passed over, CR ends a line, a line that fills the buffer is forgotten. A number that is missing is 0, and of
    one that goes on with something else the digits count.
    """
    duty, line = before, b""
    for byte in data:
        if byte == 0x0D:
            duty, line = _obeyed(line, duty), b""
        elif byte not in (0x00, 0x0A):
            line += bytes([byte])
            if len(line) == ROOM:
                line = b""
    return duty


def _obeyed(line: bytes, duty: tuple[int, ...]) -> tuple[int, ...]:
    kind, *texts = [text for text in line.split(b" ") if text] or [b""]
    if kind == b"r":
        return (0,) * len(duty)
    if kind != b"s":
        return duty
    numbers = [NUMBER.match(text) for text in texts[: len(duty)]]
    read = [int(number[1]) if number else 0 for number in numbers]
    return (*read, *[0] * (len(duty) - len(read)))
