"""What the socket withstands, over loopback: strangers, floods, drips, other protocols, and crowds."""

import asyncio
import contextlib
import itertools
import os
import resource
import socket
import struct
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from pathlib import Path

import pytest
import uvloop
from structlog.testing import capture_logs

from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Twist2D
from tests.fakes.api import LineClient, Served, line_client, serving
from tests.waiting import PATIENCE_S, until

PING = b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n'
STOP = b'{"jsonrpc":"2.0","id":1,"method":"stop"}\n'

Scenario = Callable[[Served, LineClient], Awaitable[None]]


def with_client(scenario: Scenario, *, uv: bool = False, **options: object) -> list[str]:
    """Run a scenario with a served fake robot and one greeted client; the kinds of clients refused, as logged."""

    async def main() -> None:
        async with serving(**options) as served, line_client(served) as client:
            await scenario(served, client)

    with capture_logs() as logs:
        (uvloop.run if uv else run_virtual)(main())
    return [entry["kind"] for entry in logs if entry["event"] == "client_refused"]


async def last_kind(client: LineClient) -> str:
    """Read to the end of the connection: the kind of the last error."""
    kind = ""
    with contextlib.suppress(EOFError, ConnectionResetError):
        while True:
            kind = (await client.read()).get("error", {}).get("data", {}).get("kind", kind)
    return kind


OTHER_PROTOCOLS = {
    "HTTP": b"POST / HTTP/1.1\r\nHost: 127.0.0.1:7333\r\nContent-Type: text/plain\r\n\r\n" + STOP,
    "TLS": bytes.fromhex("16030100c8010000c40303") + bytes(range(190)) + b"\n" + STOP,
    "SSH": b"SSH-2.0-OpenSSH_9.6\r\n" + STOP,
    "bytes": bytes(range(255, 0, -1)) + b"\n" + STOP,
    "NULs": b"\0" * 500 + b"\n" + STOP,
}


@pytest.mark.parametrize("said", OTHER_PROTOCOLS.values(), ids=OTHER_PROTOCOLS)
def test_whoever_speaks_another_protocol_is_cut_off_at_once(said: bytes) -> None:
    """A web page that posts commands here gets none of them carried out: the first line ends the connection."""

    async def scenario(served: Served, client: LineClient) -> None:
        client.send_raw(said)
        assert await last_kind(client) in {"parse_error", "not_utf8"}
        assert (served.robot.calls, served.clients) == ([], 0)

    with_client(scenario)


@pytest.mark.parametrize(
    ("said", "kind"),
    [
        (b"oops", "parse_error"),
        (b'{"a":', "parse_error"),
        (b'{"a":NaN}', "non_finite_number"),
        (b"[1]", "invalid_request"),
    ],
)
def test_a_slip_is_forgiven_also_in_the_first_line(said: bytes, kind: str) -> None:
    """Mistyped JSON, or words, cost an error and not the connection."""

    async def scenario(_: Served, client: LineClient) -> None:
        client.send(said)
        assert (await client.read())["error"]["data"]["kind"] == kind
        assert "result" in await client.ask("ping")

    with_client(scenario)


def test_too_many_requests_a_second_are_refused_but_never_a_stop() -> None:
    """Five at once, then no more; stop and estop pass; a second later ten more are served."""

    async def scenario(served: Served, client: LineClient) -> None:
        for _ in range(5):
            assert "result" in await client.ask("ping")
        assert (await client.ask("ping"))["error"]["data"]["kind"] == "rate_limited"
        assert "result" in await client.ask("stop")
        assert "result" in await client.ask("estop")
        assert served.robot.calls == [("stop",), ("estop", "asked by a client")]
        await asyncio.sleep(0.2)
        assert "result" in await client.ask("ping")

    with_client(scenario, requests_per_s=10.0, requests_burst=5)


def test_one_clients_rate_is_not_anothers() -> None:
    """Who is refused does not take from who is not."""

    async def scenario(served: Served, client: LineClient) -> None:
        client.send_raw(PING * 9)
        async with line_client(served) as other:
            assert "result" in await other.ask("ping")

    with_client(scenario, requests_per_s=1.0, requests_burst=5)


@pytest.mark.parametrize("line", [PING, b"[]\n", b"\r\n", b'{"jsonrpc":"2.0","method":"fly"}\n', b"{}\n"])
def test_a_flood_ends_the_connection(line: bytes) -> None:
    """Requests or nonsense, answered or not: what goes on beyond the limit and as much again is cut off."""

    async def scenario(served: Served, client: LineClient) -> None:
        client.send_raw(PING + line * 500)
        assert await last_kind(client) == "flooding"
        assert served.clients == 0
        assert served.refused == {"flooding": 1}

    assert with_client(scenario, requests_per_s=10.0, requests_burst=20) == ["flooding"]


def test_a_client_that_reads_nothing_is_counted_when_it_is_cut_off() -> None:
    """Once it has taken none of its answers for five seconds it is gone, and the log says why."""

    async def scenario(served: Served, client: LineClient) -> None:
        client.stop_reading()
        client.send_raw(b'{"jsonrpc":"2.0","id":1,"method":"describe"}\n' * 400)
        for _ in range(600):  # the kernel takes what it has room for in its own time
            if not served.clients:
                break
            await asyncio.sleep(0.1)
        assert (served.clients, served.refused) == (0, {"timed_out": 1})

    assert with_client(scenario) == ["timed_out"]


def test_a_flood_of_stops_is_no_flood() -> None:
    """Whoever leans on the stop key is stopped a thousand times, and stays connected."""

    async def scenario(served: Served, client: LineClient) -> None:
        client.send_raw(STOP * 1000)
        for _ in range(1000):
            assert "result" in await client.read()
        assert len(served.robot.calls) == 1000

    with_client(scenario, requests_per_s=10.0, requests_burst=20)


def test_a_request_that_drips_in_is_cut_off() -> None:
    """A byte a second keeps nothing open: the request had ten seconds from its first byte."""

    async def scenario(served: Served, client: LineClient) -> None:
        await client.ask("subscribe", topics=["text"])
        for i in range(10):
            client.send_raw(PING[i : i + 1])
            await asyncio.sleep(1.0)
        assert served.clients == 1
        await asyncio.sleep(0.5)
        assert await last_kind(client) == "timed_out"

    assert with_client(scenario) == ["timed_out"]


def test_an_idle_client_is_cut_off_and_a_subscriber_is_not() -> None:
    """Ten minutes without a request, unless it listens to something."""

    async def scenario(served: Served, client: LineClient) -> None:
        async with line_client(served) as listener:
            await listener.ask("subscribe", topics=["text"])
            await asyncio.sleep(601.0)
            assert await last_kind(client) == "timed_out"
            assert "result" in await listener.ask("ping")

    assert with_client(scenario) == ["timed_out"]


def test_one_address_cannot_take_all_the_room() -> None:
    """The third client from one address is refused though there is room; another address gets it."""

    async def main() -> None:
        async with serving(max_clients_per_address=2, reserved_stop_connections=0) as served:
            async with line_client(served) as first, line_client(served) as second:
                assert "result" in await first.ask("ping")
                assert "result" in await second.ask("ping")
                async with line_client(served) as third:
                    error = (await third.ask("describe"))["error"]
                    assert error["data"]["kind"] == "too_many_clients"
                    assert "2 clients from 127.0.0.1" in error["message"]
                elsewhere = await asyncio.open_connection(
                    served.host, served.port, local_addr=("127.0.0.2", 0)
                )
                assert b'"hello"' in await elsewhere[0].readline()
                elsewhere[1].close()
                assert "result" in await second.ask("ping")
            await asyncio.sleep(0.01)
            async with line_client(served) as again:
                assert "result" in await again.ask("ping")

    run_virtual(main())


KEPT_FULL = [{"max_clients": 3}, {"max_clients_per_address": 3}]


@pytest.mark.parametrize("limits", KEPT_FULL)
def test_an_estop_finds_a_place_where_everything_is_taken(limits: dict[str, int]) -> None:
    """The room is full, the places kept for stops are too: a newcomer's e-stop is carried out, the oldest there goes."""

    async def scenario(served: Served, client: LineClient) -> None:
        async with contextlib.AsyncExitStack() as stack:
            everyone = [await stack.enter_async_context(line_client(served)) for _ in range(4)]
            assert "result" in await client.ask("ping")
            for one in everyone[:2]:
                assert "result" in await one.ask("ping")
            for one in everyone[2:]:
                assert "result" in await one.ask("set_client_name", client="Ann")
            assert served.clients == 5
            late = await stack.enter_async_context(line_client(served))
            assert "result" in await late.ask("estop", reason="smoke")
            assert served.robot.calls == [("estop", "smoke")]
            assert await last_kind(everyone[2]) == "too_many_clients"
            for stayed in (client, *everyone[:2]):
                assert "result" in await stayed.ask("ping")
            assert "result" in await everyone[3].ask("stop")

    assert with_client(scenario, reserved_stop_connections=2, **limits) == ["too_many_clients"]


def test_a_place_kept_for_stops_is_for_nothing_else() -> None:
    """Whoever asks for more there is told that there is no room, and gone, but not before its stop is carried out.

    A free place is one for everything again.
    """

    async def scenario(served: Served, client: LineClient) -> None:
        assert "result" in await client.ask("ping")
        async with line_client(served) as late:
            assert "result" in await late.ask("set_client_name", client="Ann")
            late.request("arm")
            late.send(STOP.strip())
            assert await last_kind(late) == "too_many_clients"
            assert (served.clients, served.robot.calls) == (1, [("stop",)])
        client.half_close()
        await asyncio.sleep(0.01)
        async with line_client(served) as again:
            assert "result" in await again.ask("ping")

    with_client(scenario, max_clients=1)


def test_who_has_been_idle_longest_gives_way_before_anyone_is_refused() -> None:
    """Of four clients, one subscribes, one drives, one asks; the fourth asks nothing for 5 s and makes room for all."""

    async def scenario(served: Served, client: LineClient) -> None:
        async with contextlib.AsyncExitStack() as stack:
            idle, driver, asker = [await stack.enter_async_context(line_client(served)) for _ in range(3)]
            assert "result" in await idle.ask("ping")
            assert "result" in await client.ask("subscribe", topics=["text"])
            assert "result" in await driver.ask("take_control")
            for _ in range(6):
                await asyncio.sleep(1.0)
                assert "result" in await asker.ask("ping")
                assert "result" in await driver.ask("drive", linear_m_s=0.1, angular_rad_s=-0.2)
            late = await stack.enter_async_context(line_client(served))
            assert "result" in await late.ask("get_state")
            assert await last_kind(idle) == "too_many_clients"
            for stayed in (client, driver, asker):
                assert "result" in await stayed.ask("ping")
            await asyncio.sleep(0.1)
            assert served.clients == 4

    with_client(scenario, max_clients=4)


def test_few_descriptors_and_a_crowd_keep_no_estop_out() -> None:
    """64 descriptors and 60 clients that only connect, at once: the next one's e-stop is carried out."""
    crowded = Path(__file__).with_name("crowded_daemon.py")
    with subprocess.Popen(
        [sys.executable, "-m", "tests.chefbotd.rpc.crowded_daemon"],
        cwd=crowded.parents[3],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    ) as daemon:
        assert daemon.stderr is not None
        port = int(daemon.stderr.readline())
        with contextlib.ExitStack() as stack:
            for _ in range(60):
                stack.enter_context(socket.create_connection(("127.0.0.1", port)))
            late = stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S))
            late.sendall(b'{"jsonrpc":"2.0","id":1,"method":"estop"}\n')
            heard = late.makefile("rb")
            assert b'"hello"' in heard.readline()
            assert b'"ok":true' in heard.readline()
        daemon.kill()


@contextlib.contextmanager
def descriptors(soft: int) -> Iterator[None]:
    """Let this process have no more descriptors than so many."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def limit_that_leaves(count: int) -> int:
    """The limit under which so many more descriptors can be opened; those that other tests left may have any number."""
    free = (number for number in itertools.count() if not os.path.lexists(f"/proc/self/fd/{number}"))
    return next(itertools.islice(free, count, None))


@contextlib.asynccontextmanager
async def crowd(served: Served, count: int) -> AsyncIterator[list[socket.socket]]:
    """So many plain connections, made without waiting for anything."""
    sockets = []
    try:
        for _ in range(count):
            newcomer = socket.socket()
            sockets.append(newcomer)
            newcomer.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                newcomer.connect((served.host, served.port))
            await asyncio.sleep(0)
        yield sockets
    finally:
        for newcomer in sockets:
            newcomer.close()


@pytest.mark.parametrize("run", [run_virtual, uvloop.run])
def test_descriptors_are_kept_for_the_serial_link(run: Callable[..., None]) -> None:
    """New clients give way to newer ones while 32 descriptors are left, and come in again when others have gone."""

    async def main() -> None:
        async with serving() as served:
            async with crowd(served, 24):  # each has a descriptor at both ends, all in this process
                await until(lambda: served.refused["too_many_clients"] > 0)
            await until(lambda: served.clients == 0)
            async with line_client(served) as late:
                assert "result" in await late.ask("ping")

    with capture_logs() as logs, descriptors(limit_that_leaves(60)):
        run(main())
    assert logs[1]["reason"] == "replaced by a new client"


@pytest.mark.parametrize("run", [run_virtual, uvloop.run])
def test_the_listener_lives_through_running_out_of_descriptors(run: Callable[..., None]) -> None:
    """A newcomer that cannot be accepted waits in the kernel, and is served when there is room again."""

    async def main() -> None:
        async with serving() as served:
            with socket.socket() as newcomer:
                newcomer.setblocking(False)
                with descriptors(limit_that_leaves(0)):
                    with contextlib.suppress(BlockingIOError):
                        newcomer.connect((served.host, served.port))
                    await until(lambda: any(e["event"] == "client_not_accepted" for e in logs))
                    assert served.clients == 0
                async with asyncio.timeout(PATIENCE_S):
                    assert b'"hello"' in await asyncio.get_running_loop().sock_recv(newcomer, 1000)
                assert served.clients == 1

    with capture_logs() as logs:
        run(main())
    errors = {e["error"] for e in logs if e["event"] == "client_not_accepted"}
    assert errors == {"[Errno 24] Too many open files"}


def test_a_newcomer_that_has_gone_already_is_no_trouble() -> None:
    """Refused or let in, a client that resets its connection first leaves nothing behind."""

    async def main() -> None:
        async with serving(max_clients=1) as served, line_client(served) as client:
            for _ in range(3):
                newcomer = socket.create_connection((served.host, served.port))
                newcomer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                newcomer.close()
            await asyncio.sleep(0.1)
            assert "result" in await client.ask("ping")
            assert served.clients == 1

    with capture_logs():
        run_virtual(main())


def test_a_broken_handler_stops_nothing_else() -> None:
    """Out of memory in one client's request: it gets an error, it is counted, and another client drives on."""

    async def scenario(served: Served, client: LineClient) -> None:
        served.robot.answer = MemoryError()
        with capture_logs():
            assert (await client.ask("get_pid"))["error"]["data"]["kind"] == "internal"
        served.robot.answer = None
        async with line_client(served) as other:
            await other.ask("drive", linear_m_s=0.1, angular_rad_s=0.0)
        assert served.robot.calls[0] == ("drive", "teleop", Twist2D(0.1, 0.0))
        assert served.faults == {"get_pid": 1}
        assert "result" in await client.ask("ping")

    with_client(scenario)


def test_the_end_does_not_wait_for_who_reads_nothing() -> None:
    """A client with unread answers is cut off when the server ends."""

    async def main() -> None:
        async with contextlib.AsyncExitStack() as stack:
            async with serving() as served:
                client = await stack.enter_async_context(line_client(served))
                client.stop_reading()
                client.send_raw(b'{"jsonrpc":"2.0","id":1,"method":"describe"}\n' * 400)
                await asyncio.sleep(0.1)
                assert served.clients == 1
            await asyncio.sleep(0)
            assert served.clients == 0

    run_virtual(main())
