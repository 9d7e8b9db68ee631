"""WebSocket frames (RFC 6455) as a framing: each message is one request, and each sent message is one frame.

The parser is that of the package websockets, used without its I/O: so a stop is carried out in the call that brought
its bytes.
"""

from functools import lru_cache
from typing import cast

from websockets.exceptions import PayloadTooBig
from websockets.frames import Close, CloseCode, Frame, Opcode
from websockets.protocol import Protocol, Side, State

from chefbotd.rpc import jsonrpc
from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.jsonrpc import ErrorKind, Failure

MASK_AND_HEADER_BYTES = 6
DATA = (Opcode.TEXT, Opcode.BINARY, Opcode.CONT)


class WebSocketFraming:
    """The server's side, once the handshake is done; a message has at most ``longest_bytes``."""

    def __init__(self, longest_bytes: int) -> None:
        self._longest_bytes = longest_bytes
        self._protocol = Protocol(Side.SERVER, state=State.OPEN, max_size=longest_bytes)
        self._control = b""
        self._goodbye: bytes = Frame(Opcode.CLOSE, Close(CloseCode.GOING_AWAY, "").serialize()).serialize(
            mask=False
        )
        self._held_bytes = 0
        self.ended = False
        self.failure: Failure | None = None

    @property
    def partial(self) -> bool:
        """Whether a frame has begun and not ended."""
        return self._held_bytes > 0 and not self.ended and self.failure is None

    def lines(self, data: bytes) -> bytes:
        """The messages that these bytes complete, each as a line."""
        if not data or self.ended or self.failure is not None:
            return b""
        self._held_bytes += len(data)
        self._protocol.receive_data(data)
        lines = bytearray()
        for frame in cast(list[Frame], self._protocol.events_received()):  # there is no handshake in it
            self._held_bytes -= _frame_bytes(frame)
            if frame.opcode in DATA:
                lines += bytes(frame.data).replace(b"\n", b" ")  # in JSON it can only lie between two words
                if frame.fin:
                    lines += b"\n"
        self._note_end()
        return bytes(lines)

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
        return _text_frame(message)

    def event(self, payload: EventPayload) -> bytes:
        """An event as a text frame."""
        return _event_frame(payload)

    def goodbye(self) -> bytes:
        """A closing frame."""
        return self._goodbye


def _frame_bytes(frame: Frame) -> int:
    """A client's frame, as it came."""
    size = len(frame.data)
    return MASK_AND_HEADER_BYTES + size + (0 if size < 126 else 2 if size < 65_536 else 8)


@lru_cache(maxsize=4)
def _event_frame(payload: EventPayload) -> bytes:
    """An event as a frame, made once for all clients."""
    return _text_frame(jsonrpc.event(payload))


def _text_frame(message: bytes) -> bytes:
    framed: bytes = Frame(Opcode.TEXT, message).serialize(mask=False)
    return framed
