"""Backpressure on one connection, with the client's socket in memory and the clock virtual."""

import asyncio
import json
import socket

from chefbotd.api.connection import Connection
from chefbotd.api.session import Session
from chefbotd.clock import run_virtual
from tests.fakes.api import new_server
from tests.fakes.robot import FakeRobot
from tests.fakes.transport import FakeTransport

PING = b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n'
STOP = b'{"jsonrpc":"2.0","id":2,"method":"stop"}\n'
DESCRIBE = b'{"jsonrpc":"2.0","id":3,"method":"describe"}\n'


def connected() -> tuple[Connection, FakeTransport, FakeRobot]:
    """A greeted connection to a fake robot; one turn is 16 requests, and ``describe`` overfills the buffer."""
    server, robot, _ = new_server(requests_per_turn=16, write_buffer_bytes=4096)
    transport = FakeTransport()
    session = server.lobby.admit("127.0.0.1", 50000, 9)
    assert isinstance(session, Session)
    connection = Connection(server.lobby, session)
    transport.pause_writing = connection.pause_writing
    transport.resume_writing = connection.resume_writing
    connection.connection_made(transport)
    transport.written.clear()
    return connection, transport, robot


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


def test_a_request_is_answered_in_the_call_that_brings_it() -> None:
    """A stop has reached the robot, and its answer the socket, when ``data_received`` returns."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        connection.data_received(STOP)
        assert (robot.calls, answers(transport)) == ([("stop",)], 1)

    run_virtual(scenario())


def test_many_requests_at_once_do_not_keep_the_loop() -> None:
    """Of 40 requests in one chunk 16 are served per turn, and the socket is not read before all are."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        connection.data_received(PING * 40)
        served = [(answers(transport), transport.is_read)]
        for _turn in range(2):
            await asyncio.sleep(0)
            served.append((answers(transport), transport.is_read))
        assert served == [(16, False), (32, False), (40, True)]

    run_virtual(scenario())


def test_who_reads_no_answers_is_asked_no_more_and_loses_nothing() -> None:
    """One answer overfills the buffer: the next request waits until there is room, then is served."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        transport.client_reads = False
        connection.data_received(DESCRIBE + STOP)
        assert (answers(transport), transport.is_read, robot.calls) == (1, False, [])
        transport.client_takes(1_000_000)
        assert (answers(transport), transport.is_read, robot.calls) == (2, True, [("stop",)])

    run_virtual(scenario())


def test_who_falls_behind_on_telemetry_is_not_read() -> None:
    """Nor do unread requests pile up on our side when it is telemetry that fills the buffer."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        transport.client_reads = False
        connection.telemetry("text", True, b"x" * 5000)
        assert not transport.is_read
        connection.telemetry("text", True, b"waits")
        transport.client_takes(5000)
        assert (transport.written[-1], transport.is_read) == (b"waits", True)

    run_virtual(scenario())


def test_catching_up_within_a_turn_keeps_the_turns() -> None:
    """Room that appears while others have their turn does not bring this client's forward."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        connection.data_received(PING * 20)
        transport.client_reads = False
        connection.telemetry("text", True, b"x" * 5000)
        transport.client_takes(5000)
        assert answers(transport) == 16 + 1
        await asyncio.sleep(0)
        assert (answers(transport), transport.is_read) == (20 + 1, True)

    run_virtual(scenario())


def test_a_stuck_client_is_cut_off() -> None:
    """Five seconds with unread output and no progress end the connection."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        transport.client_reads = False
        connection.data_received(DESCRIBE)
        await asyncio.sleep(4.9)
        assert not transport.aborted
        await asyncio.sleep(0.2)
        assert transport.aborted

    run_virtual(scenario())


def test_a_lost_connection_leaves_nothing_behind() -> None:
    """Requests that waited are not served, and no timer is left."""

    async def scenario() -> None:
        connection, transport, robot = connected()
        connection.data_received(PING * 16 + STOP)
        connection.connection_lost(None)
        await asyncio.sleep(60.0)
        assert (robot.calls, transport.aborted) == ([], False)

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
