"""What must hold for any bytes whatever. Each function raises ``AssertionError`` for an input that breaks it."""

import json
from collections.abc import Callable, Mapping

from chefbotd.api.jsonrpc import Failure, Request, error, parse
from firmware_protocol.codec import CLASSIC, FOUR_WHEELS, KHAN_EDGES, from_board, to_board
from firmware_protocol.decoder import Decoder
from firmware_protocol.line_codec import LineCodec
from firmware_protocol.messages import Malformed

CODECS = tuple(
    table(variant) for variant in (CLASSIC, FOUR_WHEELS, KHAN_EDGES) for table in (from_board, to_board)
)


def decoding_is_sound(data: bytes) -> None:
    """For every table: chunks do not matter, a message says again what it said, and refusals are bounded."""
    for codec in CODECS:
        whole = Decoder(codec)
        lines = whole.feed(data)
        bytewise = Decoder(codec)
        assert lines == [line for byte in data for line in bytewise.feed(bytes([byte]))]
        assert whole.accepted == bytewise.accepted
        assert whole.malformed == bytewise.malformed
        for _, message in lines:
            _message_is_sound(codec, message)


def _message_is_sound(codec: LineCodec, message: object) -> None:
    if isinstance(message, Malformed):
        assert len(message.line) <= codec.framing.max_line
        assert message.detail
    else:
        ((_, again),) = Decoder(codec).feed(codec.encode(message))  # type: ignore[arg-type]
        assert type(again) is type(message)


def parsing_is_sound(data: bytes) -> None:
    """A line is a request that could be written again, or a failure that can be sent: never an exception."""
    for line in data.split(b"\n"):
        parsed = parse(line)
        if isinstance(parsed, Failure):
            answer = json.loads(error(parsed))
            assert answer["jsonrpc"] == "2.0"
            assert answer["error"]["data"]["kind"]
        else:
            assert isinstance(parsed, Request)
            json.dumps(parsed.params, allow_nan=False)


TARGETS: Mapping[str, Callable[[bytes], None]] = {
    "decode": decoding_is_sound,
    "request": parsing_is_sound,
}
