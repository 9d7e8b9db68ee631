"""Backpressure on one connection, with the client's socket in memory and the clock virtual."""

import asyncio
import json
import socket

import pytest

from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Twist2D
from chefbotd.rpc.event import EventPayload
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.rpc.session import Session
from chefbotd.transport.connection import Connection
from chefbotd.transport.unread import UnreadSockets
from tests.chefbotd.rpc.test_lenient import STOPS
from tests.fakes.api import new_server
from tests.fakes.robot import FakeRobot
from tests.fakes.transport import FakeTransport

PING = b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n'
STOP = b'{"jsonrpc":"2.0","id":2,"method":"stop"}\n'
DESCRIBE = b'{"jsonrpc":"2.0","id":3,"method":"describe"}\n'
ESTOP = b'{"jsonrpc":"2.0","id":4,"method":"estop","params":{"reason":"smoke"}}\n'
ARM = b'{"jsonrpc":"2.0","id":5,"method":"arm"}\n'
DRIVE = b'{"jsonrpc":"2.0","id":6,"method":"drive","params":{"linear_m_s":%.1f,"angular_rad_s":0}}\n'
TURN = (
    b'{"jsonrpc":"2.0","id":7,"method":"set_wheel_velocities",'
    b'"params":{"name":["left"],"velocity_rad_s":[1.0]}}\n'
)
ESTOPPED = ("estop", "smoke")
BEHIND = b"x" * 5000  # more than the buffer takes before it pauses, and less than twice as much


def drove(linear_m_s: float) -> tuple[object, ...]:
    """The call that ``DRIVE`` leads to."""
    return ("drive", "teleop", Twist2D(linear_m_s, 0.0))


def connected(plain: socket.socket | None = None) -> tuple[Connection, FakeTransport, FakeRobot]:
    """A greeted connection to a fake robot; one turn is 16 requests, and ``describe`` overfills the buffer."""
    server, robot, _ = new_server(requests_per_turn=16, write_buffer_bytes=4096)
    transport = FakeTransport()
    session = server.connections.admit("127.0.0.1", 50000)
    assert isinstance(session, Session)
    connection = Connection(server.connections, UnreadSockets(), session, plain)
    transport.pause_writing = connection.pause_writing
    transport.resume_writing = connection.resume_writing
    connection.connection_made(transport)
    transport.written.clear()
    return connection, transport, robot


def text(data: bytes) -> EventPayload:
    """An event of the topic ``text``."""
    return EventPayload("text", 1, 0.0, 0.0, data)


def answers(transport: FakeTransport) -> int:
    """How many messages were written."""
    return len(transport.written)


def test_small_messages_are_not_held_back_and_kernel_buffers_are_small() -> None:
    """No Nagle, and a kernel buffer that holds no more than our own, or telemetry would be old when read."""

    async def scenario() -> None:
        _, transport, _ = connected()
        assert transport.socket.options == {
            (socket.IPPROTO_TCP, socket.TCP_NODELAY): 1,
            (socket.SOL_SOCKET, socket.SO_SNDBUF): 4096,
        }

    run_virtual(scenario())


def test_an_event_is_encoded_once_for_all_clients() -> None:
    """Two connections write the very same line, with one line end."""

    async def scenario() -> None:
        clients, event = [connected() for _ in range(2)], text(b"{}")
        for connection, _, _ in clients:
            connection.send_event(event, latest=True)
        (one,), (other,) = (transport.written for _, transport, _ in clients)
        assert one is other
        assert (one.count(b"\n"), one.endswith(b'"data":{}}}\n')) == (1, True)

    run_virtual(scenario())


def test_a_request_is_answered_in_the_call_that_brings_it() -> None:
    """A stop has reached the robot, and its answer the socket, when ``data_received`` returns."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        connection.data_received(STOP)
        assert (robot.calls, answers(transport)) == ([("stop",)], 1)

    run_virtual(scenario())


def test_many_requests_at_once_do_not_keep_the_loop() -> None:
    """Of 40 requests in one chunk 16 are served per turn; the socket is read on, for there may be a stop in it."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        connection.data_received(PING * 40)
        served = [(answers(transport), transport.is_read)]
        for _turn in range(2):
            await asyncio.sleep(0)
            served.append((answers(transport), transport.is_read))
        assert served == [(16, True), (32, True), (40, True)]

    run_virtual(scenario())


def kinds(transport: FakeTransport) -> list[str]:
    """What was written: ``ok``, or the kind of error."""
    messages = [json.loads(line) for line in transport.written]
    return [message["error"]["data"]["kind"] if "error" in message else "ok" for message in messages]


def test_who_reads_no_answers_is_asked_no_more_and_loses_nothing() -> None:
    """One answer overfills the buffer: the next request waits until there is room, then is served."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.data_received(DESCRIBE + ARM)
        assert (answers(transport), transport.is_read, robot.calls) == (1, True, [])
        transport.client_takes(1_000_000)
        assert (answers(transport), transport.is_read, robot.calls) == (2, True, [("arm",)])

    run_virtual(scenario())


def test_a_stop_does_not_wait_for_a_client_that_is_behind() -> None:
    """It is carried out in the call that brings it, and answered at once; what was asked before it still waits."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.send_event(text(BEHIND), latest=True)
        connection.data_received(PING + ESTOP[:20])
        assert (answers(transport), robot.calls) == (1, [])
        connection.data_received(ESTOP[20:] + STOP)
        assert robot.calls == [ESTOPPED, ("stop",)]
        transport.client_takes(1_000_000)
        assert [json.loads(line)["id"] for line in transport.written[1:]] == [4, 2, 1]

    run_virtual(scenario())


IN_LINES = [line for line in STOPS if len(line) <= ApiParameters().max_request_bytes]


@pytest.mark.parametrize("line", [*IN_LINES, b'{"\\u006dethod":"\\u0073t\\u006fp"}'])
def test_a_stop_in_any_form_does_not_wait(line: bytes) -> None:
    """However bad its form, or hidden in escapes, it is seen among what waits."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.data_received(DESCRIBE + PING + line + b"\r\n" + PING)
        assert robot.calls == [("stop",)]

    run_virtual(scenario())


def test_no_motion_that_was_asked_for_before_a_stop_is_carried_out_after_it() -> None:
    """What a stop has overtaken and would move is refused as such; what was asked for after the stop is not."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.data_received(DESCRIBE + ARM + DRIVE % 0.1 + TURN + PING + STOP + DRIVE % 0.2)
        transport.written.clear()
        transport.client_takes(1_000_000)
        assert robot.calls == [("stop",), drove(0.2)]
        assert kinds(transport) == ["overtaken", "overtaken", "overtaken", "ok", "ok"]

    run_virtual(scenario())


def test_within_a_turn_requests_are_served_in_their_order() -> None:
    """A stop among a few requests of a client that reads its answers overtakes none of them."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        connection.data_received(ARM + DRIVE % 0.1 + STOP + DRIVE % 0.2 + ESTOP)
        assert robot.calls == [("arm",), drove(0.1), ("stop",), drove(0.2), ESTOPPED]
        assert kinds(transport) == ["ok"] * 5

    run_virtual(scenario())


def test_a_stop_behind_many_requests_is_carried_out_after_one_turn() -> None:
    """Not after all of those before it."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        connection.data_received(PING * 17 + DRIVE % 0.1 + PING * 500 + ESTOP)
        assert (answers(transport), robot.calls) == (17, [ESTOPPED])
        for _turn in range(40):
            await asyncio.sleep(0)
        assert (answers(transport), robot.calls) == (519, [ESTOPPED])

    run_virtual(scenario())


def test_looking_for_stops_keeps_the_loop_no_longer_than_serving_does() -> None:
    """Of 1300 lines that merely look like a stop 16 are read in a turn of 16; the stop behind them comes in time."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.data_received(
            DESCRIBE + b'{"jsonrpc":"2.0","method":"stop it","x":"stop"}\n' * 1300 + STOP
        )
        for _turn in range(81):
            assert (robot.calls, transport.is_read) == ([], False)
            await asyncio.sleep(0)
        assert (robot.calls, transport.is_read) == ([("stop",)], True)

    run_virtual(scenario())


def test_answers_to_stops_that_are_not_read_are_bounded() -> None:
    """Who leans on the stop key and reads nothing gets so many answers, and is obeyed all the same."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.data_received(DESCRIBE)
        before = transport.unread_bytes
        for _ in range(2000):
            connection.data_received(STOP * 5)
            await asyncio.sleep(0)
        assert robot.calls == [("stop",)] * 10_000
        assert transport.unread_bytes <= max(before, 2 * 4096 + 100)

    run_virtual(scenario())


def test_what_waits_for_a_client_that_is_behind_is_bounded() -> None:
    """At 64 KiB of requests it is not read any more; it has a second then, and is given up."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        transport.client_reads = False
        connection.data_received(DESCRIBE)
        read_bytes = 0
        while transport.is_read:
            connection.data_received(PING * 100)
            read_bytes += len(PING) * 100
        assert 65_536 < read_bytes <= 65_536 + len(PING) * 100
        await asyncio.sleep(0.9)
        assert not connection.closing
        await asyncio.sleep(0.2)
        assert (connection.closing, transport.is_read, transport.aborted) == (True, True, False)
        await asyncio.sleep(0.2)
        assert transport.aborted

    run_virtual(scenario())


def test_who_reads_a_little_is_waited_for() -> None:
    """As much waiting as may is no offence while the client makes progress."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        transport.client_reads = False
        connection.data_received(DESCRIBE + PING * 2000)
        for _ in range(10):
            await asyncio.sleep(0.9)
            transport.client_takes(10)
        assert (transport.is_read, connection.closing) == (False, False)

    run_virtual(scenario())


def test_who_falls_behind_on_telemetry_can_stop_the_robot() -> None:
    """Also when it is not by its own requests."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.send_event(text(BEHIND), latest=True)
        connection.send_event(text(b"waits"), latest=True)
        connection.data_received(PING + STOP)
        assert (robot.calls, answers(transport)) == ([("stop",)], 2)
        transport.client_takes(6000)
        assert (b"waits" in transport.written[2], answers(transport)) == (True, 4)

    run_virtual(scenario())


def test_catching_up_within_a_turn_keeps_the_turns() -> None:
    """Room that appears while others have their turn does not bring this client's forward."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        connection.data_received(PING * 20)
        transport.client_reads = False
        connection.send_event(text(b"x" * 5000), latest=True)
        transport.client_takes(5000)
        assert answers(transport) == 16 + 1
        await asyncio.sleep(0)
        assert (answers(transport), transport.is_read) == (20 + 1, True)

    run_virtual(scenario())


def test_a_stuck_client_is_cut_off() -> None:
    """Five seconds with unread output and no progress end the connection; stops that come meanwhile are carried out."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.data_received(DESCRIBE)
        await asyncio.sleep(4.9)
        assert not connection.closing
        await asyncio.sleep(0.2)
        assert (connection.closing, transport.aborted) == (True, False)
        connection.data_received(DRIVE % 0.1 + STOP)
        assert robot.calls == [("stop",)]
        await asyncio.sleep(0.1)
        assert transport.aborted

    run_virtual(scenario())


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
