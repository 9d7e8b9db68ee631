"""Parses JSON-RPC 2.0 lines strictly and without I/O into a ``Request`` or a ``Failure``.

What a robot must never guess at is refused rather than repaired: numbers that are not finite or do not fit, keys
said twice, text that is no Unicode, objects nested deeper than any method needs.
"""

import json
import math
import re
from collections.abc import Mapping
from enum import StrEnum
from typing import Any, NoReturn

from chefbotd.core.commands import RefusalKind
from chefbotd.core.record import Record
from chefbotd.rpc.encoding import EventPayload

MAX_DEPTH = 8
MAX_INTEGER_DIGITS = 19  # those of 2^63 - 1

RequestId = str | int | None


class ErrorKind(StrEnum):
    """Stable names of the socket's own errors; a refusing robot adds ``RefusalKind``."""

    PARSE_ERROR = "parse_error"
    NOT_UTF8 = "not_utf8"
    NON_FINITE_NUMBER = "non_finite_number"
    HUGE_INTEGER = "huge_integer"
    DUPLICATE_KEY = "duplicate_key"
    TOO_DEEP = "too_deep"
    LONE_SURROGATE = "lone_surrogate"
    REQUEST_TOO_LARGE = "request_too_large"
    INVALID_REQUEST = "invalid_request"
    METHOD_NOT_FOUND = "method_not_found"
    INVALID_PARAMS = "invalid_params"
    UNKNOWN_TOPIC = "unknown_topic"
    INTERNAL = "internal"
    TOO_MANY_CLIENTS = "too_many_clients"
    UNAUTHENTICATED = "unauthenticated"
    WRONG_TOKEN = "wrong_token"  # noqa: S105 - the name of an error
    FORBIDDEN = "forbidden"
    LEASE_HELD = "lease_held"
    RATE_LIMITED = "rate_limited"
    FLOODING = "flooding"
    TIMED_OUT = "timed_out"
    OVERTAKEN = "overtaken"
    TOO_OLD = "too_old"
    TOO_MANY_JOBS = "too_many_jobs"
    NO_SUCH_JOB = "no_such_job"
    CANCELLED = "cancelled"


class ErrorClass(Record, frozen=True):
    """A JSON-RPC code, what a kind of error means, and whether it ends the connection."""

    code: int
    meaning: str
    closes: bool = False


ERRORS: Mapping[str, ErrorClass] = {
    ErrorKind.PARSE_ERROR: ErrorClass(-32700, "the line is not JSON"),
    ErrorKind.NOT_UTF8: ErrorClass(-32700, "the line is not UTF-8"),
    ErrorKind.NON_FINITE_NUMBER: ErrorClass(-32700, "NaN, Infinity, or a number beyond a double"),
    ErrorKind.HUGE_INTEGER: ErrorClass(-32700, "an integer that does not fit 64 bits"),
    ErrorKind.DUPLICATE_KEY: ErrorClass(-32700, "an object has a key twice"),
    ErrorKind.TOO_DEEP: ErrorClass(-32700, f"nested deeper than {MAX_DEPTH}"),
    ErrorKind.LONE_SURROGATE: ErrorClass(-32700, "an escape that is half of a surrogate pair"),
    ErrorKind.REQUEST_TOO_LARGE: ErrorClass(
        -32600, "the line is too long; the connection is closed", closes=True
    ),
    ErrorKind.INVALID_REQUEST: ErrorClass(-32600, "JSON, but not a JSON-RPC 2.0 request"),
    ErrorKind.METHOD_NOT_FOUND: ErrorClass(
        -32601,
        "this robot has no such method: it is misspelt, or of a component that its configuration does not ask for",
    ),
    ErrorKind.INVALID_PARAMS: ErrorClass(
        -32602, "a parameter is missing, unknown, or of the wrong type or range"
    ),
    ErrorKind.UNKNOWN_TOPIC: ErrorClass(-32602, "no such topic on this robot"),
    ErrorKind.INTERNAL: ErrorClass(-32603, "a fault in the daemon; it is in the log"),
    ErrorKind.TOO_MANY_CLIENTS: ErrorClass(-32000, "too many clients; the connection is closed", closes=True),
    ErrorKind.UNAUTHENTICATED: ErrorClass(-32020, "this daemon requires a token; send authenticate first"),
    ErrorKind.WRONG_TOKEN: ErrorClass(
        -32021, "the token is not valid; the connection is closed", closes=True
    ),
    ErrorKind.FORBIDDEN: ErrorClass(-32022, "the client's role does not include this method"),
    ErrorKind.LEASE_HELD: ErrorClass(-32023, "another client has control of this source of commands"),
    ErrorKind.RATE_LIMITED: ErrorClass(-32024, "too many requests a second; this one was not carried out"),
    ErrorKind.FLOODING: ErrorClass(
        -32025, "too many requests that could not be served; the connection is closed", closes=True
    ),
    ErrorKind.TIMED_OUT: ErrorClass(
        -32026, "the client took too long; the connection is closed", closes=True
    ),
    ErrorKind.OVERTAKEN: ErrorClass(
        -32027,
        "a stop was carried out that came after this command, or may have; send it again if it is still wanted",
    ),
    ErrorKind.TOO_OLD: ErrorClass(
        -32028,
        "the command waited longer than a command remains in force, or through a pause of the daemon in which the "
        "robot drove; send it again if it is still wanted",
    ),
    ErrorKind.TOO_MANY_JOBS: ErrorClass(-32030, "too many requests of this client are running"),
    ErrorKind.NO_SUCH_JOB: ErrorClass(-32031, "no such request of this client is running"),
    ErrorKind.CANCELLED: ErrorClass(-32032, "the request was cancelled by cancel"),
    RefusalKind.DISARMED: ErrorClass(-32001, "the robot is disarmed; send arm first"),
    RefusalKind.ESTOPPED: ErrorClass(-32002, "the emergency stop is latched; send arm to release it"),
    RefusalKind.STOPPED: ErrorClass(
        -32029, "another client's stop blocks this source until its driver releases the controls or sends arm"
    ),
    RefusalKind.STOPPED_SINCE: ErrorClass(
        -32033,
        "the robot was stopped, or had a fault, after this was decided or sent; decide again, and send it again",
    ),
    RefusalKind.LINK_DOWN: ErrorClass(-32003, "the board is not connected"),
    RefusalKind.UNKNOWN_SOURCE: ErrorClass(-32004, "no such source of commands is configured"),
    RefusalKind.UNKNOWN_WHEEL: ErrorClass(-32005, "no such wheel"),
    RefusalKind.WORKER_UNAVAILABLE: ErrorClass(
        -32050, "the worker process is not available; the topic worker says why"
    ),
    RefusalKind.NOT_MAPPING: ErrorClass(-32051, "no map is being made; send start_mapping"),
    RefusalKind.ALREADY_MAPPING: ErrorClass(-32052, "another map is being made; finish or discard it first"),
    RefusalKind.OUT_OF_RANGE: ErrorClass(-32006, "a value outside the range of this robot"),
    RefusalKind.NOTHING_TO_UNDO: ErrorClass(-32007, "there is no change to take back"),
    RefusalKind.BAD_NAME: ErrorClass(-32040, "a map or a place cannot have this name"),
    RefusalKind.UNKNOWN_MAP: ErrorClass(-32041, "no map of this name is stored"),
    RefusalKind.MAP_EXISTS: ErrorClass(-32042, "another map has this name"),
    RefusalKind.MAP_UNREADABLE: ErrorClass(-32043, "a file is missing, damaged or not a map"),
    RefusalKind.NO_MAP_LOADED: ErrorClass(-32044, "no map is in use; send load_map"),
    RefusalKind.UNKNOWN_PLACE: ErrorClass(-32045, "the map has no place of this name"),
    RefusalKind.POSE_UNKNOWN: ErrorClass(-32046, "the robot's pose in the map is not known"),
    RefusalKind.UNKNOWN_ZONE: ErrorClass(-32059, "the map has no zone with this id"),
    RefusalKind.UNKNOWN_EDIT: ErrorClass(-32069, "the map has no edit with this id"),
    RefusalKind.CHANGED_MEANWHILE: ErrorClass(
        -32048, "somebody else changed this after it was read; read it again, and send the change again"
    ),
    RefusalKind.NEEDS_CONFIRMATION: ErrorClass(
        -32049, "this has a consequence that may not be meant; send it again with confirmed, if it is"
    ),
    RefusalKind.STORAGE_FAILED: ErrorClass(-32047, "the disk failed; what was stored before is unchanged"),
    RefusalKind.ALREADY_RECORDING: ErrorClass(
        -32053, "a recording is in progress; send stop_recording first"
    ),
    RefusalKind.NOT_RECORDING: ErrorClass(-32054, "nothing is being recorded; send start_recording"),
    RefusalKind.CANNOT_CALIBRATE: ErrorClass(-32056, "this step of the calibration cannot be begun now"),
    RefusalKind.NOT_CALIBRATED: ErrorClass(-32057, "no such step has passed; send calibrate"),
    RefusalKind.UNKNOWN_GOAL: ErrorClass(-32058, "no goal of this number or id is remembered"),
    RefusalKind.AGENT_EXISTS: ErrorClass(-32060, "this name, or this connection, is another agent's"),
    RefusalKind.NOT_AN_AGENT: ErrorClass(-32061, "only agents may do this; send register_agent first"),
    RefusalKind.UNKNOWN_AGENT: ErrorClass(-32062, "no agent has this name, or it does not offer this method"),
    RefusalKind.UNKNOWN_BUTTON: ErrorClass(-32063, "there is no such button"),
    RefusalKind.UNKNOWN_QUESTION: ErrorClass(-32064, "no such question waits for an answer"),
    RefusalKind.UNKNOWN_CALL: ErrorClass(-32065, "no such call of this agent waits for an answer"),
    RefusalKind.AGENT_FAILED: ErrorClass(-32066, "the agent answered that it failed; the message is its own"),
    RefusalKind.AGENT_LEFT: ErrorClass(-32067, "the agent left before it answered"),
    RefusalKind.AGENT_TIMED_OUT: ErrorClass(-32068, "the agent did not answer in time"),
    RefusalKind.CANNOT_INVITE: ErrorClass(-32070, "nobody can be invited like this; the message says why"),
    RefusalKind.NOT_INVITED: ErrorClass(
        -32071, "the invitation, or the access that it gave, does not exist or has ended"
    ),
    RefusalKind.TOO_MANY_ATTEMPTS: ErrorClass(-32072, "too many codes were tried; wait, and try again"),
    RefusalKind.NO_PICTURE: ErrorClass(-32073, "the camera has sent no picture; the message says why"),
    RefusalKind.TOO_MANY_VIEWERS: ErrorClass(
        -32074, "too many look at the camera, or one client asked twice"
    ),
    RefusalKind.LATCHED_AGAIN: ErrorClass(
        -32055,
        "the robot was stopped again by something newer than this arm was sent for; find out why, then send arm",
    ),
}


class Request(Record, frozen=True):
    """A well-formed call; without ``wants_answer`` it is a notification: carried out, never answered."""

    method: str
    params: dict[str, Any]
    id: RequestId = None
    wants_answer: bool = True


class Failure(Record, frozen=True):
    """Why there is no result; ``details`` joins ``kind`` in the error's ``data``."""

    kind: str
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
    body = {"code": ERRORS[failure.kind].code, "message": failure.message, "data": data}
    return encode({"jsonrpc": "2.0", "id": failure.id, "error": body})
