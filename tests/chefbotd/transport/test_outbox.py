"""One client's way out: what is kept, what gives way, what is told, and when it is cut off."""

import asyncio
import json
import socket
from collections import Counter

from chefbotd.clock import run_virtual
from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.transport.framing import LineFraming
from chefbotd.transport.outbox import Outbox
from tests.fakes.transport import FakeTransport

LIMITS = ApiParameters(write_buffer_bytes=4096, outbox_bytes=4096, write_timeout_s=5.0)
FILL = b"x" * 5000  # more than the write buffer takes before it pauses


def outbox(plain: socket.socket | None = None) -> tuple[Outbox, FakeTransport, Counter[str]]:
    """An outbox on a fake transport, and the count of all clients' drops; ``plain`` is the transport's socket."""
    transport, drops = FakeTransport(), Counter[str]()
    framing = LineFraming()
    box = Outbox(transport, LIMITS, drops, transport.abort, framing.encode, framing.event, plain=plain)
    transport.pause_writing, transport.resume_writing = box.hold_back, box.resume
    return box, transport, drops


def fall_behind(box: Outbox, transport: FakeTransport) -> None:
    """Let the client stop reading until the transport is full."""
    transport.client_reads = False
    box.reply(FILL)
    transport.written.clear()


def test_a_reading_client_gets_everything_at_once() -> None:
    """While there is room nothing waits, under either policy."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        box.telemetry("odometry", True, b"1")
        box.reply(b"2")
        box.telemetry("odometry", False, b"3")
        assert transport.written == [b"1", b"2", b"3"]

    run_virtual(scenario())


def test_latest_keeps_the_newest_of_each_topic() -> None:
    """A client that catches up gets each topic once, at its newest, and hears what it missed."""

    async def scenario() -> None:
        box, transport, drops = outbox()
        fall_behind(box, transport)
        for line in (b"o1", b"o2", b"o3"):
            box.telemetry("odometry", True, line)
        box.telemetry("battery", True, b"b1")
        assert transport.written == []
        transport.client_takes(5000)
        notice, *events = transport.written
        assert json.loads(notice) == {
            "jsonrpc": "2.0",
            "method": "dropped",
            "params": {"topics": {"odometry": 2}, "total": 2},
        }
        assert events == [b"o3", b"b1"]
        assert drops == {"odometry": 2}

    run_virtual(scenario())


def test_ordered_keeps_all_until_the_oldest_must_go() -> None:
    """Five events of 1000 bytes into 4096: the first one is dropped, the other four come in order."""

    async def scenario() -> None:
        box, transport, drops = outbox()
        fall_behind(box, transport)
        lines = [bytes([65 + i]) * 1000 for i in range(5)]
        for line in lines:
            box.telemetry("text", False, line)
        transport.client_reads = True
        transport.client_takes(5000)
        assert json.loads(transport.written[0])["params"] == {"topics": {"text": 1}, "total": 1}
        assert transport.written[1:] == lines[1:]
        assert drops == {"text": 1}

    run_virtual(scenario())


def test_drops_are_told_once() -> None:
    """The next time the client falls behind without loss there is no notice."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        for line in (b"o1", b"o2"):
            fall_behind(box, transport)
            box.telemetry("odometry", True, line)
            box.telemetry("odometry", True, line)
            transport.client_takes(5000)
        notices = [json.loads(line) for line in transport.written if b"dropped" in line]
        assert [n["params"]["total"] for n in notices] == [1]

    run_virtual(scenario())


def test_replies_are_written_even_to_a_client_that_is_behind() -> None:
    """An answer is never dropped, nor does it wait behind telemetry."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        fall_behind(box, transport)
        box.telemetry("odometry", True, b"o1")
        box.reply(b"answer")
        assert transport.written == [b"answer"]

    run_virtual(scenario())


def test_what_waits_is_not_all_poured_into_a_transport_that_fills_up_again() -> None:
    """Draining stops when the client falls behind again, and goes on later without loss."""

    async def scenario() -> None:
        box, transport, drops = outbox()
        fall_behind(box, transport)
        lines = [bytes([65 + i]) * 1300 for i in range(3)]
        for line in lines:
            box.telemetry("text", False, line)
        transport.client_takes(4500)  # 500 unread: three more lines are 4400, over the limit of 4096
        box.telemetry("text", False, b"last")
        assert transport.written == lines
        transport.client_takes(5000)
        assert transport.written == [*lines, b"last"]
        assert not drops

    run_virtual(scenario())


def test_a_stuck_client_is_cut_off_after_five_seconds() -> None:
    """With unread output and no progress for ``write_timeout_s``, the connection is aborted; not a moment before."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        fall_behind(box, transport)
        await asyncio.sleep(4.99)
        assert not transport.aborted
        await asyncio.sleep(0.02)
        assert transport.aborted

    run_virtual(scenario())


def test_a_slow_client_is_not_a_stuck_one() -> None:
    """Who reads a little every few seconds stays; who then stops does not."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        fall_behind(box, transport)
        for _ in range(3):
            await asyncio.sleep(4.0)
            transport.client_takes(100)
        assert not transport.aborted
        await asyncio.sleep(10.1)
        assert transport.aborted

    run_virtual(scenario())


def test_the_timeout_counts_from_the_last_progress() -> None:
    """Who reads a little at once and then nothing is cut off a timeout, and at most a tenth of one, after that."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        fall_behind(box, transport)
        await asyncio.sleep(0.1)
        transport.client_takes(100)
        await asyncio.sleep(5.0)
        assert not transport.aborted
        await asyncio.sleep(0.5)
        assert transport.aborted

    run_virtual(scenario())


def test_a_client_that_has_caught_up_is_watched_no_more() -> None:
    """After catching up, silence is no offence."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        fall_behind(box, transport)
        transport.client_takes(5000)
        await asyncio.sleep(60.0)
        assert not transport.aborted

    run_virtual(scenario())


def test_a_closing_client_gets_nothing_new() -> None:
    """After ``close`` neither telemetry nor answers are written, and a client that reads nothing is cut off."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        fall_behind(box, transport)
        box.telemetry("odometry", True, b"o1")
        box.close()
        box.reply(b"answer")
        box.telemetry("odometry", True, b"o2")
        assert (transport.closed, transport.written) == (True, [])
        await asyncio.sleep(5.1)
        assert transport.aborted

    run_virtual(scenario())


def test_a_closing_client_that_catches_up_is_left_to_the_transport() -> None:
    """What waited in the outbox is not written into a socket that is being closed."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        fall_behind(box, transport)
        box.close()
        transport.client_takes(5000)
        assert transport.written == []
        box.lost()
        await asyncio.sleep(60.0)
        assert not transport.aborted

    run_virtual(scenario())


def test_an_answer_to_keep_is_written_where_others_have_no_room() -> None:
    """Of a client that was sent two buffers while it was behind; a stop's answer is left out, a job's is not."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        fall_behind(box, transport)
        box.reply(FILL)
        box.reply(FILL)
        transport.written.clear()
        box.reply(b"stopped")
        box.reply(b"surveyed", keep=True)
        assert transport.written == [b"surveyed"]

    run_virtual(scenario())


def test_a_stop_behind_a_long_answer_is_answered() -> None:
    """Ten buffers of one answer are unread: there is room for the stop's all the same, and again after they are read."""

    async def scenario() -> None:
        box, transport, _ = outbox()
        for _ in range(2):
            transport.client_reads = False
            box.reply(b"x" * 40_960)
            box.reply(b"stopped")
            assert transport.written[-1] == b"stopped"
            transport.client_takes(50_000)

    run_virtual(scenario())


def event(data: bytes) -> EventPayload:
    """An event of the topic ``text``."""
    return EventPayload("text", 1, 0.0, 0.0, data)


def test_an_event_goes_to_the_socket_past_a_transport_that_holds_nothing() -> None:
    """The line is in the kernel at once; behind what the transport still holds it waits its turn."""

    async def scenario() -> None:
        ours, theirs = socket.socketpair()
        with ours, theirs:
            box, transport, _ = outbox(ours)
            box.write_event(event(b"1"), True)
            assert theirs.recv(4096) == LineFraming.event(event(b"1"))
            assert transport.written == []
            transport.client_reads = False
            box.reply(b"an answer")
            box.write_event(event(b"2"), True)
            assert transport.written == [b"an answer", LineFraming.event(event(b"2"))]

    run_virtual(scenario())


def test_what_the_kernel_does_not_take_goes_to_the_transport() -> None:
    """Its buffer takes a part of a long event, and nothing of a next one: no byte is lost, and none is sent twice."""

    async def scenario() -> None:
        ours, theirs = socket.socketpair()
        with ours, theirs:
            ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
            ours.setblocking(False)
            box, transport, _ = outbox(ours)
            long, short = event(b"x" * 1_000_000), event(b"2")
            box.write_event(long, True)
            taken = theirs.recv(1_000_000, socket.MSG_PEEK)
            assert 0 < len(taken) < 1_000_000
            assert b"".join([taken, *transport.written]) == LineFraming.event(long)
            transport.written.clear()
            box.resume()
            box.write_event(short, True)
            assert transport.written == [LineFraming.event(short)]

    run_virtual(scenario())


def test_an_event_for_a_client_that_has_gone_is_the_transports_to_refuse() -> None:
    """Its socket is closed: nothing is raised, and no other file that has its number now gets it."""

    async def scenario() -> None:
        ours, theirs = socket.socketpair()
        box, transport, _ = outbox(ours)
        ours.close()
        theirs.close()
        box.write_event(event(b"1"), True)
        assert transport.written == [LineFraming.event(event(b"1"))]

    run_virtual(scenario())
