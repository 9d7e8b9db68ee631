"""Parses JSON-RPC 2.0 lines strictly and without I/O into a ``Request`` or a ``Failure``.

What a robot must never guess at is refused rather than repaired: numbers that are not finite or do not fit, keys
said twice, text that is no Unicode, objects nested deeper than any method needs.
"""

import json
import math
import re
from collections.abc import Mapping
from typing import Any, NoReturn

from chefbotd.core.commands import CodedKind, RefusalKind
from chefbotd.core.record import Record
from chefbotd.rpc.encoding import EventPayload

MAX_DEPTH = 8
MAX_INTEGER_DIGITS = 19  # those of 2^63 - 1

RequestId = str | int | None


class ErrorKind(CodedKind):
    """The socket's own errors; a refusing robot adds ``RefusalKind``."""

    PARSE_ERROR = ("parse_error", -32700, "the line is not JSON")
    NOT_UTF8 = ("not_utf8", -32700, "the line is not UTF-8")
    NON_FINITE_NUMBER = ("non_finite_number", -32700, "NaN, Infinity, or a number beyond a double")
    HUGE_INTEGER = ("huge_integer", -32700, "an integer that does not fit 64 bits")
    DUPLICATE_KEY = ("duplicate_key", -32700, "an object has a key twice")
    TOO_DEEP = ("too_deep", -32700, f"nested deeper than {MAX_DEPTH}")
    LONE_SURROGATE = ("lone_surrogate", -32700, "an escape that is half of a surrogate pair")
    REQUEST_TOO_LARGE = ("request_too_large", -32600, "the line is too long; the connection is closed", True)
    INVALID_REQUEST = ("invalid_request", -32600, "JSON, but not a JSON-RPC 2.0 request")
    METHOD_NOT_FOUND = (
        "method_not_found",
        -32601,
        "this robot has no such method: it is misspelt, or of a component that its configuration does not ask for",
    )
    INVALID_PARAMS = (
        "invalid_params",
        -32602,
        "a parameter is missing, unknown, or of the wrong type or range",
    )
    UNKNOWN_TOPIC = ("unknown_topic", -32602, "no such topic on this robot")
    INTERNAL = ("internal", -32603, "a fault in the daemon; it is in the log")
    TOO_MANY_CLIENTS = ("too_many_clients", -32000, "too many clients; the connection is closed", True)
    UNAUTHENTICATED = ("unauthenticated", -32020, "this daemon requires a token; send authenticate first")
    WRONG_TOKEN = ("wrong_token", -32021, "the token is not valid; the connection is closed", True)
    FORBIDDEN = ("forbidden", -32022, "the client's role does not include this method")
    LEASE_HELD = ("lease_held", -32023, "another client has control of this source of commands")
    RATE_LIMITED = ("rate_limited", -32024, "too many requests a second; this one was not carried out")
    FLOODING = (
        "flooding",
        -32025,
        "too many requests that could not be served; the connection is closed",
        True,
    )
    TIMED_OUT = ("timed_out", -32026, "the client took too long; the connection is closed", True)
    OVERTAKEN = (
        "overtaken",
        -32027,
        "a stop was carried out that came after this command, or may have; send it again if it is still wanted",
    )
    TOO_OLD = (
        "too_old",
        -32028,
        "the command waited longer than a command remains in force, or through a pause of the daemon in which the "
        "robot drove; send it again if it is still wanted",
    )
    TOO_MANY_JOBS = ("too_many_jobs", -32030, "too many requests of this client are running")
    NO_SUCH_JOB = ("no_such_job", -32031, "no such request of this client is running")
    CANCELLED = ("cancelled", -32032, "the request was cancelled by cancel")


ERRORS: tuple[CodedKind, ...] = (*ErrorKind, *RefusalKind)
"""Every error that a client may be answered."""


class Request(Record, frozen=True):
    """A well-formed call; without ``wants_answer`` it is a notification: carried out, never answered."""

    method: str
    params: dict[str, Any]
    id: RequestId = None
    wants_answer: bool = True


class Failure(Record, frozen=True):
    """Why there is no result; ``details`` joins ``kind`` in the error's ``data``."""

    kind: CodedKind
    message: str
    id: RequestId = None
    details: Mapping[str, object] = {}


class _Unacceptable(ValueError):
    def __init__(self, kind: ErrorKind, message: str) -> None:
        super().__init__(message)
        self.kind = kind


def parse(line: bytes | bytearray) -> Request | Failure:
    """Parse a line without its end as a request; never raises."""
    try:
        message = _decode(line)
    except _Unacceptable as problem:
        return Failure(problem.kind, str(problem))
    except UnicodeDecodeError as problem:
        return Failure(ErrorKind.NOT_UTF8, f"byte {problem.start} is not UTF-8")
    except json.JSONDecodeError as problem:
        return Failure(ErrorKind.PARSE_ERROR, f"not JSON: {problem}")
    return _request(message)


def _decode(line: bytes | bytearray) -> object:
    if line.count(b"{") + line.count(b"[") > MAX_DEPTH and _depth(line) > MAX_DEPTH:
        raise _Unacceptable(ErrorKind.TOO_DEEP, f"nested deeper than {MAX_DEPTH}")
    message = _DECODER.decode(line.decode())
    if b"\\u" in line:
        _refuse_lone_surrogates(message)
    return message


def _depth(line: bytes | bytearray) -> int:
    """How deep the brackets outside of strings are nested, for any bytes."""
    depth = deepest = 0
    for run in _RUNS_OF_BRACKETS.findall(_STRING.sub(b"", line)):
        depth += len(run) if run[0] in b"[{" else -len(run)
        deepest = max(deepest, depth)
    return deepest


def _refuse_lone_surrogates(message: object) -> None:
    try:
        json.dumps(message, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        raise _Unacceptable(ErrorKind.LONE_SURROGATE, "half of a surrogate pair is not text") from None


def _without_duplicates(pairs: list[tuple[str, object]]) -> dict[str, object]:
    members = dict(pairs)
    if len(members) != len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise _Unacceptable(ErrorKind.DUPLICATE_KEY, f"{twice!a} appears twice")
    return members


def _bounded_int(digits: str) -> int:
    if len(digits.lstrip("-")) > MAX_INTEGER_DIGITS or not -(2**63) <= (value := int(digits)) < 2**63:
        raise _Unacceptable(ErrorKind.HUGE_INTEGER, f"{digits[:24]} does not fit 64 bits")
    return value


def _finite_float(text: str) -> float:
    value = float(text)
    return value if math.isfinite(value) else _refuse_constant(text)


def _refuse_constant(text: str) -> NoReturn:
    raise _Unacceptable(ErrorKind.NON_FINITE_NUMBER, f"{text[:24]} is not a finite number")


_DECODER = json.JSONDecoder(
    object_pairs_hook=_without_duplicates,
    parse_float=_finite_float,
    parse_int=_bounded_int,
    parse_constant=_refuse_constant,
)

_STRING = re.compile(rb'"(?:[^"\\]|\\.)*+"?', re.DOTALL)
"""Possessive, and its end optional: a string without an end is the whole rest, in one pass."""
_RUNS_OF_BRACKETS = re.compile(rb"[\[{]+|[\]}]+")

_MEMBERS = {"jsonrpc", "id", "method", "params"}


def _request(message: object) -> Request | Failure:
    """Check the envelope; a misspelt member is refused, since its absence would mean defaults."""
    if not isinstance(message, dict):
        return Failure(ErrorKind.INVALID_REQUEST, "a request is one JSON object; batches are not served")
    request_id = message.get("id")
    if isinstance(request_id, bool) or not isinstance(request_id, str | int | None):
        return Failure(
            ErrorKind.INVALID_REQUEST, f"id must be a string, an integer or null, got {request_id!r}"
        )
    problem = _envelope_problem(message)
    if problem is not None:
        return Failure(ErrorKind.INVALID_REQUEST, problem, request_id)
    return Request(message["method"], message.get("params", {}), request_id, "id" in message)


def _envelope_problem(message: dict[str, Any]) -> str | None:
    if message.get("jsonrpc") != "2.0":
        return f'jsonrpc must be "2.0", got {message.get("jsonrpc")!a}'
    if not isinstance(message.get("method"), str):
        return f"method must be a string, got {message.get('method')!a}"
    if not isinstance(message.get("params", {}), dict):
        return "params must be an object of named parameters"
    if unknown := sorted(message.keys() - _MEMBERS):
        return f"unknown member {unknown[0]!a}"
    return None


def encode(message: Mapping[str, object]) -> bytes:
    """Compact JSON without a line end; raises ``ValueError`` for numbers that are not finite."""
    return json.dumps(message, allow_nan=False, separators=(",", ":")).encode()


def result(request_id: RequestId, body: bytes) -> bytes:
    """The answer to a call; ``body`` is the result, already JSON."""
    id_json = b"%d" % request_id if isinstance(request_id, int) else json.dumps(request_id).encode()
    return b'{"jsonrpc":"2.0","id":%b,"result":%b}' % (id_json, body)


def notification(method: str, body: bytes) -> bytes:
    """A message that expects no answer; ``body`` is its params, already JSON."""
    return b'{"jsonrpc":"2.0","method":"%b","params":%b}' % (method.encode(), body)


def event(payload: EventPayload) -> bytes:
    """The notification of an event."""
    topic = payload.topic.encode()
    return _EVENT % (topic, payload.seq, payload.stamp_s, payload.age_s, payload.data)


_EVENT = (
    b'{"jsonrpc":"2.0","method":"event","params":'
    b'{"topic":"%b","seq":%d,"stamp_s":%.6f,"age_s":%.6f,"data":%b}}'
)


def error(failure: Failure) -> bytes:
    """The answer to a call that failed."""
    data = {"kind": str(failure.kind), **failure.details}
    body = {"code": failure.kind.code, "message": failure.message, "data": data}
    return encode({"jsonrpc": "2.0", "id": failure.id, "error": body})
