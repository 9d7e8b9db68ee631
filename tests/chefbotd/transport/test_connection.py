"""Backpressure on one connection, with the client's socket in memory and the clock virtual."""

import asyncio
import json
import socket

import pytest

from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Twist2D
from chefbotd.rpc.parameters import ApiParameters
from tests.chefbotd.rpc.test_lenient import STOPS
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

DRIVE = b'{"jsonrpc":"2.0","id":6,"method":"drive","params":{"linear_m_s":%.1f,"angular_rad_s":0}}\n'
TURN = (
    b'{"jsonrpc":"2.0","id":7,"method":"set_wheel_velocities",'
    b'"params":{"name":["left"],"velocity_rad_s":[1.0]}}\n'
)


def drove(linear_m_s: float) -> tuple[object, ...]:
    """The call that ``DRIVE`` leads to."""
    return ("drive", "teleop", Twist2D(linear_m_s, 0.0))


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


def test_nothing_is_sent_once_the_connection_is_closed_at_once() -> None:
    """Its transport throws a half line away: an event behind that would be read as the end of the line."""

    async def scenario() -> None:
        connection, transport, _ = connected()
        connection.abort()
        connection.send_event(text(b"{}"), latest=True)
        assert (transport.aborted, transport.written) == (True, [])

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
        assert transport.unread_bytes <= before + 2 * 4096 + 100

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
