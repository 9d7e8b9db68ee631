"""Crowds of connections that show nothing, against clients that mean to stop the robot."""

import asyncio
import contextlib
import json
import socket
from collections import deque
from collections.abc import AsyncIterator

import pytest
from structlog.testing import capture_logs

from chefbotd.client import Client
from chefbotd.clock import run_virtual
from tests.chefbotd.rpc.test_guarded import GUARD, TOKENS
from tests.fakes.api import Served, serving

AWAY_S = 0.02
"""Each way, for a client in the same building."""
ADDRESSES = 4
KEPT = 300
"""So many silent connections fill the slots of these tests; the newest of them are kept open."""


async def connect(served: Served, number: int) -> socket.socket:
    """A connection that says nothing, from one of four addresses."""
    silent = socket.socket()
    silent.setblocking(False)
    silent.bind((f"127.0.0.{1 + number % ADDRESSES}", 0))
    with contextlib.suppress(BlockingIOError):
        silent.connect((served.host, served.port))
    return silent


@contextlib.asynccontextmanager
async def crowd(served: Served, per_s: int) -> AsyncIterator[None]:
    """So many silent connections a second; their own ends are closed long after they have lost their slots."""
    silent: deque[socket.socket] = deque()

    async def come() -> None:
        number = 0
        while True:
            for _ in range(5):
                silent.append(await connect(served, number))
                number += 1
            while len(silent) > 2 * KEPT:
                silent.popleft().close()
            await asyncio.sleep(5 / per_s)

    coming = asyncio.create_task(come())
    try:
        yield
    finally:
        coming.cancel()
        await asyncio.sleep(0.1)
        for each in silent:
            each.close()


class FarClient:
    """Goes step by step: what it sends is 20 ms on its way, and so is each answer."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    @classmethod
    async def connect(cls, served: Served, host: str) -> "FarClient":
        """Connect from an address, and wait for the greeting."""
        await asyncio.sleep(2 * AWAY_S)
        client = cls(*await asyncio.open_connection(served.host, served.port, local_addr=(host, 0)))
        assert (await client.read())["method"] == "hello"
        return client

    async def read(self) -> dict[str, object]:
        """The next message."""
        line = await self._reader.readline()
        await asyncio.sleep(AWAY_S)
        message: dict[str, object] = json.loads(line)
        return message

    async def ask(self, method: str, **params: object) -> dict[str, object]:
        """Send a request, and wait for its answer."""
        await asyncio.sleep(AWAY_S)
        line = json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params})
        self._writer.write(line.encode() + b"\n")
        return await self.read()

    def close(self) -> None:
        """Close the connection."""
        self._writer.close()


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.9"])
def test_an_estop_of_who_goes_step_by_step_arrives_beside_a_crowd(host: str) -> None:
    """250 connections a second from four addresses fill 300 slots; 20 clients beside them all stop the robot.

    So they do from an address of the crowd, and from another one. A slot lasts for 1.2 s, and the steps take 0.1 s.
    """

    async def main() -> None:
        async with serving(guard=GUARD, max_new_connections=KEPT) as served, crowd(served, 250):
            await asyncio.sleep(2.0)
            assert served.clients >= KEPT
            for _ in range(20):
                client = await FarClient.connect(served, host)
                assert "result" in await client.ask("authenticate", token=TOKENS["observe"])
                assert "result" in await client.ask("estop", reason="smoke")
                client.close()
            assert served.robot.calls == [("estop", "smoke")] * 20

    with capture_logs():
        run_virtual(main())


def test_who_has_shown_a_token_and_waits_keeps_its_connection_beside_a_crowd() -> None:
    """An e-stop button's program waits for 20 s beside a crowd of its own address, and its e-stop is carried out."""

    async def main() -> None:
        async with serving(guard=GUARD, max_new_connections=KEPT, max_clients=1) as served:
            button = await FarClient.connect(served, "127.0.0.1")
            assert "result" in await button.ask("authenticate", token=TOKENS["observe"])
            async with crowd(served, 250):
                await asyncio.sleep(20.0)
                assert "result" in await button.ask("estop", reason="button")
            button.close()

    with capture_logs():
        run_virtual(main())


def test_who_has_shown_a_token_is_never_replaced_by_who_has_not() -> None:
    """Where no token is asked for, who has sent a request is not replaced by who has sent none, however it waits."""

    async def main() -> None:
        async with serving(max_new_connections=8, max_clients=1, reserved_stop_connections=0) as served:
            button = await FarClient.connect(served, "127.0.0.1")
            assert "result" in await button.ask("ping")
            await asyncio.sleep(60.0)
            silent = [await connect(served, number) for number in range(20)]
            await asyncio.sleep(1.0)
            assert "result" in await button.ask("estop", reason="button")
            button.close()
            for each in silent:
                each.close()

    with capture_logs():
        run_virtual(main())


def test_a_client_of_ours_without_a_name_is_not_replaced_by_who_has_said_nothing() -> None:
    """It speaks at once, so 60 s later a crowd of silent connections takes no place from it."""

    async def main() -> None:
        async with serving(max_new_connections=8, max_clients=1, reserved_stop_connections=0) as served:
            async with Client.connect(served.host, served.port) as button:
                await asyncio.sleep(60.0)
                silent = [await connect(served, number) for number in range(20)]
                await asyncio.sleep(1.0)
                await button.estop("button")
            for each in silent:
                each.close()
            assert served.robot.calls == [("estop", "button")]

    with capture_logs():
        run_virtual(main())
