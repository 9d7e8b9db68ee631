"""No stop is lost: whatever a client says around it, however it is cut, and however its connection ends."""

import asyncio
from itertools import cycle

from structlog.testing import capture_logs

from chefbotd.clock import VirtualLoop
from chefbotd.core.geometry import Twist2D
from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.session import Session
from chefbotd.transport.connection import SocketConnection
from chefbotd.transport.unread import UnreadSockets
from tests.fakes.api import new_server
from tests.fakes.transport import FakeTransport

REASON = "found-by-the-fuzzer"
ESTOPS = (
    b'{"jsonrpc":"2.0","id":1,"method":"estop","params":{"reason":"%b"}}',
    b'{"jsonrpc":"2.0","method":"\\u0065stop","params":{"reason":"%b"}}\r',
    b'\xef\xbb\xbf {"method":"estop","params":{"reason":"%b"},"a":NaN,"a":"\t"} ',
    b'{"method":"estop","params":{"reason":"%b","\t":"\xff"},"id":[' + b"[" * 1500 + b"]" * 1500 + b"]}",
)
BEFORE = b'{"jsonrpc":"2.0","id":1,"method":"drive","params":{"linear_m_s":0.0625,"angular_rad_s":0}}\n'
PING = b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n'

_LOOP = VirtualLoop()
_SERVER, _ROBOT, _ = new_server(requests_per_turn=4, write_buffer_bytes=4096)
HINT = _SERVER.connections.dispatcher.urgent_pattern


def no_stop_is_lost(data: bytes) -> None:
    """An e-stop among these lines is carried out once, and what was sent before it does not move the robot after it.

    The first bytes say where it stands, how all is cut, in which form it comes and how the connection ends.
    """
    where, form, ends, *sizes = data[:6].ljust(6, b"\x01")
    lines = data[6:].split(b"\n")
    if REASON.encode() in data:
        return
    at = where % (len(lines) + 1)
    estop = ESTOPS[form % len(ESTOPS)] % REASON.encode()
    said = b"\n".join([*lines[:at], BEFORE + estop, *lines[at:]])
    _ROBOT.calls.clear()
    with capture_logs():
        _LOOP.run_until_complete(_say(PING + said, sizes, ends))
    _calls_are_sound(list(_ROBOT.calls))


async def _say(said: bytes, sizes: list[int], ends: int) -> None:
    """A client's whole life: it may read no answers for a while, and it stays, sends no more, or is gone."""
    session = _SERVER.connections.admit("127.0.0.1", 50000)
    assert isinstance(session, Session)
    connection, transport = SocketConnection(_SERVER.connections, UnreadSockets(), session), FakeTransport()
    transport.pause_writing, transport.resume_writing = connection.pause_writing, connection.resume_writing
    connection.connection_made(transport)
    transport.client_reads = ends & 4 == 0
    connection.send_event(
        EventPayload("text", 1, 0.0, 0.0, b"x" * 5000), True
    )  # so that it is behind, unless it reads
    start, size = 0, cycle(sizes)
    while start < len(said):
        end = start + 1 + next(size)
        connection.data_received(said[start:end])
        start = end
        if end % 3 == 0 or not transport.is_read:
            await asyncio.sleep(0)
    if ends & 8 == 0:
        transport.client_takes(1_000_000)  # it reads again
    if ends & 3 == 0:
        connection.data_received(b"\n")
    elif ends & 3 == 1:
        connection.eof_received()
    else:
        connection.connection_lost(None)
    await asyncio.sleep(0.5)
    if ends & 3 < 2:
        connection.connection_lost(None)
        await asyncio.sleep(0.5)


def _calls_are_sound(calls: list[tuple[object, ...]]) -> None:
    """Of several e-stops that come together while a connection ends any one will do."""
    estop, drive = ("estop", REASON), ("drive", "teleop", Twist2D(0.0625, 0.0))
    assert calls.count(estop) <= 1
    assert any(call[0] == "estop" for call in calls)
    if estop in calls and drive in calls:
        assert calls.index(drive) < calls.index(estop)
