"""What must hold for any bytes whatever. Each function raises ``AssertionError`` for an input that breaks it."""

import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from chefbotd.core.commands import RefusalKind
from chefbotd.rpc.arrivals import ByteArrival
from chefbotd.rpc.backlog import Backlog
from chefbotd.rpc.jsonrpc import Failure, Request, error, parse
from chefbotd.rpc.lenient import read_leniently
from firmware_protocol.checked import checked_to_board
from firmware_protocol.codec import VARIANTS, from_board, to_board
from firmware_protocol.decoder import Decoder
from firmware_protocol.line_codec import LineCodec
from firmware_protocol.lines import is_unit, unpack
from firmware_protocol.messages import (
    Banner,
    Malformed,
    Orientation,
    QuadratureEdges,
    ResetDone,
    Text,
)
from fuzz.firmware import firmware_is_sound
from fuzz.lidars import lidars_are_sound
from fuzz.stops import HINT, no_stop_is_lost

TABLES = (from_board, to_board, checked_to_board)
CODECS = tuple(table(variant) for variant in VARIANTS.values() for table in TABLES)
LONGEST_BYTES = 64

NOW = ByteArrival(0.0, 0)


def decoding_is_sound(data: bytes) -> None:
    """For every table: chunks do not matter, a message says what its line says, and refusals are bounded."""
    for codec in CODECS:
        whole = Decoder(codec)
        lines = whole.feed(data)
        bytewise = Decoder(codec)
        assert lines == [line for byte in data for line in bytewise.feed(bytes([byte]))]
        assert whole.accepted == bytewise.accepted
        assert whole.malformed == bytewise.malformed
        for line, message in lines:
            if isinstance(message, Malformed):
                assert len(message.line) <= codec.framing.max_line
                assert message.detail
            else:
                _message_is_sound(codec, line, message)


def _message_is_sound(codec: LineCodec, line: bytes, message: object) -> None:
    """It has the line's numbers, and the line that it is written as has them too, with two decimals at most."""
    assert list(_values(message)) == _read(codec, line, message)
    ((_, again),) = Decoder(codec).feed(codec.encode(message))  # type: ignore[arg-type]
    rounded = [float(f"{value:.2f}") if isinstance(value, float) else value for value in _values(message)]
    if isinstance(message, Orientation) and not is_unit(rounded):  # type: ignore[arg-type]
        return  # at the edge of what is taken for one
    assert type(again) is type(message)
    assert list(_values(again)) == rounded


def _read(codec: LineCodec, line: bytes, message: object) -> list[object]:
    """What a line says, read in the plainest way."""
    if isinstance(message, Banner | ResetDone | Text):
        return [] if isinstance(message, ResetDone) else [line.decode()]
    _, *texts = line.split(codec.framing.separator)
    if not isinstance(message, QuadratureEdges):
        return [float(text) for text in texts]
    wheel, total, states, *micros = texts
    return [float(wheel), float(total), *unpack(states), *map(float, micros)]


def _values(message: Any) -> Iterator[object]:
    for name in message.__match_args__:
        value = getattr(message, name)
        yield from value if isinstance(value, tuple) else (value,)


def parsing_is_sound(data: bytes) -> None:
    """A line is a request that can be written again, or a failure that can be sent: never an exception."""
    lines = data.split(b"\n")
    for line in lines:
        parsed = parse(line)
        if isinstance(parsed, Failure):
            answer = json.loads(error(parsed))
            assert answer["jsonrpc"] == "2.0"
            assert answer["error"]["data"]["kind"] == parsed.kind
        else:
            assert parse(_written(parsed)) == parsed
            assert read_leniently(line) == parsed
    for line in lines[:3]:
        _reading_leniently_is_sound(line)
    _cutting_is_sound(data, lines)


def _written(request: Request) -> bytes:
    message = {"jsonrpc": "2.0", "method": request.method, "params": request.params}
    return json.dumps(
        message | ({"id": request.id} if request.wants_answer else {}), allow_nan=False
    ).encode()


def _reading_leniently_is_sound(line: bytes) -> None:
    """Whatever JSON is in a request, and however deep, it asks for its method; what is read can be answered."""
    asked = read_leniently(line)
    assert asked is None or json.loads(error(Failure(RefusalKind.DISARMED, "", asked.id)))["id"] == asked.id
    try:
        json.loads(line.decode(errors="replace"), strict=False)
    except (ValueError, RecursionError):
        return
    for deep in (1, 1200):
        stop = read_leniently(b'{"a":' + b"[" * deep + line + b"]" * deep + b',"id":7,"method":"stop"}')
        assert stop == Request("stop", {}, 7)


def _cutting_is_sound(data: bytes, lines: list[bytes]) -> None:
    """However the bytes come, the lines are the same, and those that may be stops are found, each once."""
    found = [line.strip() for line in lines[:-1] if HINT.search(line) and len(line) <= LONGEST_BYTES]
    for size in (1, 7, len(data) + 1):
        backlog = Backlog(LONGEST_BYTES, HINT)
        seen = []
        for start in range(0, len(data), size):
            backlog.add(data[start : start + size], NOW)
            seen += list(iter(backlog.find_urgent, None))
        assert seen == found
        assert [line.text for line in iter(backlog.take_line, None)] == [line.strip() for line in lines[:-1]]
        assert len(backlog) == len(lines[-1])


TARGETS: Mapping[str, Callable[[bytes], None]] = {
    "decode": decoding_is_sound,
    "request": parsing_is_sound,
    "stops": no_stop_is_lost,
    "lidars": lidars_are_sound,
    "firmware": firmware_is_sound,
}
