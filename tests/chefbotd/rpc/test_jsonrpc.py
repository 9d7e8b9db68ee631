"""The strict side of the socket: what is a request, and what each other line is refused as."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.core.commands import RefusalKind
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.jsonrpc import ERRORS, ErrorKind, Failure, Request
from tests.budget import examples


def test_request_carries_method_params_and_id() -> None:
    """A well-formed call is taken as it is."""
    line = b'{"jsonrpc":"2.0","id":7,"method":"drive","params":{"linear_m_s":0.5,"angular_rad_s":-1}}'
    assert jsonrpc.parse(line) == Request("drive", {"linear_m_s": 0.5, "angular_rad_s": -1}, 7)


def test_params_may_be_absent() -> None:
    """A method without parameters needs no empty object."""
    assert jsonrpc.parse(b'{"jsonrpc":"2.0","id":"a","method":"ping"}') == Request("ping", {}, "a")


@pytest.mark.parametrize(
    ("member", "request_id", "wants_answer"),
    [("", None, False), ('"id":null,', None, True), ('"id":0,', 0, True), ('"id":"",', "", True)],
)
def test_only_an_absent_id_makes_a_notification(member: str, request_id: object, wants_answer: bool) -> None:
    """An id of null, zero or nothing but quotes still asks for an answer."""
    request = jsonrpc.parse(f'{{"jsonrpc":"2.0",{member}"method":"stop"}}'.encode())
    assert request == Request("stop", {}, request_id, wants_answer)  # type: ignore[arg-type]


def nested(depth: int) -> bytes:
    """A request whose brackets are ``depth`` deep, its own included."""
    return b'{"jsonrpc":"2.0","method":"m","params":{"a":' + b"[" * (depth - 2) + b"]" * (depth - 2) + b"}}"


REFUSED = [
    (b"hello", ErrorKind.PARSE_ERROR),
    (b"", ErrorKind.PARSE_ERROR),
    (b"{}{}", ErrorKind.PARSE_ERROR),
    (b'{"jsonrpc":"2.0","method":"a\x00b"}', ErrorKind.PARSE_ERROR),
    (b'\xef\xbb\xbf{"jsonrpc":"2.0","method":"ping"}', ErrorKind.PARSE_ERROR),
    (b'{"method":"\xff"}', ErrorKind.NOT_UTF8),
    (b'{"method":"\xed\xa0\x80"}', ErrorKind.NOT_UTF8),
    (b'{"params":{"x":NaN}}', ErrorKind.NON_FINITE_NUMBER),
    (b'{"params":{"x":Infinity}}', ErrorKind.NON_FINITE_NUMBER),
    (b'{"params":{"x":-Infinity}}', ErrorKind.NON_FINITE_NUMBER),
    (b'{"params":{"x":1e999}}', ErrorKind.NON_FINITE_NUMBER),
    (b'{"params":{"x":-1.0e400}}', ErrorKind.NON_FINITE_NUMBER),
    (b'{"params":{"x":9223372036854775808}}', ErrorKind.HUGE_INTEGER),
    (b'{"params":{"x":-9223372036854775809}}', ErrorKind.HUGE_INTEGER),
    (b'{"params":{"x":' + b"9" * 4000 + b"}}", ErrorKind.HUGE_INTEGER),
    (b'{"method":"stop","method":"drive"}', ErrorKind.DUPLICATE_KEY),
    (b'{"params":{"x":1,"y":2,"x":3}}', ErrorKind.DUPLICATE_KEY),
    (b'{"a":1,"\\u0061":2}', ErrorKind.DUPLICATE_KEY),
    (nested(9), ErrorKind.TOO_DEEP),
    (b"[" * 4096, ErrorKind.TOO_DEEP),
    (b'{"a":' * 500, ErrorKind.TOO_DEEP),
    (b'{"method":"\\ud800"}', ErrorKind.LONE_SURROGATE),
    (b'{"\\udfff":1}', ErrorKind.LONE_SURROGATE),
    (b"[]", ErrorKind.INVALID_REQUEST),
    (b'[{"jsonrpc":"2.0","method":"ping"}]', ErrorKind.INVALID_REQUEST),
    (b"null", ErrorKind.INVALID_REQUEST),
    (b'{"method":"ping"}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":2.0,"method":"ping"}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":"1.0","method":"ping"}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":"2.0"}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":"2.0","method":7}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":"2.0","method":"drive","params":[1,2]}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":"2.0","method":"drive","params":null}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":"2.0","method":"reset_odometry","parms":{}}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":"2.0","id":true,"method":"ping"}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":"2.0","id":1.5,"method":"ping"}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":"2.0","id":[1],"method":"ping"}', ErrorKind.INVALID_REQUEST),
    (b'{"jsonrpc":"2.0","id":1,"result":{}}', ErrorKind.INVALID_REQUEST),
]


@pytest.mark.parametrize(("line", "kind"), REFUSED)
def test_what_is_no_request_is_refused_by_kind(line: bytes, kind: ErrorKind) -> None:
    """Each way of being no request has its stable name."""
    failure = jsonrpc.parse(line)
    assert isinstance(failure, Failure)
    assert failure.kind == kind


@pytest.mark.parametrize(
    "line",
    [
        nested(8),
        b'{"jsonrpc":"2.0","method":"m","params":{"reason":"[[[[[[[[[[{{{{\\"[["}}',
        b'{"jsonrpc":"2.0","method":"m","params":{"a":[],"b":[],"c":[],"d":[],"e":[],"f":[],"g":[]}}',
        b'{"jsonrpc":"2.0","method":"m","params":{"x":9223372036854775807,"y":-9223372036854775808}}',
        b'{"jsonrpc":"2.0","method":"m","params":{"text":"\\ud83e\\udd16 \\u00e9"}}',
    ],
)
def test_the_limits_are_not_tighter_than_they_say(line: bytes) -> None:
    """Eight levels, brackets inside text, 64-bit integers and whole surrogate pairs are fine."""
    assert isinstance(jsonrpc.parse(line), Request)


def test_a_refused_envelope_is_answered_under_its_id() -> None:
    """Where the id could be read, the error carries it."""
    failure = jsonrpc.parse(b'{"jsonrpc":"2.0","id":"x","method":7}')
    assert isinstance(failure, Failure)
    assert failure.id == "x"


def test_error_line_has_code_message_kind_and_details() -> None:
    """An error is one compact line with the kind's code, its name, and whatever else helps."""
    line = jsonrpc.error(Failure(RefusalKind.DISARMED, "arm first", 3, {"since_s": 2}))
    assert line.endswith(b"}")
    assert json.loads(line) == {
        "jsonrpc": "2.0",
        "id": 3,
        "error": {"code": -32001, "message": "arm first", "data": {"kind": "disarmed", "since_s": 2}},
    }


@pytest.mark.parametrize("request_id", [1, 'a"b', None, -5])
def test_result_line_echoes_the_id(request_id: str | int | None) -> None:
    """Whatever the id was, the answer's is the same."""
    line = jsonrpc.result(request_id, b'{"ok":true}')
    assert json.loads(line) == {"jsonrpc": "2.0", "id": request_id, "result": {"ok": True}}


def test_every_kind_of_error_has_a_code_and_a_meaning() -> None:
    """Codes are JSON-RPC's or ours, and the two enumerations are the table, and so what ``describe`` says."""
    for kind in ERRORS:
        assert kind.meaning, kind
        assert kind.code in {-32700, -32600, -32601, -32602, -32603} or -32099 <= kind.code <= -32000


def test_refusals_have_codes_of_their_own() -> None:
    """Two different refusals never share a code."""
    codes = [kind.code for kind in RefusalKind]
    assert len(set(codes)) == len(codes)


ALMOST_JSON = '{}[]":,\\u0123456789eE+-.ntf '


@settings(max_examples=examples(200), deadline=None)
@given(st.binary(max_size=300) | st.text(ALMOST_JSON, max_size=200).map(str.encode))
def test_any_bytes_are_a_request_or_a_failure(line: bytes) -> None:
    """No line raises, and every failure can be sent."""
    parsed = jsonrpc.parse(line)
    if isinstance(parsed, Failure):
        assert json.loads(jsonrpc.error(parsed))["error"]["data"]["kind"] == parsed.kind


@pytest.mark.parametrize("ending", [b"", b"\\", b'"', b"]"])
def test_quotes_without_end_are_read_in_one_pass(ending: bytes) -> None:
    """100,000 escaped quotes in a string without an end are refused, and not after the minutes of going back."""
    parsed = jsonrpc.parse(b"[" * 9 + b'"' + b'\\"' * 100_000 + ending)
    assert isinstance(parsed, Failure)
    assert parsed.kind == ErrorKind.TOO_DEEP


JSON_VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=examples(100), deadline=None)
@given(
    st.dictionaries(st.text(max_size=5), JSON_VALUES, max_size=4),
    st.integers(-(2**53), 2**53) | st.text(max_size=5),
)
def test_what_json_writes_is_read_back(params: dict[str, object], request_id: int | str) -> None:
    """Any request that the standard library writes comes out as it went in, or is too deep."""
    message = {"jsonrpc": "2.0", "id": request_id, "method": "m", "params": params}
    parsed = jsonrpc.parse(json.dumps(message).encode())
    if isinstance(parsed, Failure):
        assert parsed.kind == ErrorKind.TOO_DEEP
    else:
        assert parsed == Request("m", params, request_id)


def test_an_event_is_a_notification_with_the_data_as_it_is() -> None:
    """Topic, sequence number, stamp and age in microseconds, and the data."""
    message = jsonrpc.event(EventPayload("text", 7, 99.75, 0.0000004, b'{"text":"hello"}'))
    assert json.loads(message) == {
        "jsonrpc": "2.0",
        "method": "event",
        "params": {"topic": "text", "seq": 7, "stamp_s": 99.75, "age_s": 0.0, "data": {"text": "hello"}},
    }
