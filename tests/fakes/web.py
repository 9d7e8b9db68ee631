"""The page's server on loopback with a fake robot behind it, and a raw WebSocket client that sees every frame."""

import asyncio
import json
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from websockets.frames import Frame, Opcode
from websockets.protocol import Protocol, Side, State

from chefbotd.metrics import Metrics
from chefbotd.rpc.access import Guard
from chefbotd.transport.parameters import PageParameters
from chefbotd.transport.web.server import PageServer
from tests.fakes.api import Served, new_server

ACCEPTED = "s3pPLMBiTxaQ9kYGzzhZRbK+xOo="
"""The answer to the key of the handshake; both are the example of RFC 6455, section 1.3."""
HANDSHAKE: dict[str, str | None] = {
    "Connection": "keep-alive, Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}


@asynccontextmanager
async def serving_page(
    allowed_hosts: Sequence[str] = (), origins: Sequence[str] = (), **options: Any
) -> AsyncIterator[Served]:
    """Serve a fake robot's page on a free port for as long as the block lasts; the options of ``new_server``."""
    server, robot, bus = new_server(**options)
    metrics = Metrics()
    server.add_metrics(metrics)
    parameters = PageParameters(
        enabled=True, port=0, allowed_hosts=tuple(allowed_hosts), origins=tuple(origins)
    )
    page = PageServer(server, parameters, options.get("guard") or Guard(), metrics)
    running = asyncio.gather(server.run(), page.run())
    try:
        host, port = await page.address()
        yield Served(server, robot, bus, host, port)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


@dataclass
class Answer:
    """An HTTP answer."""

    status: int
    headers: dict[str, str]
    body: bytes


async def read_head(reader: asyncio.StreamReader) -> tuple[int, dict[str, str]]:
    """An answer's status and its headers, in lower case."""
    async with asyncio.timeout(60.0):
        first, *lines = (await reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
    pairs = (line.partition(":") for line in lines if line)
    return int(first.split()[1]), {name.lower(): value.strip() for name, _, value in pairs}


async def get(served: Served, path: str, *, method: str = "GET", **headers: str | None) -> Answer:
    """Ask for a path over a connection of its own; an underscore in a header's name is a hyphen, None leaves it out."""
    reader, writer = await asyncio.open_connection(served.host, served.port)
    try:
        writer.write(_request(served, path, method, headers))
        status, told = await read_head(reader)
        size = int(told.get("content-length", 0))
        return Answer(status, told, await reader.readexactly(size) if method != "HEAD" else b"")
    finally:
        writer.close()


def _request(served: Served, path: str, method: str, headers: dict[str, str | None]) -> bytes:
    given = {name.replace("_", "-").lower(): value for name, value in headers.items()}
    sent = {"host": f"{served.host}:{served.port}", **given}
    lines = [f"{name}: {value}" for name, value in sent.items() if value is not None]
    return "\r\n".join([f"{method} {path} HTTP/1.1", *lines, "", ""]).encode()


class FrameClient:
    """A client that sends frames, or bytes as they are, and reads messages."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self._protocol = Protocol(Side.CLIENT, state=State.OPEN, max_size=None)
        self._read: list[Frame] = []

    def send(self, message: bytes, *, fin: bool = True, opcode: Opcode = Opcode.TEXT) -> None:
        """Send a frame."""
        self.send_raw(frame(message, fin=fin, opcode=opcode))

    def send_raw(self, data: bytes) -> None:
        """Send bytes as they are."""
        self._writer.write(data)

    async def frame(self, timeout_s: float = 60.0) -> Frame:
        """The next frame; raises ``EOFError`` at the end of the connection."""
        async with asyncio.timeout(timeout_s):
            while not self._read:
                data = await self._reader.read(65_536)
                if not data:
                    raise EOFError
                self._protocol.receive_data(data)
                self._read += [each for each in self._protocol.events_received() if isinstance(each, Frame)]
        return self._read.pop(0)

    async def read(self) -> dict[str, Any]:
        """The next message."""
        frame = await self.frame()
        if frame.opcode is Opcode.CLOSE:
            raise EOFError
        assert (frame.opcode, frame.fin) == (Opcode.TEXT, True)
        message: dict[str, Any] = json.loads(bytes(frame.data))
        return message

    async def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a request; its answer, with events in between left out."""
        self.send(json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params}).encode())
        while True:
            message = await self.read()
            if message.get("id") == 1:
                return message

    def stop_reading(self) -> None:
        """Read nothing more from the socket."""
        self._writer.transport.pause_reading()  # type: ignore[attr-defined]

    def read_on(self) -> None:
        """Read again."""
        self._writer.transport.resume_reading()  # type: ignore[attr-defined]


def frame(message: bytes, *, fin: bool = True, opcode: Opcode = Opcode.TEXT) -> bytes:
    """A frame as a browser sends it."""
    return Frame(opcode, message, fin).serialize(mask=True)


@asynccontextmanager
async def frame_client(served: Served, *, greeted: bool = True, **headers: str) -> AsyncIterator[FrameClient]:
    """Connect, and read the greeting unless it is wanted."""
    reader, writer = await asyncio.open_connection(served.host, served.port, limit=1 << 20)
    try:
        writer.write(_request(served, "/socket", "GET", {**HANDSHAKE, **headers}))
        status, told = await read_head(reader)
        assert status == 101
        assert told["sec-websocket-accept"] == ACCEPTED
        client = FrameClient(reader, writer)
        if greeted:
            assert (await client.read())["method"] == "hello"
        yield client
    finally:
        writer.close()
        await asyncio.sleep(0)
