"""The server of the programs beside the daemon, over real sockets: silent, slow and many clients, and faults."""

import asyncio
import errno
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from aiohttp import web
from structlog.testing import capture_logs

from chefbotd.clock import run_virtual
from chefbotd.transport import tcp
from chefbotd.transport.web.http_server import HttpLimits, HttpServer
from tests.waiting import until

GET = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
LIMITS = HttpLimits(silent=8, connections=6)


async def answer(request: web.BaseRequest) -> web.StreamResponse:
    """A greeting; some paths do something else."""
    if request.path == "/fault":
        raise KeyError("a mistake")
    if request.path == "/forever":
        await asyncio.Event().wait()
    if request.path == "/body":
        return web.Response(text=str(len(await request.read())))
    return web.Response(text="hello")


class Bench:
    """A server, and clients of it from addresses of this computer."""

    def __init__(self, server: HttpServer, port: int) -> None:
        self.server, self.port = server, port
        self.writers: list[asyncio.StreamWriter] = []

    async def connect(self, host: str = "127.0.0.1") -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """A connection that is silent."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port, local_addr=(host, 0))
        self.writers.append(writer)
        return reader, writer

    async def ask(self, request: bytes = GET, host: str = "127.0.0.1") -> bytes:
        """What is answered; empty: the connection was closed."""
        reader, writer = await self.connect(host)
        writer.write(request)
        return await until_closed(reader)


async def until_closed(reader: asyncio.StreamReader) -> bytes:
    """What comes first; empty: the connection was closed."""
    try:
        return await reader.read(4096)
    except ConnectionError:
        return b""


@asynccontextmanager
async def serving(
    handle: Callable[[web.BaseRequest], Awaitable[web.StreamResponse]] = answer, limits: HttpLimits = LIMITS
) -> AsyncIterator[Bench]:
    """The server, while the block runs."""
    server = HttpServer(handle, "test", limits=limits)
    where: asyncio.Future[tuple[str, int]] = asyncio.get_running_loop().create_future()
    running = asyncio.create_task(server.run("127.0.0.1", 0, lambda *at: where.set_result(at)))
    bench = Bench(server, (await where)[1])
    try:
        yield bench
    finally:
        for writer in bench.writers:
            writer.close()
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


def serve(scenario: Callable[[Bench], Awaitable[None]], **options: Any) -> None:
    """Run a scenario with a server."""

    async def served() -> None:
        async with serving(**options) as bench:
            await scenario(bench)

    run_virtual(served())


def test_silent_connections_of_one_address_keep_nobody_out() -> None:
    """1,100 of them: at most 8 are kept, another address is served at once, the same one after a second."""

    async def scenario(bench: Bench) -> None:
        for _ in range(1100):
            await bench.connect("127.0.0.2")
        assert b"hello" in await bench.ask(host="127.0.0.3")
        assert len(bench.server._silent) <= 8
        await asyncio.sleep(LIMITS.least_s)
        assert b"hello" in await bench.ask(host="127.0.0.2")

    serve(scenario)


def test_what_is_not_a_complete_request_in_time_ends() -> None:
    """A head that goes on byte by byte, and one that never begins: both are closed after 5 s."""

    async def scenario(bench: Bench) -> None:
        silent, _ = await bench.connect()
        slow, writer = await bench.connect()
        writer.write(b"GET / HTTP/1.1\r\nX-Slow: ")
        await asyncio.sleep(LIMITS.header_s / 2)
        writer.write(b"more")
        assert await until_closed(silent) == await until_closed(slow) == b""
        assert bench.server.refused["late"] == 2
        assert len(bench.server._silent) == len(bench.server._speaking) == 0

    serve(scenario)


def test_a_body_that_does_not_come_and_an_answer_that_is_not_made_end() -> None:
    """After 10 s the connection is closed, and its place is free."""

    async def scenario(bench: Bench) -> None:
        head = b"POST /body HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\n"
        assert await bench.ask(head) == b""
        assert await bench.ask(b"GET /forever HTTP/1.1\r\nHost: localhost\r\n\r\n") == b""
        assert bench.server.refused["late"] == 2
        assert b"hello" in await bench.ask()

    serve(scenario)


def test_a_body_of_more_than_64_kib_is_refused() -> None:
    """It is not read to its end."""

    async def scenario(bench: Bench) -> None:
        size = LIMITS.body_bytes + 1
        head = b"POST /body HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\n\r\n" % size
        assert (await bench.ask(head + bytes(size))).startswith(b"HTTP/1.1 413 ")

    serve(scenario)


def test_a_fault_is_answered_counted_and_logged_once() -> None:
    """A hundred requests whose handler fails: a hundred answers, one line, and the next request is served."""

    async def scenario(bench: Bench) -> None:
        with capture_logs() as lines:
            for _ in range(100):
                said = await bench.ask(b"GET /fault HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
                assert said.startswith(b"HTTP/1.1 500 ")
        assert bench.server.faults == {"/fault": 100}
        assert [line["event"] for line in lines] == ["request_fault"]
        assert b"hello" in await bench.ask()

    serve(scenario)


def test_descriptors_are_left_for_the_programs_own_connections(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where only 32 would be left, a client is closed at once, and one line says so."""
    monkeypatch.setattr(tcp.resource, "getrlimit", lambda _: (tcp.RESERVED_DESCRIPTORS + 5, 4096))

    async def scenario(bench: Bench) -> None:
        with capture_logs() as lines:
            for _ in range(20):
                assert await bench.ask() == b""
        assert bench.server.refused == {"no place": 20}
        assert [line["why"] for line in lines] == ["short of file descriptors"]

    serve(scenario)


def test_an_error_of_accept_is_logged_once_and_served_later(monkeypatch: pytest.MonkeyPatch) -> None:
    """EMFILE a hundred times: one line, no busy loop, and the client is served when it is over."""

    async def scenario(bench: Bench) -> None:
        loop, failures = asyncio.get_running_loop(), 100
        accept = loop.sock_accept

        async def sock_accept(listener: socket.socket) -> Any:
            nonlocal failures
            if failures:
                failures -= 1
                raise OSError(errno.EMFILE, "Too many open files")
            return await accept(listener)

        monkeypatch.setattr(loop, "sock_accept", sock_accept)
        began_s = loop.time()
        with capture_logs() as lines:
            await bench.ask()  # accepted by the call that was waiting
            assert b"hello" in await bench.ask()
        assert loop.time() - began_s == pytest.approx(100 * tcp.ACCEPT_AGAIN_S, abs=0.2)
        assert [line["event"] for line in lines] == ["client_not_accepted"] * 2  # the second has the count
        assert not failures

    serve(scenario)


def test_who_has_shown_a_token_is_never_replaced() -> None:
    """Its connection outlives the limit of time and a crowd of its own address."""
    gone, there = asyncio.Event(), asyncio.Event()

    async def scenario(bench: Bench) -> None:
        reader, writer = await bench.connect()
        writer.write(GET)
        await there.wait()
        for _ in range(50):
            await bench.connect()
            await asyncio.sleep(LIMITS.least_s / 2)
        gone.set()
        assert b"goodbye" in await reader.read(4096)

    server: list[HttpServer] = []

    async def handle(request: web.BaseRequest) -> web.StreamResponse:
        server[0].show_proof(request)
        there.set()
        await gone.wait()
        return web.Response(text="goodbye")

    async def served() -> None:
        async with serving(handle) as bench:
            server.append(bench.server)
            await scenario(bench)

    run_virtual(served())


def test_a_client_that_goes_leaves_its_place() -> None:
    """A hundred that come, ask and go one after the other are all served."""

    async def scenario(bench: Bench) -> None:
        for _ in range(100):
            assert b"hello" in await bench.ask()
            bench.writers.pop().close()
            await until(lambda: not [c for c in bench.server._connections if getattr(c, "transport", None)])
        assert not bench.server.refused

    serve(scenario)
