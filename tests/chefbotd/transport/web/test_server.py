"""The page's server over real sockets: what HTTP gives to whom, and the WebSocket as another command socket."""

import asyncio
import contextlib
import gzip
import json
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
import uvloop
from structlog.testing import capture_logs
from websockets.frames import Opcode

from chefbotd.clock import run_virtual
from chefbotd.core.events import TextReceived
from chefbotd.rpc.access import Guard, Keyring
from chefbotd.rpc.parameters import Role
from tests.fakes.api import Served
from tests.fakes.web import HANDSHAKE, frame, frame_client, get, serving_page
from tests.waiting import until

ADMIN, OBSERVER = "admin-token-0123456789", "observe-token-0123456789"
GUARD = Guard(Keyring({ADMIN: Role.ADMIN, OBSERVER: Role.OBSERVE}))
PING = b'{"jsonrpc":"2.0","id":7,"method":"ping"}'
STOP = b'{"jsonrpc":"2.0","id":2,"method":"stop"}'
DRIVE = b'{"jsonrpc":"2.0","id":3,"method":"drive","params":{"linear_m_s":0.1,"angular_rad_s":-0.3}}'
DESCRIBE = b'{"jsonrpc":"2.0","id":4,"method":"describe"}'

BOTH_LOOPS = pytest.mark.parametrize("run", [run_virtual, uvloop.run])


def serve(
    scenario: Callable[[Served], Awaitable[None]], run: Callable[[Any], None] = run_virtual, **options: Any
) -> None:
    """Run a scenario with a served page."""

    async def served() -> None:
        async with serving_page(**options) as page:
            await scenario(page)

    run(served())


@BOTH_LOOPS
def test_it_speaks_as_the_command_socket_does(run: Callable[[Any], None]) -> None:
    """Greeting, answers, errors and events are the same JSON, a message each."""

    async def scenario(served: Served) -> None:
        async with frame_client(served, greeted=False) as client:
            hello = await client.read()
            assert (hello["method"], hello["params"]["robot"]) == ("hello", "testbot")
            assert (await client.ask("ping"))["result"]["pong"] is True
            assert (await client.ask("fly"))["error"]["data"]["kind"] == "method_not_found"
            assert (await client.ask("drive", linear_m_s=0.1, angular_rad_s=-0.3))["result"]["ok"]
            assert served.robot.calls[-1][0] == "drive"
            assert served.clients == 1
        await until(lambda: served.clients == 0)

    serve(scenario, run)


@BOTH_LOOPS
def test_a_stop_that_was_sent_counts_however_its_client_goes(run: Callable[[Any], None]) -> None:
    """Behind requests, in fragments, and with the connection closed at once; a half sent one is nothing."""

    async def scenario(served: Served) -> None:
        async with frame_client(served) as client:
            client.send_raw(
                frame(PING) * 40 + frame(STOP[:9], fin=False) + frame(STOP[9:], opcode=Opcode.CONT)
            )
        await until(lambda: served.robot.calls == [("stop",)])
        async with frame_client(served) as client:
            client.send_raw(frame(STOP)[:-1])
        await until(lambda: served.clients == 0)
        assert served.robot.calls == [("stop",)]

    serve(scenario, run)


@pytest.mark.realtime
def test_a_stop_is_carried_out_before_what_waits() -> None:
    """A client that reads nothing is obeyed when it stops, and its older commands move nothing any more."""

    async def scenario(served: Served) -> None:
        async with frame_client(served) as client:
            client.stop_reading()
            client.send_raw(frame(DESCRIBE) * 60 + frame(DRIVE) + frame(STOP))
            await until(lambda: served.robot.calls == [("stop",)])
            client.read_on()
            kinds = {}
            while len(kinds) < 2:
                message = await client.read()
                if message["id"] in (2, 3):
                    kinds[message["id"]] = message.get("error", {}).get("data", {}).get("kind", "ok")
            assert kinds == {2: "ok", 3: "overtaken"}
            assert served.robot.calls == [("stop",)]

    serve(scenario, uvloop.run)


@pytest.mark.realtime
def test_a_slow_page_costs_frames_and_not_memory() -> None:
    """Who does not read loses the older values of a topic, hears how many, and has the newest at the end."""

    async def scenario(served: Served) -> None:
        async with frame_client(served) as client:
            await client.ask("subscribe", topics=["text"])
            client.stop_reading()
            for number in range(2000):
                served.bus.publish(TextReceived(0.0, f"{number} " + "x" * 400))
                if number % 50 == 0:
                    await asyncio.sleep(0.001)
            await until(lambda: served.drops["text"] > 100)
            client.read_on()
            messages = [await client.read()]
            while messages[-1]["params"].get("data", {}).get("text", "").split(" ")[0] != "1999":
                messages.append(await client.read())
            told = [m["params"]["topics"]["text"] for m in messages if m["method"] == "dropped"]
            assert sum(told) == served.drops["text"] == 2000 - (len(messages) - len(told))

    serve(scenario, uvloop.run, write_buffer_bytes=4096)


def test_a_token_is_asked_for_as_on_the_command_socket() -> None:
    """Nothing before ``authenticate``; its role holds; a wrong one ends the connection, and no log holds a token."""

    async def scenario(served: Served) -> None:
        async with frame_client(served, greeted=False) as client:
            assert (await client.read())["params"]["auth"] == "token"
            assert (await client.ask("stop"))["error"]["data"]["kind"] == "unauthenticated"
            assert (await client.ask("authenticate", token=OBSERVER))["result"]["role"] == "observe"
            assert (await client.ask("drive", linear_m_s=0.1, angular_rad_s=0.0))["error"]["data"][
                "kind"
            ] == "forbidden"
            assert "result" in await client.ask("stop")
        async with frame_client(served) as client:
            assert (await client.ask("authenticate", token="wrong-token-0123456789"))["error"]["data"][
                "kind"
            ] == "wrong_token"
            with pytest.raises(EOFError):
                await client.read()

    with capture_logs() as logs:
        serve(scenario, guard=GUARD)
    assert "token-0123456789" not in json.dumps(logs, default=str)


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Host": "evil.example:7380", "Origin": "http://evil.example:7380"}, 421),  # DNS rebinding
        ({"Upgrade": "h2c"}, 426),
        ({"Sec_WebSocket_Version": "8"}, 426),
        ({"Sec_WebSocket_Key": "short"}, 426),
    ],
)
def test_a_handshake_that_is_not_the_pages_is_refused(headers: dict[str, str | None], status: int) -> None:
    """Of another site, under another name, of another version: no place is taken, nothing reaches the robot."""

    async def scenario(served: Served) -> None:
        given = {name.replace("-", "_").lower(): value for name, value in HANDSHAKE.items()}
        given |= {name.lower(): value for name, value in headers.items()}
        answer = await get(served, "/socket", **given)
        assert (answer.status, served.clients, served.robot.calls) == (status, 0, [])

    serve(scenario)


def test_its_own_origin_and_an_allowed_name_come_in() -> None:
    """As a browser sends them."""

    async def scenario(served: Served) -> None:
        own = f"{served.host}:{served.port}"
        async with frame_client(served, Origin=f"http://{own}"):
            pass
        async with frame_client(served, Host="chefbot.local:7380", Origin="http://chefbot.local:7380"):
            pass

    serve(scenario, allowed_hosts=["Chefbot.local"])


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"\x80" * 300, "parse_error"),
        (frame(b"x" * 70_000), "request_too_large"),
        (frame(b"x" * 5000), "request_too_large"),
    ],
)
def test_garbage_ends_the_connection_with_a_reason(data: bytes, kind: str) -> None:
    """As JSON, then with a closing frame; a stop before it has been carried out."""

    async def scenario(served: Served) -> None:
        async with frame_client(served) as client:
            client.send_raw(frame(STOP) + data)
            assert "result" in await client.read()
            assert (await client.read())["error"]["data"]["kind"] == kind
            assert (await client.frame()).opcode is Opcode.CLOSE
        assert (served.robot.calls, served.refused[kind]) == ([("stop",)], 1)

    serve(scenario)


def test_half_a_frame_has_ten_seconds() -> None:
    """As a request on the command socket has; a ping keeps nobody's frame alive."""

    async def scenario(served: Served) -> None:
        async with frame_client(served) as client:
            client.send_raw(frame(PING)[:4])
            await asyncio.sleep(9.0)
            assert served.clients == 1
            assert (await client.read())["error"]["data"]["kind"] == "timed_out"

    serve(scenario)


def test_pings_are_answered() -> None:
    """With what they said."""

    async def scenario(served: Served) -> None:
        async with frame_client(served) as client:
            client.send(b"there?", opcode=Opcode.PING)
            answer = await client.frame()
            assert (answer.opcode, bytes(answer.data)) == (Opcode.PONG, b"there?")

    serve(scenario)


def test_when_there_is_no_room_a_browser_hears_so() -> None:
    """The limits are those of the command socket, its places for stops too."""

    async def scenario(served: Served) -> None:
        async with frame_client(served) as first, frame_client(served) as second:
            assert "result" in await first.ask("ping")
            assert (await second.ask("describe"))["error"]["data"]["kind"] == "too_many_clients"
        async with frame_client(served) as first, frame_client(served) as second:
            assert "result" in await first.ask("ping")
            assert "result" in await second.ask("stop")

    serve(scenario, max_clients=1)


def test_the_page_lets_no_other_site_near() -> None:
    """Nothing from elsewhere, no inline script, no frame, no guess of types; and nothing is found beside its files."""

    async def scenario(served: Served) -> None:
        page = await get(served, "/")
        assert (page.status, page.headers["content-type"]) == (200, "text/html; charset=utf-8")
        policy = dict(
            part.strip().split(" ", 1) for part in page.headers["content-security-policy"].split(";")
        )
        assert (policy["default-src"], policy["script-src"], policy["frame-ancestors"]) == (
            "'none'",
            "'self'",
            "'none'",
        )
        assert (page.headers["x-frame-options"], page.headers["x-content-type-options"]) == (
            "DENY",
            "nosniff",
        )
        for path in ("/etc/passwd", "/../server.py", "/%2e%2e/server.py", "/index"):
            assert (await get(served, path)).status == 404
        assert (await get(served, "/", method="POST")).status == 405
        assert (await get(served, "/", Host="evil.example")).status == 421

    serve(scenario)


def test_files_are_sent_compressed_to_whom_takes_them_so() -> None:
    """A browser does; its bytes are the same; another one gets them as they are."""

    async def scenario(served: Served) -> None:
        plain = await get(served, "/style.css")
        packed = await get(served, "/style.css", Accept_Encoding="gzip, deflate, br")
        assert "content-encoding" not in plain.headers
        assert packed.headers["content-encoding"] == "gzip"
        assert packed.headers["vary"] == plain.headers["vary"] == "Accept-Encoding"
        assert gzip.decompress(packed.body) == plain.body
        assert len(packed.body) < 0.5 * len(plain.body)

    serve(scenario)


def test_figures_for_prometheus() -> None:
    """Named, with their kind and their labels, as they are now; not to a page under a foreign name."""

    async def scenario(served: Served) -> None:
        async with frame_client(served) as client:
            client.send_raw(b"\xff" * 100)
            with contextlib.suppress(EOFError):
                await client.read()
        async with frame_client(served):
            answer = await get(served, "/metrics")
        text = answer.body.decode()
        assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
        assert "# HELP chefbotd_clients Clients that are connected now." in text
        assert "# TYPE chefbotd_clients gauge\nchefbotd_clients 1.0\n" in text
        assert 'chefbotd_clients_refused_total{error="parse_error"} 1.0\n' in text
        assert (await get(served, "/metrics", Host="evil.example")).status == 421

    serve(scenario)


def test_figures_need_a_token_where_there_are_tokens() -> None:
    """As a bearer, which Prometheus can be configured with."""

    async def scenario(served: Served) -> None:
        assert (await get(served, "/metrics")).status == 401
        assert (await get(served, "/metrics", Authorization="Bearer wrong")).status == 401
        assert (await get(served, "/metrics", Authorization="Bearer r\u00e9seau")).status == 401
        assert (await get(served, "/metrics", Authorization=f"Bearer {OBSERVER}")).status == 200
        assert (await get(served, "/")).status == 200

    serve(scenario, guard=GUARD)


def test_idle_visitors_give_way() -> None:
    """Who opens connections and asks nothing keeps nobody from the page: the oldest goes after a second."""

    async def scenario(served: Served) -> None:
        idle = [await asyncio.open_connection(served.host, served.port) for _ in range(80)]
        await asyncio.sleep(1.0)
        assert (await get(served, "/")).status == 200
        assert await idle[0][0].read() == b""
        for _, writer in idle:
            writer.close()

    serve(scenario, max_new_connections=64)


def test_a_request_that_never_ends_is_cut_off() -> None:
    """A header line that goes on byte by byte has five seconds, and keeps nobody from the page meanwhile."""

    async def scenario(served: Served) -> None:
        slow = [await asyncio.open_connection(served.host, served.port) for _ in range(100)]
        for _, writer in slow:
            writer.write(b"GET / HTTP/1.1\r\nX-Slow: ")
        for _ in range(12):
            await asyncio.sleep(0.4)
            for _, writer in slow:
                writer.write(b"x")
        assert (await get(served, "/")).status == 200
        await asyncio.sleep(0.3)
        for reader, writer in slow:
            assert await reader.read() == b""
            writer.close()

    serve(scenario)
