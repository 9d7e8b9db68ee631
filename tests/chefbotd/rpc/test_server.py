"""The socket as a client sees it, over loopback: greeting, telemetry, limits, backpressure, and the end."""

import asyncio
import json
import socket
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
import uvloop
from structlog.testing import capture_logs

from chefbotd.clock import run_virtual
from chefbotd.core.events import Direction, LineSeen, TextReceived, TruthSimulated
from chefbotd.core.geometry import Pose2D, Twist2D
from tests.fakes.api import LineClient, Served, line_client, new_server, serving, tcp_server

PING = b'{"jsonrpc":"2.0","id":1,"method":"ping"}'


def with_client(
    scenario: Callable[[Served, LineClient], Awaitable[None]],
    *,
    run: Callable[[Any], None] = run_virtual,
    **options: Any,
) -> None:
    """Run a scenario with a served fake robot and one greeted client."""

    async def main() -> None:
        async with serving(**options) as served, line_client(served) as client:
            await scenario(served, client)

    run(main())


def test_the_greeting_comes_unasked() -> None:
    """Protocol, robot, session, link, auth and capabilities, before anything was sent."""

    async def main() -> None:
        async with serving(simulated=True) as served, line_client(served, greeted=False) as client:
            hello = await client.read()
            assert hello["method"] == "hello"
            params = hello["params"]
            assert {"method.drive", "topic.sim", "feature.snapshots"} <= set(params.pop("capabilities"))
            assert params == {
                "protocol": "1.0",
                "robot": "testbot",
                "session": "s1",
                "link": "down",
                "auth": "none",
                "command_timeout_s": 0.5,
            }

    run_virtual(main())


def test_the_greeting_tells_the_link() -> None:
    """After the device was opened the next client hears ``up``."""

    async def scenario(served: Served, _: LineClient) -> None:
        served.robot.link_is_up = True
        async with line_client(served, greeted=False) as second:
            assert (await second.read())["params"]["link"] == "up"

    with_client(scenario)


@pytest.mark.parametrize("run", [run_virtual, uvloop.run])
def test_an_event_never_overtakes_the_answer_before_it(run: Callable[[Any], None]) -> None:
    """A snapshot is sent in the turn of the loop that has answered ``subscribe``, and comes behind that answer."""

    async def scenario(served: Served, client: LineClient) -> None:
        served.bus.publish(TextReceived(1.0, "hi"))
        for number in range(1, 4):
            client.request("subscribe", number, topics=["text"])
            assert (await client.read())["id"] == number
            assert (await client.read())["params"]["data"] == {"text": "hi"}

    with_client(scenario, run=run)


@pytest.mark.parametrize("run", [run_virtual, uvloop.run])
def test_drive_and_telemetry_end_to_end(run: Callable[[Any], None]) -> None:
    """On asyncio's loop and on uvloop: a drive reaches the robot, an event every subscriber."""

    async def scenario(served: Served, client: LineClient) -> None:
        assert (await client.ask("drive", linear_m_s=0.1, angular_rad_s=0.0))["result"]["ok"]
        assert served.robot.calls == [("drive", "teleop", Twist2D(0.1, 0.0))]
        async with line_client(served) as second:
            for reader in (client, second):
                await reader.ask("subscribe", topics=["text"])
            served.bus.publish(TextReceived(1.0, "hi"))
            for reader in (client, second):
                assert (await reader.read())["params"]["data"] == {"text": "hi"}

    with_client(scenario, run=run)


def test_chunking_never_matters() -> None:
    """Byte by byte, glued, with CR LF or empty lines: the same answers in the same order."""

    async def scenario(_: Served, client: LineClient) -> None:
        data = b"\n\r\n" + PING + b"\r\n  " + PING.replace(b":1,", b":2,") + b"\n\n"
        client.send_raw(data)
        assert [(await client.read())["id"] for _ in range(2)] == [1, 2]
        for i in range(len(data)):
            client.send_raw(data[i : i + 1])
            await asyncio.sleep(0.001)
        assert [(await client.read())["id"] for _ in range(2)] == [1, 2]

    with_client(scenario)


@pytest.mark.parametrize("oversize", [b"x" * 4097, b"x" * 4097 + b"\n", b"[" * 100_000])
def test_an_oversize_request_is_answered_and_ends_the_connection(oversize: bytes) -> None:
    """Ended by a newline or not, a line beyond the limit gets its error, and what follows is not served."""

    async def scenario(served: Served, client: LineClient) -> None:
        client.send_raw(oversize)
        client.send(b'{"jsonrpc":"2.0","id":1,"method":"arm"}')
        answer = await client.read()
        assert (answer["id"], answer["error"]["data"]["kind"]) == (None, "request_too_large")
        with pytest.raises((EOFError, ConnectionResetError)):
            await client.read()
        assert (served.robot.calls, served.clients) == ([], 0)

    with_client(scenario)


def test_a_request_of_exactly_the_limit_is_served() -> None:
    """4096 bytes are within 4 KiB."""

    async def scenario(_: Served, client: LineClient) -> None:
        client.send(PING + b" " * (4096 - len(PING)))
        assert "result" in await client.read()

    with_client(scenario)


def test_raw_lines_are_made_only_while_someone_watches() -> None:
    """The link sees on the bus whether lines are wanted; two watchers, one tap."""

    async def scenario(served: Served, client: LineClient) -> None:
        assert not served.bus.has_listeners(LineSeen)
        await client.ask("subscribe", topics=["raw"])
        assert served.bus.has_listeners(LineSeen)
        served.bus.publish(LineSeen(1.0, Direction.TO_BOARD, b"s 10 10"))
        assert (await client.read())["params"]["data"] == {"direction": "out", "line": "s 10 10"}
        await client.ask("unsubscribe", topics=["raw"])
        assert not served.bus.has_listeners(LineSeen)
        await client.ask("subscribe", topics=["raw"])

    with_client(scenario)


def test_a_client_that_goes_takes_its_subscriptions_along() -> None:
    """After a disconnect nobody is counted, and nothing is made for nobody."""

    async def main() -> None:
        async with serving() as served:
            async with line_client(served) as client:
                await client.ask("subscribe", topics=["raw"])
                assert served.clients == 1
            await asyncio.sleep(0.01)
            assert (served.clients, served.bus.has_listeners(LineSeen)) == (0, False)

    run_virtual(main())


def test_the_truth_is_a_topic_of_simulated_robots_only() -> None:
    """``sim`` is served when there is a truth, and unknown otherwise."""

    async def simulated(served: Served, client: LineClient) -> None:
        await client.ask("subscribe", topics=["sim"])
        served.bus.publish(TruthSimulated(1.0, Pose2D(1.0, 2.0, 3.0), Twist2D(), False))
        assert (await client.read())["params"]["data"]["x_m"] == 1.0

    async def real(_: Served, client: LineClient) -> None:
        answer = await client.ask("subscribe", topics=["sim"])
        assert answer["error"]["data"]["kind"] == "unknown_topic"

    with_client(simulated, simulated=True)
    with_client(real)


def test_one_client_too_many_is_told_so() -> None:
    """Beyond the limit a client gets an error and its connection is closed; a leaving client makes room."""

    async def main() -> None:
        async with serving(max_clients=1, reserved_stop_connections=0) as served:
            async with line_client(served) as first, line_client(served) as second:
                assert "result" in await first.ask("ping")
                assert (await second.ask("describe"))["error"]["data"]["kind"] == "too_many_clients"
                with pytest.raises(EOFError):
                    await second.read()
            await asyncio.sleep(0.01)
            async with line_client(served):
                assert served.clients == 1

    with capture_logs() as logs:
        run_virtual(main())
    assert "client_refused" in [entry["event"] for entry in logs]


def test_a_half_closed_client_gets_its_answers() -> None:
    """``printf ... | nc -N`` works: requests before the end are answered, then the connection closes."""

    async def scenario(_: Served, client: LineClient) -> None:
        client.send(PING)
        client.half_close()
        assert "result" in await client.read()
        with pytest.raises(EOFError):
            await client.read()

    with_client(scenario)


BIG = b'{"jsonrpc":"2.0","id":%d,"method":"describe"}\n'


async def ask_without_reading(client: LineClient, requests: int) -> None:
    """Ask for far more than the buffers hold, reading nothing."""
    client.stop_reading()
    client.send_raw(b"".join(BIG % i for i in range(requests)))
    await asyncio.sleep(0.05)


def test_a_client_that_asks_without_reading_is_not_read_and_loses_nothing() -> None:
    """Its requests wait in the socket, others are served meanwhile, and when it reads every answer comes."""

    async def scenario(served: Served, client: LineClient) -> None:
        await ask_without_reading(client, 300)
        async with line_client(served) as other:
            assert "result" in await other.ask("ping")
        client.read_on()
        assert [(await client.read())["id"] for _ in range(300)] == list(range(300))

    with_client(scenario, run=uvloop.run)


def test_a_slow_client_loses_the_oldest_telemetry_and_is_told() -> None:
    """Received and dropped add up to what was published; the newest event is among the received."""
    published = 3000

    async def scenario(served: Served, client: LineClient) -> None:
        await client.ask("subscribe", topics=["text"], policy="ordered")
        client.stop_reading()
        for i in range(published):
            served.bus.publish(TextReceived(0.0, f"{i} " + "x" * 1000))
            if i % 100 == 0:
                await asyncio.sleep(0.01)
        await asyncio.sleep(0.01)
        client.read_on()
        received, dropped = await drained(client, f"{published - 1} ")
        assert dropped > 0
        assert received + dropped == published
        assert served.drops == {"text": dropped}

    with_client(scenario, run=uvloop.run)


async def drained(client: LineClient, last_text: str) -> tuple[int, int]:
    """Read until the last event has come: how many events came, and how many are said to be dropped."""
    received = dropped = 0
    while True:
        message = await client.read()
        if message["method"] == "dropped":
            dropped += message["params"]["topics"]["text"]
            continue
        received += 1
        if message["params"]["data"]["text"].startswith(last_text):
            return received, dropped


def test_the_end_of_the_server_ends_its_connections() -> None:
    """Cancelled, it closes every connection, takes its inboxes off the bus and frees the port."""

    async def main() -> None:
        async with serving() as served:
            reader, writer = await asyncio.open_connection(served.host, served.port)
            await reader.readline()
            writer.write(b'{"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"topics":["raw"]}}\n')
            assert json.loads(await reader.readline())["result"] == {"topics": ["raw"]}
        assert await reader.read() == b""
        writer.close()
        assert not served.bus.has_listeners(LineSeen)
        assert not served.bus.has_listeners(TextReceived)
        with pytest.raises(ConnectionRefusedError):
            await asyncio.open_connection(served.host, served.port)

    run_virtual(main())


def test_the_end_of_the_server_does_not_wait_for_a_stuck_client() -> None:
    """A client that reads nothing does not hold up the end."""

    async def scenario(served: Served, client: LineClient) -> None:
        await ask_without_reading(client, 300)

    with_client(scenario)


def test_an_address_in_use_is_an_error() -> None:
    """A second daemon on the same port fails to start, and says so."""

    async def main() -> None:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            server, _, _ = new_server(port=taken.getsockname()[1])
            with pytest.raises(OSError, match="address already in use"):
                await tcp_server(server).run()

    run_virtual(main())
