"""Nothing about a stop's form keeps the robot driving."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.driving.models import EstopParams, StopParams
from chefbotd.rpc.lenient import read_leniently
from tests.budget import examples
from tests.chefbotd.rpc.desk import Desk

REASONS: list[tuple[Any, str]] = [
    ("smoke", "smoke"),
    ("x" * 201, "x" * 200),
    ("", "asked by a client"),
    (" \n", "asked by a client"),
    (7, "asked by a client"),
    (None, "asked by a client"),
    (["smoke"], "asked by a client"),
    ("caf\udce9", "caf?"),
]


@pytest.mark.parametrize(("reason", "told"), REASONS)
def test_an_estop_is_carried_out_whatever_its_reason(reason: Any, told: str) -> None:
    """What is too long is cut, half a character is a question mark, what says nothing is left out."""
    desk = Desk()
    assert desk.ask("estop", reason=reason, extra=1)["result"] == {
        "ok": True,
        "stop_number": 0,
        "drivers": {},
    }
    assert desk.robot.calls == [("estop", told)]


STOPS = [
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":{"now":true}}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":[1,2]}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":null}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":"now"}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":{"why":NaN,"n":1e999}}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":{"n":' + b"9" * 3000 + b"}}",
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":{"a":1,"a":2}}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":{"a":' + b"[" * 20 + b"]" * 20 + b"}}",
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":{"why":"\\ud800"}}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":{"why":"caf\xe9"}}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":' + b"[" * 2000 + b"]" * 2000 + b"}",
    b'{"a":' + b'{"]":' * 1200 + b'"}"' + b"}" * 1200 + b',"id":1,"method":"stop"}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop","params":{"why":"a\tb\x1b[31m"}}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop",}',
    b'\xef\xbb\xbf{"jsonrpc":"2.0","id":1,"method":"stop"}',
    b'{"jsonrpc":"2.0","id":1,"method":"stop","parms":{}}',
    b'{"id":1,"method":"stop"}',
]


@pytest.mark.parametrize("line", STOPS)
def test_a_stop_is_carried_out_from_any_object_that_asks_for_it(line: bytes) -> None:
    """Each of these would be refused, were it not a stop."""
    desk = Desk()
    desk.dispatcher.serve(desk, line)
    assert desk.robot.calls == [("stop",)]
    assert desk.heard == [
        {"jsonrpc": "2.0", "id": 1, "result": {"ok": True, "stop_number": 0, "drivers": {}}}
    ]
    assert desk.ended == []


@pytest.mark.parametrize("line", STOPS[1:])
def test_nothing_else_is_read_leniently(line: bytes) -> None:
    """The same lines that ask to arm are refused."""
    desk = Desk()
    desk.dispatcher.serve(desk, line.replace(b"stop", b"arm"))
    assert desk.robot.calls == []
    assert "error" in desk.heard[0]


@pytest.mark.parametrize("request_id", [b"true", b"1.5", b"[1]", b"9" * 30])
def test_what_cannot_be_an_id_is_answered_as_null(request_id: bytes) -> None:
    """The stop is carried out all the same."""
    desk = Desk()
    desk.dispatcher.serve(desk, b'{"jsonrpc":"2.0","id":%b,"method":"stop"}' % request_id)
    assert (desk.robot.calls, desk.heard[0]["id"]) == ([("stop",)], None)


def test_a_lenient_stop_without_id_is_not_answered() -> None:
    """It is a notification like any other."""
    desk = Desk()
    desk.dispatcher.serve(desk, b'{"method":"stop"}')
    assert (desk.robot.calls, desk.heard) == ([("stop",)], [])


@pytest.mark.parametrize(
    ("line", "call"),
    [
        (b'{"id":1,"method":"estop","method":"ping"}', "estop"),
        (b'{"id":1,"method":"ping","method":"estop"}', "estop"),
        (b'{"id":1,"method":"stop","method":"arm"}', "stop"),
        (b'{"id":1,"method":"estop","method":"stop"}', "estop"),
        (b'{"id":1,"\\u006dethod":"stop","method":"drive"}', "stop"),
    ],
)
def test_of_methods_that_are_said_twice_the_one_that_stops_counts(line: bytes, call: str) -> None:
    """Whatever their order; which of the two was meant cannot be known, and to stop is the safe reading."""
    desk = Desk()
    desk.dispatcher.serve(desk, line)
    assert [name for name, *_ in desk.robot.calls] == [call]
    desk = Desk()
    desk.dispatcher.serve(desk, b'{"jsonrpc":"2.0","id":1,"method":"arm","method":"ping"}')
    assert (desk.robot.calls, desk.heard[0]["error"]["data"]["kind"]) == ([], "duplicate_key")


WORDS = [
    b"stop",
    b'"stop"',
    b'["stop"]',
    b'{"method":["stop"]}',
    b'{"a":' * 5000,
    b'{"a":' * 1500 + b'{"method":"stop"}' + b"}" * 1500,
    b'{"a":"' + b"[" * 1500 + b'\\",\\"method\\":\\"stop"}',
    b"]" * 1500 + b'{"method":"stop"}',
    b'{"method":"stop"}' * 2,
    b'{"method":"stop","a":"}',
]


@pytest.mark.parametrize("line", WORDS)
def test_words_are_no_request(line: bytes) -> None:
    """What is no JSON object with a method of its own asks for nothing, however deep it hides one."""
    assert read_leniently(line) is None


@settings(max_examples=examples(100), deadline=None)
@given(st.binary(max_size=200) | st.text('{}[]":,\\u09eE- method').map(str.encode))
def test_any_bytes_can_be_read(line: bytes) -> None:
    """No line raises."""
    read_leniently(line)


@settings(max_examples=examples(100), deadline=None)
@given(
    st.recursive(st.none() | st.booleans() | st.floats() | st.text(), st.lists)
    | st.dictionaries(st.text(), st.text())
)
def test_any_params_do(params: Any) -> None:
    """A stop takes everything, and an estop's reason can always be sent as UTF-8 and is never long or empty."""
    StopParams.model_validate(params)
    for given_params in (params, {"reason": params}):
        reason = EstopParams.model_validate(given_params).reason
        assert 1 <= len(reason) <= 200
        assert reason.encode()
