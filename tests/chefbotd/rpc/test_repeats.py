"""A client that says the same again is understood by its bytes, and is carried out under the same checks."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chefbotd.clock import ManualClock, run_virtual
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.arrivals import Arrivals, ByteArrival
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.jsonrpc import Failure, Request
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import DONE, Done, MotionParams
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.repeats import RepeatableRequest
from chefbotd.rpc.session import Session

LINE = b'{"jsonrpc": "2.0", "id": 41, "method": "drive", "params": {"linear_m_s": 0.21, "source": "a\\"id\\": 7"}}'


def repeatable_of(line: bytes) -> RepeatableRequest | None:
    """The request in a line, to recognize others by."""
    request = jsonrpc.parse(line)
    assert isinstance(request, Request)
    return RepeatableRequest.of(line, request)


def with_id(text: bytes) -> bytes:
    """The line with other bytes in the place of its id."""
    return LINE.replace(b"41", text)


@given(st.one_of(st.integers(0, 2**64).map(lambda number: b"%d" % number), st.binary(max_size=6)))
def test_a_line_is_recognized_only_as_what_it_says(text: bytes) -> None:
    """Whatever stands in the place of the id, the request is the one that a parser reads there."""
    known = repeatable_of(LINE)
    assert known is not None
    repeated = known.recognize(with_id(text))
    if repeated is not None:
        assert repeated == jsonrpc.parse(with_id(text))
        assert repeated.params is known.request.params


@pytest.mark.parametrize("text", [b"7", b"42", b"9" * 18])
def test_another_id_is_the_same_request(text: bytes) -> None:
    """Of one digit or of 18; a bytearray as well as bytes."""
    known = repeatable_of(LINE)
    assert known is not None
    repeated = known.recognize(bytearray(with_id(text)))
    assert repeated is not None
    assert (repeated.method, repeated.id, repeated.wants_answer) == ("drive", int(text), True)


@pytest.mark.parametrize(
    "text", [b"", b"-1", b"0", b"07", b"1.5", b"1e3", b"null", b'"41"', b"9" * 19, "\u0663".encode()]
)
def test_what_is_no_plain_number_is_parsed(text: bytes) -> None:
    """None, one below zero, zero, a zero before it, a fraction, text, more than 64 bits, digits of another script."""
    known = repeatable_of(LINE)
    assert known is not None
    assert known.recognize(with_id(text)) is None


@pytest.mark.parametrize(
    "line",
    [
        LINE.replace(b"0.21", b"0.22"),
        LINE.replace(b"drive", b"drift"),
        LINE + b" ",
        LINE[:-1],
        b"",
        LINE.replace(b' "method": "drive",', b""),
    ],
)
def test_another_line_is_not_recognized(line: bytes) -> None:
    """Another speed, another method, more or less at its end."""
    known = repeatable_of(LINE)
    assert known is not None
    assert known.recognize(line) is None


@pytest.mark.parametrize(
    "line",
    [
        b'{"jsonrpc":"2.0","method":"drive"}',
        b'{"jsonrpc":"2.0","id":"7","method":"drive"}',
        b'{"jsonrpc":"2.0","id":-7,"method":"drive"}',
        b'{"jsonrpc":"2.0","id":7,"method":"drive","params":{"id":8}}',
        b'{"jsonrpc":"2.0","method":"drive","params":{"id":8}}',
        rb'{"jsonrpc":"2.0","\u0069d":8,"method":"drive","params":{"id":8}}',
    ],
)
def test_a_line_without_one_plain_id_is_no_pattern(line: bytes) -> None:
    """A notification, an id that is text, one below zero, two of this name, a parameter's, one beside an escaped one."""
    assert repeatable_of(line) is None


class Wheel:
    """Turns; it can be told again what it does."""

    def __init__(self) -> None:
        self.carried_out: list[str] = []
        self.renews = True

    def _renew(self, caller: Caller, params: MotionParams) -> Done | None:
        self.carried_out.append("renewed")
        return DONE if self.renews else None

    @method(role=Role.DRIVE, moves=True, renew=_renew)
    def turn(self, caller: Caller, params: MotionParams) -> Done:
        """Turn."""
        self.carried_out.append("turned")
        return DONE


class Bench:
    """A dispatcher for a wheel, and one client of it."""

    def __init__(self) -> None:
        self.clock, self.wheel = ManualClock(100.0), Wheel()
        self.stop_number, self.heard = 3, list[Any]()
        self.arrivals = Arrivals(self.clock)
        rows = {row.name: row for row in methods_of(self.wheel)}
        self.dispatcher = Dispatcher(
            rows, self.clock, self.arrivals, 0.5, stop_number=lambda: self.stop_number
        )
        parameters = ApiParameters(requests_per_s=10.0, requests_burst=4)
        self.session = Session(parameters, "127.0.0.1", 50000, Role.DRIVE, 100.0)

    def reply(self, line: bytes) -> None:
        """An answer."""
        self.heard.append(json.loads(line))

    def end(self, failure: Failure) -> None:
        """The connection would be closed."""
        self.heard.append(failure)

    def turn(self, number: int, arrival: ByteArrival | None = None, **params: Any) -> str:
        """Ask; how it was answered."""
        request = {"jsonrpc": "2.0", "id": number, "method": "turn", "params": params}
        caller: Any = self
        self.dispatcher.serve(caller, json.dumps(request).encode(), arrival)
        answer = self.heard.pop()
        if isinstance(answer, Failure):
            return str(answer.kind)
        assert answer["id"] == number
        return str(answer["error"]["data"]["kind"]) if "error" in answer else "done"


def test_a_request_that_is_said_again_is_renewed() -> None:
    """The first is carried out, those that say the same are renewed, one that says otherwise is carried out."""
    bench = Bench()
    assert [bench.turn(1), bench.turn(2), bench.turn(3), bench.turn(4, if_stop_number=3)] == ["done"] * 4
    assert bench.wheel.carried_out == ["turned", "renewed", "renewed", "turned"]


def test_what_cannot_be_renewed_is_carried_out() -> None:
    """A method says so by None."""
    bench = Bench()
    bench.wheel.renews = False
    assert [bench.turn(1), bench.turn(2)] == ["done", "done"]
    assert bench.wheel.carried_out == ["turned", "renewed", "turned"]


def test_who_repeats_itself_needs_its_role_and_its_share() -> None:
    """After its role was taken away, or beyond its rate, nothing is renewed."""
    bench = Bench()
    assert bench.turn(1) == "done"
    bench.session.role = Role.OBSERVE
    assert bench.turn(2) == "forbidden"
    bench.session.role = None
    assert bench.turn(3) == "unauthenticated"
    bench.session.role = Role.DRIVE
    bench.session.stops_only = "the robot is full"
    assert bench.turn(4) == "too_many_clients"
    bench.session.stops_only = ""
    assert [bench.turn(5), bench.turn(6), bench.turn(7)] == ["done", "done", "rate_limited"]
    assert bench.wheel.carried_out == ["turned", "renewed", "renewed"]


def test_what_is_said_again_may_be_too_late() -> None:
    """It waited longer than a command holds, came before a stop, or was decided before one."""
    run_virtual(_be_late())


async def _be_late() -> None:
    bench = Bench()
    assert bench.turn(1, if_stop_number=3) == "done"
    early = bench.arrivals.earliest()
    bench.clock.advance(0.6)
    assert bench.turn(2, early, if_stop_number=3) == "too_old"
    new = bench.arrivals.earliest()
    bench.arrivals.record_stop(None, "somebody")
    assert bench.turn(3, new, if_stop_number=3) == "overtaken"
    bench.stop_number = 4
    assert bench.turn(4, bench.arrivals.earliest(), if_stop_number=3) == "stopped_since"
    assert bench.wheel.carried_out == ["turned"]


def test_parameters_that_were_refused_are_refused_again() -> None:
    """A line that is known by its bytes has been checked, or is checked now."""
    bench = Bench()
    assert [bench.turn(1, if_stop_number=-1), bench.turn(2, if_stop_number=-1)] == ["invalid_params"] * 2
    assert bench.wheel.carried_out == []
