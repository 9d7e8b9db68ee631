"""Recognizes a stop in any JSON object that asks for one, whatever else is wrong with it.

A robot that drives on because a reason was too long, was of the wrong type or held half of a surrogate pair would
have understood and not obeyed. So what the strict reading refuses is read once more as leniently as JSON can be.
"""

import json
import re

from chefbotd.rpc.jsonrpc import MAX_INTEGER_DIGITS, Request

STOPS = ("estop", "stop")
"""What stops the robot, the most urgent first."""

_STRINGS_AND_BRACKETS = re.compile(r'"(?:[^"\\]|\\.)*+"?|[\[{]+|[\]}]', re.DOTALL)
_COMMA_AT_THE_END = re.compile(r",\s*\}\s*\Z")


def read_leniently(line: bytes | bytearray) -> Request | None:
    """The request in a line that the strict parser refused; None if it cannot be read.

    What cannot be an id is answered as null. Never raises, whatever the bytes.
    """
    message = _decode(line.decode("utf-8-sig", errors="replace"))
    if not isinstance(message, dict) or not isinstance(message.get("method"), str):
        return None
    params, request_id = message.get("params"), message.get("id")
    readable = isinstance(request_id, str | int) and not isinstance(request_id, bool)
    return Request(
        message["method"],
        params if isinstance(params, dict) else {},
        request_id if readable else None,
        "id" in message,
    )


def _decode(text: str) -> object:
    """The JSON value of the text, or at least its outermost object; None if there is none."""
    try:
        return _DECODER.decode(text)
    except (ValueError, RecursionError):
        pass  # something inside it, perhaps: the outermost object alone is enough
    try:
        return _DECODER.decode(_COMMA_AT_THE_END.sub("}", _outermost(text)))
    except ValueError:
        return None


def _outermost(text: str) -> str:
    """The outermost object or list, with null for each that is nested in it; in one pass, however deep they are."""
    kept: list[str] = []
    kept_to = depth = 0
    for token in _STRINGS_AND_BRACKETS.finditer(text):
        first, start, end = text[token.start()], token.start(), token.end()
        if first in "[{":
            if depth <= 1 < depth + end - start:
                kept += (text[kept_to : start + 1 - depth], "null")
            depth += end - start
        elif first in "]}":
            depth -= 1
            kept_to = end if depth == 1 else kept_to
    return "".join(kept) + text[kept_to:] if depth == 0 else ""


def _int_that_fits(digits: str) -> int | None:
    return int(digits) if len(digits) <= MAX_INTEGER_DIGITS else None


def _most_urgent(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """Of keys that are said twice the last counts; of methods, one that stops before any other."""
    members = dict(pairs)
    methods = [value for key, value in pairs if key == "method"]
    for stop in STOPS:
        if stop in methods:
            members["method"] = stop
            break
    return members


_DECODER = json.JSONDecoder(object_pairs_hook=_most_urgent, parse_int=_int_that_fits, strict=False)
