"""A far end for the client that says exactly what a test scripts, well-formed or not."""

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

HELLO = {
    "jsonrpc": "2.0",
    "method": "hello",
    "params": {
        "protocol": "1.0",
        "robot": "scripted",
        "session": "s1",
        "link": "up",
        "auth": "none",
        "capabilities": ["method.ping"],
        "something_newer": 1,
    },
}


class Daemon:
    """The scripted side of one connection."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self.writer = reader, writer

    def say(self, message: Any) -> None:
        """Send a message as a JSON line."""
        self.writer.write(json.dumps(message).encode() + b"\n")

    async def hear(self) -> dict[str, Any]:
        """The next request that wants an answer, or a cancel: a client without a name says that it is there."""
        request: dict[str, Any] = json.loads(await self._reader.readline())
        return request if "id" in request or request["method"] != "ping" else await self.hear()

    async def answer(self, **result: Any) -> dict[str, Any]:
        """Answer the next request with a result; the request."""
        request = await self.hear()
        self.say({"jsonrpc": "2.0", "id": request["id"], "result": result})
        return request


@asynccontextmanager
async def scripted(script: Callable[[Daemon], Awaitable[None]]) -> AsyncIterator[tuple[str, int]]:
    """Listen on a free port and play the script to every connection, which ends with it."""
    plays: list[asyncio.Task[None]] = []

    async def play(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            await script(Daemon(reader, writer))
            writer.close()
        finally:
            if not writer.is_closing():
                writer.transport.abort()

    def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        plays.append(asyncio.ensure_future(play(reader, writer)))

    server = await asyncio.start_server(accept, "127.0.0.1", 0, limit=1 << 20)
    try:
        yield server.sockets[0].getsockname()
    finally:
        server.close()
        for task in plays:
            task.cancel()
        await asyncio.gather(*plays, return_exceptions=True)
        await asyncio.sleep(0)
