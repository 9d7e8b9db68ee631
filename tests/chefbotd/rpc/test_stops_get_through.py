"""A complete request to stop that has reached the socket is carried out, whatever its client does otherwise."""

import asyncio
import contextlib
import socket
import struct
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import pytest
import uvloop
from structlog.testing import capture_logs

from chefbotd.clock import run_virtual
from chefbotd.rpc.session import Session
from tests.chefbotd.rpc.test_guarded import GUARD, TOKENS, tls_guard, trusting
from tests.fakes.api import Served, serving
from tests.waiting import PATIENCE_S

PING = b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n'
DESCRIBE = b'{"jsonrpc":"2.0","id":1,"method":"describe"}\n'
DRIVE = b'{"jsonrpc":"2.0","id":1,"method":"drive","params":{"linear_m_s":0.1,"angular_rad_s":0}}\n'
STOP = b'{"jsonrpc":"2.0","id":1,"method":"stop"}\n'
ESTOP = b'{"jsonrpc":"2.0","id":1,"method":"estop","params":{"reason":"smoke"}}\n'
ESTOPPED = ("estop", "smoke")

Run = Callable[[Any], None]
RECEIVE_BYTES = 16_384
BOTH_LOOPS = pytest.mark.parametrize("run", [run_virtual, uvloop.run])


@contextlib.asynccontextmanager
async def raw_client(served: Served) -> AsyncIterator[socket.socket]:
    """A client that does only what it is told to, and reads nothing."""
    with socket.socket() as client:
        # Virtual time does not wait for the kernel: it sends at once, and its buffer does not grow while nobody reads.
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
        client.connect((served.host, served.port))
        client.setblocking(False)
        await asyncio.sleep(0.01)
        yield client


async def until(happens: Callable[[], bool], within_s: float) -> bool:
    """Whether something happens in time; on the real clock, which a busy computer holds up, whether it does at all."""
    is_real = isinstance(asyncio.get_running_loop(), uvloop.Loop)
    for _ in range(round((PATIENCE_S if is_real else within_s) / 0.01)):
        if happens():
            return True
        if not is_real:
            let_the_kernel_deliver()
        await asyncio.sleep(0.01)
    return happens()


def let_the_kernel_deliver() -> None:
    """Virtual time goes on while a busy kernel still holds what was sent."""
    time.sleep(0.001)


async def send(client: socket.socket, data: bytes) -> None:
    """Send all, as fast as it is taken; raises ``ConnectionError`` when it is cut off."""
    while data:
        with contextlib.suppress(BlockingIOError):
            data = data[client.send(data) :]
        await asyncio.sleep(0)


def serve(run: Run, scenario: Callable[[Served], Awaitable[None]], **limits: Any) -> None:
    """Run a scenario with a served fake robot."""

    async def main() -> None:
        async with serving(**limits) as served:
            await scenario(served)

    with capture_logs():
        run(main())


def estopped(served: Served) -> bool:
    """Whether the request has been carried out."""
    return ESTOPPED in served.robot.calls


@BOTH_LOOPS
def test_from_a_client_that_reads_nothing(run: Run) -> None:
    """400 long answers unread, and more requests before and after: the e-stop is carried out, and not after 5 s."""

    async def scenario(served: Served) -> None:
        async with raw_client(served) as client:
            await send(client, DESCRIBE * 400)
            await asyncio.sleep(0.1)
            await send(client, PING * 100 + ESTOP + PING * 100)
            assert await until(lambda: estopped(served), 0.5)

    serve(run, scenario)


@BOTH_LOOPS
def test_byte_by_byte_from_a_client_that_reads_nothing(run: Run) -> None:
    """However its line is cut."""

    async def scenario(served: Served) -> None:
        async with raw_client(served) as client:
            await send(client, DESCRIBE * 400)
            await asyncio.sleep(0.1)
            for i in range(len(ESTOP)):
                await send(client, ESTOP[i : i + 1])
                await asyncio.sleep(0.001)
            assert await until(lambda: estopped(served), 0.5)

    serve(run, scenario)


@BOTH_LOOPS
def test_from_a_flooding_client_that_reads_nothing(run: Run) -> None:
    """What waits for who reads nothing is bounded, and so is the time until the rest is looked through: 1.5 s."""

    async def scenario(served: Served) -> None:
        async with raw_client(served) as client:
            await send(client, DESCRIBE * 400)
            await send(client, PING * 2500 + ESTOP)
            assert await until(lambda: estopped(served), 1.5)
            assert await until(lambda: served.clients == 0, 10.0)

    serve(run, scenario)


def hang_up(client: socket.socket) -> None:
    """Close, in good order."""
    client.close()


def half_close(client: socket.socket) -> None:
    """Send no more."""
    client.shutdown(socket.SHUT_WR)


def reset(client: socket.socket) -> None:
    """Close with a reset, whatever is still on its way to us."""
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()


WAYS_TO_GO = pytest.mark.parametrize("go", [hang_up, half_close, reset])


@BOTH_LOOPS
@WAYS_TO_GO
@pytest.mark.parametrize("before", [b"", PING * 100, DESCRIBE * 300, PING * 2000, b"oops\n" * 50])
@pytest.mark.parametrize("line_end", [b"\n", b""])
def test_from_a_client_that_goes_at_once(
    run: Run, go: Callable[[socket.socket], None], before: bytes, line_end: bytes
) -> None:
    """Closed, half closed or reset behind any number of requests; the last line may lack its end."""

    async def scenario(served: Served) -> None:
        async with raw_client(served) as client:
            await send(client, before + ESTOP.strip() + line_end)
            go(client)
            assert await until(lambda: estopped(served), 6.0)

    serve(run, scenario)


@BOTH_LOOPS
@WAYS_TO_GO
def test_from_a_client_that_has_gone_before_it_is_let_in(
    run: Run, go: Callable[[socket.socket], None]
) -> None:
    """Connected, said and gone within one turn of our loop."""

    async def scenario(served: Served) -> None:
        client = socket.create_connection((served.host, served.port))
        client.sendall(ESTOP)
        go(client)
        assert await until(lambda: estopped(served), 6.0)
        client.close()

    serve(run, scenario)


@BOTH_LOOPS
@pytest.mark.parametrize(
    "offence",
    [
        b"x" * 5000 + b"\n",
        b"\n" * 500,
        PING * 500,
        b"oops\n" * 500,
        b'{"jsonrpc":"2.0","id":1,"method":"' + b"x" * 100_000 + b'"}\n',
    ],
    ids=["too long", "empty lines", "requests", "no JSON", "far too long"],
)
def test_behind_what_ends_the_connection(run: Run, offence: bytes) -> None:
    """Whatever a client is cut off for, what it has sent by then is looked through."""

    async def scenario(served: Served) -> None:
        async with raw_client(served) as client:
            await send(client, PING + offence + ESTOP)
            assert await until(lambda: estopped(served), 0.5)
            assert await until(lambda: served.clients == 0, 1.0)

    serve(run, scenario, requests_per_s=10.0, requests_burst=20)


@BOTH_LOOPS
def test_from_a_client_that_makes_way(run: Run) -> None:
    """Whose place a newcomer needs is out of it at once, since descriptors are scarce, and its stop is carried out."""

    async def scenario(served: Served) -> None:
        async with raw_client(served), raw_client(served) as client:
            client.send(ESTOP)
            assert isinstance(served.server.connections.admit("127.0.0.2", 50000), Session)
            assert estopped(served)
            await asyncio.sleep(0.01)
            assert b"replaced by a new client" in client.recv(10_000)
            assert client.recv(1) == b""

    serve(run, scenario, max_new_connections=1)


def test_what_a_dead_client_asked_for_otherwise_is_not_done() -> None:
    """Nor what it asked for in between: only the stop is carried out."""

    async def scenario(served: Served) -> None:
        async with raw_client(served) as client:
            await send(client, DESCRIBE * 400 + DRIVE + STOP + DRIVE)
            await asyncio.sleep(0.1)
            reset(client)
            await asyncio.sleep(0.5)
            assert served.robot.calls == [("stop",)]

    serve(run_virtual, scenario)


@pytest.mark.parametrize(
    "said",
    [
        b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET /" + b"x" * 5000 + b" HTTP/1.1\r\n\r\n",
        bytes(range(255, 0, -1)) + b"\n",
    ],
    ids=["HTTP", "HTTP with a long path", "bytes"],
)
@pytest.mark.parametrize("go", [None, hang_up, reset])
def test_but_no_web_page_can_stop_the_robot(said: bytes, go: Callable[[socket.socket], None] | None) -> None:
    """Whose first line is of another protocol, or has no end, is not listened to, gone or not."""

    async def scenario(served: Served) -> None:
        client = socket.create_connection((served.host, served.port))
        client.sendall(said + ESTOP)
        if go is not None:
            go(client)
        await asyncio.sleep(1.0)
        assert served.robot.calls == []
        client.close()

    serve(run_virtual, scenario)


def authenticate(token: str) -> bytes:
    """A line that shows a token."""
    return b'{"jsonrpc":"2.0","id":1,"method":"authenticate","params":{"token":"%b"}}\n' % token.encode()


@BOTH_LOOPS
@WAYS_TO_GO
@pytest.mark.parametrize("behind", [b"", DESCRIBE * 300])
def test_with_the_token_that_it_takes(run: Run, go: Callable[[socket.socket], None], behind: bytes) -> None:
    """Who shows a token, says stop and goes at once has stopped the robot, before its greeting or behind requests."""

    async def scenario(served: Served) -> None:
        client = socket.create_connection((served.host, served.port))
        client.sendall(authenticate(TOKENS["observe"]) + behind + ESTOP)
        go(client)
        assert await until(lambda: estopped(served), 6.0)
        client.close()

    serve(run, scenario, guard=GUARD)


@pytest.mark.parametrize(
    "said", [b"", authenticate("w" * 32), authenticate("w" * 32) + authenticate(TOKENS["observe"])]
)
@WAYS_TO_GO
def test_but_not_without_it(said: bytes, go: Callable[[socket.socket], None]) -> None:
    """Neither without a token nor behind a wrong one, of which each connection has one."""

    async def scenario(served: Served) -> None:
        client = socket.create_connection((served.host, served.port))
        client.sendall(said + ESTOP)
        go(client)
        await asyncio.sleep(6.0)
        assert served.robot.calls == []
        client.close()

    serve(run_virtual, scenario, guard=GUARD)


@BOTH_LOOPS
@pytest.mark.parametrize(
    ("said", "within_s"),
    [
        (DESCRIBE * 400 + PING * 100, 0.5),
        (DESCRIBE * 400 + PING * 2500, 1.5),
        (PING * 100 + b"x" * 5000 + b"\n", 0.5),
        (PING * 5000, 2.0),
    ],
    ids=["reads nothing", "floods and reads nothing", "too long", "floods"],
)
def test_through_tls_as_well(run: Run, said: bytes, within_s: float) -> None:
    """What ends other connections, or holds them up, does so with encrypted ones, and their stops are carried out."""

    async def scenario(served: Served) -> None:
        _, writer = await asyncio.open_connection(served.host, served.port, ssl=trusting())
        writer.transport.pause_reading()  # type: ignore[attr-defined]
        writer.write(authenticate(TOKENS["observe"]) + said + ESTOP)
        assert await until(lambda: estopped(served), within_s)
        writer.transport.abort()

    serve(run, scenario, guard=tls_guard())


@BOTH_LOOPS
def test_through_tls_from_a_client_that_goes_at_once(run: Run) -> None:
    """Behind a hundred requests, with a close in good order."""

    async def scenario(served: Served) -> None:
        _, writer = await asyncio.open_connection(served.host, served.port, ssl=trusting())
        writer.write(authenticate(TOKENS["observe"]) + PING * 100 + ESTOP)
        writer.close()
        assert await until(lambda: estopped(served), 1.0)

    serve(run, scenario, guard=tls_guard())
