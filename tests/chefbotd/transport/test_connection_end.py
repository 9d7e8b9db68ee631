"""How a connection ends: lost, ended by the server, or by its client."""

import asyncio
import json
import socket

import pytest

from chefbotd.clock import run_virtual
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from tests.chefbotd.transport.connected import (
    ARM,
    BEHIND,
    DESCRIBE,
    ESTOP,
    ESTOPPED,
    PING,
    STOP,
    answers,
    connected,
    kinds,
    text,
)


def test_a_lost_connection_leaves_nothing_behind() -> None:
    """Of the requests that waited none but a stop is served, and no timer is left."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        connection.data_received(PING * 16 + ARM + STOP[:-5])
        connection.data_received(STOP[-5:].strip() + ARM)
        connection.connection_lost(None)
        await asyncio.sleep(60.0)
        assert (robot.calls, transport.aborted, answers(transport)) == ([], False, 16)

        connection, transport, robot = connected()
        connection.data_received(PING * 16 + ARM + STOP.strip())
        connection.connection_lost(None)
        await asyncio.sleep(60.0)
        assert (robot.calls, transport.aborted, answers(transport)) == ([("stop",)], False, 16)

    run_virtual(scenario())


def test_what_is_ended_is_looked_through_for_a_while() -> None:
    """0.2 s, so that a stop behind what ended the connection is carried out; then nothing is listened to any more."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        connection.data_received(PING + b"x" * 5000)
        assert (kinds(transport), transport.closed) == (["ok", "request_too_large"], False)
        await asyncio.sleep(0)
        connection.data_received(b"x\n" + ARM + STOP)
        assert (robot.calls, answers(transport)) == ([("stop",)], 2)
        await asyncio.sleep(0.3)
        assert transport.closed
        connection.data_received(STOP)
        assert robot.calls == [("stop",)]

    run_virtual(scenario())


def test_what_is_ended_is_not_looked_through_without_end() -> None:
    """Half a megabyte is more than can have been on its way; then the connection is closed."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        connection.data_received(PING + b"x" * 5000)
        await asyncio.sleep(0)
        for _ in range(8):
            assert not transport.closed
            connection.data_received(b"x" * 65536)
        connection.data_received(b"x")
        assert transport.closed

    run_virtual(scenario())


def test_what_is_ended_is_not_worth_any_effort() -> None:
    """Of the same stop a thousand times one is carried out, and a thousand lines that look like one are enough."""

    async def scenario() -> None:
        connection, _, robot = connected()
        connection.data_received(PING * 16 + STOP * 999)
        connection.connection_lost(None)
        await asyncio.sleep(1.0)
        before_the_loss = 1
        assert len(robot.calls) == before_the_loss + 1

        connection, _, robot = connected()
        connection.data_received(PING * 16 + b'"stop"\n' * 1100 + STOP)
        connection.connection_lost(None)
        await asyncio.sleep(1.0)
        assert robot.calls == []

    run_virtual(scenario())


@pytest.mark.parametrize("at_once", [False, True])
@pytest.mark.parametrize(
    ("first", "calls"),
    [
        (b"", [ESTOPPED]),
        (b"oops\n", [ESTOPPED]),
        (b"POST / HTTP/1.1\r\n\r\n", []),
        (b"GET /" + b"x" * 5000 + b" HTTP/1.1\r\n\r\n", []),
    ],
)
def test_a_last_look_at_who_has_not_spoken_yet(
    first: bytes, calls: list[tuple[object, ...]], at_once: bool
) -> None:
    """A web page that comes when its connection is being ended cannot stop the robot either; others can."""

    async def scenario() -> None:
        ours, theirs = socket.socketpair()
        with ours, theirs:
            ours.setblocking(False)
            connection, transport, robot = connected(ours)
            if at_once:
                theirs.send(first + ESTOP)
            connection.end(Failure(ErrorKind.TIMED_OUT, "too slow"), at_once=at_once)
            for i in range(0 if at_once else len(first + ESTOP)):
                await asyncio.sleep(0)
                connection.data_received((first + ESTOP)[i : i + 1])
        await asyncio.sleep(0.3)
        assert (robot.calls, transport.closed) == (calls, True)

    run_virtual(scenario())


def test_what_comes_later_is_asked_for_again() -> None:
    """In a last look, too, a stop that comes after another was carried out is carried out."""

    async def scenario() -> None:
        connection, _, robot = connected()
        connection.data_received(PING + b"x" * 5000)
        await asyncio.sleep(0)
        connection.data_received(b"\n" + ESTOP + ESTOP)
        connection.data_received(ESTOP)
        assert robot.calls == [ESTOPPED] * 2

    run_virtual(scenario())


def test_who_is_stuck_while_being_ended_is_still_looked_through() -> None:
    """That its patience ends in that very moment does not cut the last look short."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.data_received(DESCRIBE)
        await asyncio.sleep(4.9)
        connection.end(Failure(ErrorKind.TIMED_OUT, "for another reason"))
        await asyncio.sleep(0.15)
        connection.data_received(STOP)
        assert (robot.calls, transport.closed, transport.aborted) == ([("stop",)], False, False)
        await asyncio.sleep(0.1)
        assert (transport.closed, transport.aborted) == (True, False)
        await asyncio.sleep(5.0)
        assert transport.aborted

    run_virtual(scenario())


def test_the_end_of_the_requests_waits_for_those_that_wait() -> None:
    """A client that half-closes while it is behind gets every answer as it reads, and then our side closes."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.send_event(text(BEHIND), latest=True)
        connection.data_received(PING + ARM + STOP.strip())
        connection.eof_received()
        assert (robot.calls, transport.closed) == ([("stop",)], False)
        transport.client_takes(1_000_000)
        del transport.written[0]
        assert (kinds(transport), transport.closed) == (["ok", "ok", "overtaken"], True)

    run_virtual(scenario())


def test_the_end_of_the_requests_closes_after_the_answers() -> None:
    """When the client closes its side, what it asked has been answered and our side closes."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        connection.data_received(PING)
        assert connection.eof_received() is False
        assert (json.loads(transport.written[0])["id"], transport.closed) == (1, True)

    run_virtual(scenario())


def test_the_end_of_the_requests_ends_the_last_one() -> None:
    """A stop without a line end, as ``printf`` sends it, is carried out and answered."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        connection.data_received(PING + STOP.strip())
        connection.eof_received()
        assert (robot.calls, answers(transport), transport.closed) == ([("stop",)], 2, True)

    run_virtual(scenario())


def test_half_a_request_is_none_also_at_the_end() -> None:
    """What was cut off in the middle is told to be no JSON, and does nothing."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        connection.data_received(STOP[:-4])
        connection.eof_received()
        error = json.loads(transport.written[0])["error"]
        assert (robot.calls, error["data"]["kind"], transport.closed) == ([], "parse_error", True)

    run_virtual(scenario())
