"""WebSocket frames to lines and back, without a socket."""

import json

import pytest
from websockets.frames import Frame, Opcode

from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.jsonrpc import ErrorKind
from chefbotd.transport.web.framing import WebSocketFraming, text_frame
from tests.fakes.web import frame

STOP = b'{"jsonrpc":"2.0","id":2,"method":"stop"}'
LONG = b'{"x":"' + b"y" * 300 + b'"}'
STREAM = frame(STOP) + frame(b"ping me", opcode=Opcode.PING) + frame(LONG) + frame(STOP, opcode=Opcode.BINARY)


@pytest.mark.parametrize("size", [1, 2, 7, 50, 10_000])
def test_chunks_do_not_matter(size: int) -> None:
    """The same lines and one pong, however the bytes are cut; between frames nothing is held."""
    framing = WebSocketFraming(4096)
    lines, control = b"", b""
    for start in range(0, len(STREAM), size):
        lines += framing.lines(STREAM[start : start + size])
        control += framing.control()
    assert lines == STOP + b"\n" + LONG + b"\n" + STOP + b"\n"
    assert control == Frame(Opcode.PONG, b"ping me").serialize(mask=False)
    assert (framing.partial, framing.ended, framing.failure) == (False, False, None)


def test_a_message_in_fragments_is_one_line() -> None:
    """With a ping in between, and a line end of its own as a space: it cannot end a request early."""
    framing = WebSocketFraming(4096)
    lines = framing.lines(frame(b'{"method":\n', fin=False) + frame(b"", opcode=Opcode.PING))
    assert (lines, framing.partial) == (b'{"method": ', False)
    assert framing.lines(frame(b'"stop"}', opcode=Opcode.CONT)) == b'"stop"}\n'


def test_half_a_frame_is_told() -> None:
    """So that a client has only so long to send the rest."""
    framing = WebSocketFraming(4096)
    whole = frame(LONG)
    assert framing.lines(whole[:2]) == b""
    assert framing.partial
    framing.lines(whole[2:])
    assert not framing.partial


def test_a_closing_client_is_answered_in_kind() -> None:
    """Its code comes back when our side closes; what it sends after is not read."""
    framing = WebSocketFraming(4096)
    assert framing.lines(frame(STOP) + frame(b"\x03\xe8bye", opcode=Opcode.CLOSE)) == STOP + b"\n"
    assert (framing.ended, framing.failure) == (True, None)
    assert framing.lines(frame(STOP)) == b""
    assert framing.goodbye() == Frame(Opcode.CLOSE, b"\x03\xe8bye").serialize(mask=False)


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (frame(b"x" * 4097)[:10], ErrorKind.REQUEST_TOO_LARGE),  # known by its header
        (Frame(Opcode.TEXT, STOP).serialize(mask=False), ErrorKind.PARSE_ERROR),  # a browser masks
        (frame(b"x", opcode=Opcode.CONT), ErrorKind.PARSE_ERROR),  # of nothing
        (b"\xff\xff\xff\xff\xff\xff", ErrorKind.PARSE_ERROR),
        (b"GET / HTTP/1.1\r\n\r\n", ErrorKind.PARSE_ERROR),
    ],
    ids=["too large", "no mask", "goes on with nothing", "no frame", "HTTP"],
)
def test_what_is_no_frame_ends_the_reading(data: bytes, kind: ErrorKind) -> None:
    """With a reason; what came before it counts, what comes after it does not."""
    framing = WebSocketFraming(4096)
    assert framing.lines(frame(STOP) + data) == STOP + b"\n"
    assert framing.failure is not None
    assert framing.failure.kind is kind
    assert framing.lines(frame(STOP)) == b""


def test_an_event_is_framed_once_for_all_clients() -> None:
    """Two clients get the very same bytes: a whole text frame."""
    payload = EventPayload("text", 1, 0.0, 0.0, b'{"text":"' + b"z" * 130 + b'"}')
    one, other = (WebSocketFraming(4096).event(payload) for _ in range(2))
    assert one is other
    assert one[:2] == b"\x81\x7e"
    size = int.from_bytes(one[2:4], "big")
    assert size == len(one) - 4
    assert json.loads(one[4:])["params"]["topic"] == "text"


def test_many_short_messages_are_read_without_the_packages_parser(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand in one read are taken in a loop of our own; the parser judges fragments and control frames."""
    parsed: list[bytes] = []
    framing = WebSocketFraming(4096)
    monkeypatch.setattr(framing._protocol, "receive_data", parsed.append)
    assert framing.lines(frame(STOP) * 1000) == (STOP + b"\n") * 1000
    assert parsed == []


@pytest.mark.parametrize("size", [1, 7, 1000, 100_000])
def test_a_message_that_is_too_long_can_be_read_over(size: int) -> None:
    """A line stands for it, however it is cut, and what follows it counts; without such a line the connection ends."""
    stream = frame(STOP) + frame(b"x" * 5000) + frame(LONG) + frame(b"y" * 70_000) + frame(STOP)
    framing = WebSocketFraming(4096, placeholder=b'"too long"')
    lines = b"".join(framing.lines(stream[start : start + size]) for start in range(0, len(stream), size))
    assert lines == b"\n".join((STOP, b'"too long"', LONG, b'"too long"', STOP, b""))
    assert (framing.partial, framing.failure) == (False, None)


def test_of_a_message_that_is_too_long_nothing_is_held() -> None:
    """A length of 4 GB is believed, and costs a counter."""
    framing = WebSocketFraming(4096, placeholder=b"-")
    assert framing.lines(b"\x81\xff" + (1 << 32).to_bytes(8, "big") + b"mask") == b"-\n"
    for _ in range(100):
        assert framing.lines(b"z" * 65_536) == b""
    assert framing.partial
    assert len(framing._held) == 0


@pytest.mark.parametrize("size", [0, 1, 125, 126, 65_535, 65_536, 70_000])
def test_a_message_is_framed_as_the_package_does(size: int) -> None:
    """A length takes one, three or nine bytes."""
    message = b"m" * size
    assert text_frame(message) == Frame(Opcode.TEXT, message).serialize(mask=False)
