"""What must hold for any bytes from a board that may run our firmware.

A function raises ``AssertionError`` for an input that breaks it.
"""

from firmware_protocol.checked import FirmwareCodec, seal, unseal
from firmware_protocol.codec import CLASSIC
from firmware_protocol.decoder import Decoded, Decoder
from firmware_protocol.messages import Banner, CommandRefused, Firmware, Malformed, ResetDone, Text

TAB = b"\t"
IN_ORDER, AFTER_A_GAP = b"=", b"+"
GAP = 7
LEAST_CLASSIC = 3
"""Lines of the classic mode in a row that end the checked one."""


def firmware_is_sound(data: bytes) -> None:
    """Chunks and restarts of this program do not matter, and the mode changes by nothing but what changes it.

    A line that begins with ``=`` is sealed with the next number, one with ``+`` with a later one; others are not.
    """
    wire = _wire(data)
    codec = FirmwareCodec(CLASSIC)
    lines = Decoder(codec).feed(wire)
    assert lines == _bytewise(wire, codec)
    assert lines == _restored(wire, len(data) % (len(wire) + 1), codec)
    _modes_are_sound(wire)


def _wire(data: bytes) -> bytes:
    sequence, lines = 0, []
    for line in data.split(b"\n"):
        if line[:1] in (IN_ORDER, AFTER_A_GAP):
            sequence = (sequence + (GAP if line[:1] == AFTER_A_GAP else 0)) % 256
            line = seal(line[1:], sequence, TAB)
            sequence = (sequence + 1) % 256
        lines.append(line)
    return b"\n".join(lines)


def _bytewise(wire: bytes, expected: FirmwareCodec) -> list[Decoded]:
    codec = FirmwareCodec(CLASSIC)
    decoder = Decoder(codec)
    lines = [line for byte in wire for line in decoder.feed(bytes([byte]))]
    assert codec.state() == expected.state()
    return lines


def _restored(wire: bytes, cut: int, expected: FirmwareCodec) -> list[Decoded]:
    """Decoded by two codecs, of which the second goes on from the first one's state."""
    before, after = FirmwareCodec(CLASSIC), FirmwareCodec(CLASSIC)
    first, second = Decoder(before), Decoder(after)
    lines = first.feed(wire[:cut])
    after.restore(before.state())
    second.restore(first.state())
    lines += second.feed(wire[cut:])
    assert after.state() == expected.state()
    return lines


def _modes_are_sound(wire: bytes) -> None:
    """In the checked mode only lines with a good CRC count; it begins with one, and ends by a name or classic lines."""
    codec = FirmwareCodec(CLASSIC)
    decoder, classic = Decoder(codec), 0
    for piece in wire.split(b"\n")[:-1]:
        was_checked = codec.is_checked
        lines = decoder.feed(piece + b"\n")
        for line, message in lines[-1:]:
            is_sealed = unseal(line, TAB) is not None
            classic = 0 if is_sealed else classic + (not isinstance(message, Text))
            if not was_checked and codec.is_checked:
                assert is_sealed
                assert not isinstance(message, CommandRefused | Malformed)
            elif was_checked and not codec.is_checked:
                is_named = isinstance(message, Firmware | Banner | ResetDone)
                assert is_named or classic >= LEAST_CLASSIC or len(lines) >= LEAST_CLASSIC
            elif was_checked and not is_sealed:
                assert isinstance(message, Malformed)
