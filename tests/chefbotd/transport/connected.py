"""A connection on a transport in memory, in front of a fake robot."""

import json
import socket

from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.session import Session
from chefbotd.transport.connection import SocketConnection
from chefbotd.transport.unread import UnreadSockets
from tests.fakes.api import new_server
from tests.fakes.robot import FakeRobot
from tests.fakes.transport import FakeTransport

PING = b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n'
STOP = b'{"jsonrpc":"2.0","id":2,"method":"stop"}\n'
DESCRIBE = b'{"jsonrpc":"2.0","id":3,"method":"describe"}\n'
ESTOP = b'{"jsonrpc":"2.0","id":4,"method":"estop","params":{"reason":"smoke"}}\n'
ARM = b'{"jsonrpc":"2.0","id":5,"method":"arm"}\n'
ESTOPPED = ("estop", "smoke")
BEHIND = b"x" * 5000  # more than the buffer takes before it pauses, and less than twice as much


def connected(plain: socket.socket | None = None) -> tuple[SocketConnection, FakeTransport, FakeRobot]:
    """A greeted connection to a fake robot; one turn is 16 requests, and ``describe`` overfills the buffer."""
    server, robot, _ = new_server(requests_per_turn=16, write_buffer_bytes=4096)
    transport = FakeTransport()
    session = server.connections.admit("127.0.0.1", 50000)
    assert isinstance(session, Session)
    connection = SocketConnection(server.connections, UnreadSockets(), session, plain)
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


def kinds(transport: FakeTransport) -> list[str]:
    """What was written: ``ok``, or the kind of error."""
    messages = [json.loads(line) for line in transport.written]
    return [message["error"]["data"]["kind"] if "error" in message else "ok" for message in messages]
