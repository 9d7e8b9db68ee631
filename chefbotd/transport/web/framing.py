"""WebSocket frames (RFC 6455) as a framing: each message is one request, and each sent message is one frame.

The parser is that of the package websockets, used without its I/O: so a stop is carried out in the call that brought
its bytes. Only whole messages do not go through it.
"""

from functools import lru_cache
from typing import cast

from msgspec import Struct
from websockets.exceptions import PayloadTooBig
from websockets.frames import Close, CloseCode, Frame, Opcode
from websockets.protocol import Protocol, Side, State

try:
    from websockets.speedups import apply_mask
except ImportError:  # a platform without a wheel of it
    from websockets.utils import apply_mask

from chefbotd.rpc import jsonrpc
from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.transport.framing import describe_drops

DATA = (Opcode.TEXT, Opcode.BINARY, Opcode.CONT)
KNOWN = frozenset(Opcode)
FIN, RESERVED, OPCODE, MASKED, SHORT_LENGTH = 0x80, 0x70, 0x0F, 0x80, 0x7F
WHOLE_MESSAGES = (FIN | Opcode.TEXT, FIN | Opcode.BINARY)
"""The first byte of a frame that is a whole message."""

EXTENDED_LENGTH_BYTES = {126: 2, 127: 8}
MASK_BYTES = 4
LONGEST_SHORT, SHORT_HEAD_BYTES = 125, 6
"""A message whose length is in its second byte, and the bytes before its payload."""


class FrameHead(Struct):
    """A client's frame by its first bytes (RFC 6455, section 5.2): where its payload begins, and its size."""

    first: int
    is_masked: bool
    head_bytes: int
    payload_bytes: int

    @property
    def is_sound(self) -> bool:
        """Whether it may be a frame of a client at all."""
        return self.is_masked and not self.first & RESERVED and self.first & OPCODE in KNOWN


def read_head(held: bytearray, start: int) -> FrameHead | None:
    """The head of the frame that begins there; None: it is not complete. What is no frame is known by two bytes."""
    if len(held) < start + 2:
        return None
    first, second = held[start], held[start + 1]
    payload_bytes, begin = second & SHORT_LENGTH, start + 2
    if extended := EXTENDED_LENGTH_BYTES.get(payload_bytes, 0):
        if len(held) < begin + extended:
            head = FrameHead(first, bool(second & MASKED), len(held) - start, 0)
            return None if head.is_sound else head
        payload_bytes = int.from_bytes(held[begin : begin + extended], "big")
    is_masked = bool(second & MASKED)
    return FrameHead(first, is_masked, 2 + extended + (MASK_BYTES if is_masked else 0), payload_bytes)


class WebSocketFraming:
    """The server's side, once the handshake is done; a message has at most ``longest_bytes``.

    With ``placeholder`` that line stands for a longer message, which is read over; else the connection ends.
    """

    describe_failure = staticmethod(jsonrpc.error)
    describe_drops = staticmethod(describe_drops)

    def __init__(self, longest_bytes: int, placeholder: bytes | None = None) -> None:
        self._longest_bytes, self._placeholder = longest_bytes, placeholder
        self._protocol = Protocol(Side.SERVER, state=State.OPEN, max_size=longest_bytes)
        self._control = b""
        self._goodbye: bytes = Frame(Opcode.CLOSE, Close(CloseCode.GOING_AWAY, "").serialize()).serialize(
            mask=False
        )
        self._held = bytearray()  # from the beginning of a frame on
        self._skip_bytes = 0  # of a message that is too long
        self._in_fragments = False
        self.ended = False
        self.failure: Failure | None = None

    @property
    def partial(self) -> bool:
        """Whether a frame has begun and not ended."""
        return bool(self._held or self._skip_bytes) and not self.ended and self.failure is None

    def lines(self, data: bytes) -> bytes:
        """The messages that these bytes complete, each as a line."""
        if not data or self.ended or self.failure is not None:
            return b""
        lines, start = bytearray(), 0
        self._hold(data)
        while not self.ended and self.failure is None:
            start = self._take_short_messages(start, lines)
            head = read_head(self._held, start)
            if head is None:
                break
            end = self._take_frame(head, start, lines)
            if end == start:
                break
            start = end
        del self._held[:start]
        return bytes(lines)

    def _hold(self, data: bytes) -> None:
        skipped = min(self._skip_bytes, len(data))
        self._skip_bytes -= skipped
        self._held += data[skipped:] if skipped else data

    def _take_short_messages(self, start: int, lines: bytearray) -> int:
        """Take messages of at most 125 bytes as long as they follow each other; where the first other frame begins."""
        held, end = self._held, len(self._held)
        if self._in_fragments:
            return start
        while start + SHORT_HEAD_BYTES <= end and held[start] in WHOLE_MESSAGES:
            length = held[start + 1] - MASKED  # negative: it is not masked
            payload = start + SHORT_HEAD_BYTES
            if not 0 <= length <= LONGEST_SHORT or payload + length > end:
                break
            start = payload + length
            mask = held[payload - MASK_BYTES : payload]
            lines += apply_mask(held[payload:start], mask).replace(b"\n", b" ")
            lines += b"\n"
        return start

    def _take_frame(self, head: FrameHead, start: int, lines: bytearray) -> int:
        """Take a frame if it is complete, or can only be refused; where the next one begins."""
        payload, end = start + head.head_bytes, start + head.head_bytes + head.payload_bytes
        is_message = head.is_sound and head.first in WHOLE_MESSAGES and not self._in_fragments
        is_too_long = head.payload_bytes > self._longest_bytes
        if is_message and is_too_long and self._placeholder is not None:
            lines += self._placeholder + b"\n"
            self._skip_bytes = max(0, end - len(self._held))
            return min(end, len(self._held))
        if head.is_sound and not is_too_long and end > len(self._held):
            return start
        if is_message and end <= len(self._held):
            mask = bytes(self._held[payload - MASK_BYTES : payload])
            lines += apply_mask(self._held[payload:end], mask).replace(b"\n", b" ") + b"\n"
            return end
        self._parse(bytes(self._held[start:end]), lines)
        return min(end, len(self._held))

    def _parse(self, data: bytes, lines: bytearray) -> None:
        """By the package: fragments, control frames, and what is no frame."""
        self._protocol.receive_data(data)
        for frame in cast(list[Frame], self._protocol.events_received()):  # there is no handshake in it
            if frame.opcode in DATA:
                lines += bytes(frame.data).replace(b"\n", b" ")  # in JSON it can only lie between two words
                self._in_fragments = not frame.fin
                if frame.fin:
                    lines += b"\n"
        self._note_end()

    def _note_end(self) -> None:
        answers = b"".join(self._protocol.data_to_send())
        if self._protocol.state is State.OPEN:
            self._control += answers
        elif self._protocol.close_rcvd is not None:
            self.ended, self._goodbye = True, answers
        else:
            self.failure = self._explain()

    def _explain(self) -> Failure:
        problem = self._protocol.parser_exc
        if isinstance(problem, PayloadTooBig):
            message = f"a request has at most {self._longest_bytes} bytes"
            return Failure(ErrorKind.REQUEST_TOO_LARGE, message)
        return Failure(ErrorKind.PARSE_ERROR, f"not a WebSocket: {problem}")

    def control(self) -> bytes:
        """Pongs, once each."""
        control, self._control = self._control, b""
        return control

    def encode(self, message: bytes) -> bytes:
        """A message as a text frame."""
        return text_frame(message)

    def event(self, payload: EventPayload) -> bytes:
        """An event as a text frame."""
        return _event_frame(payload)

    def goodbye(self) -> bytes:
        """A closing frame."""
        return self._goodbye


@lru_cache(maxsize=4)
def _event_frame(payload: EventPayload) -> bytes:
    """An event as a frame, made once for all clients."""
    return text_frame(jsonrpc.event(payload))


def text_frame(message: bytes) -> bytes:
    """A whole text message, of a server (RFC 6455, section 5.2)."""
    size = len(message)
    if size <= LONGEST_SHORT:
        return bytes((FIN | Opcode.TEXT, size)) + message
    code, length_bytes = (126, 2) if size < 1 << 16 else (127, 8)
    return bytes((FIN | Opcode.TEXT, code)) + size.to_bytes(length_bytes, "big") + message
