"""A command socket on loopback with a fake robot behind it, and a raw client that sees every line."""

import asyncio
import json
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock
from chefbotd.features.feature import methods_and_topics
from chefbotd.rpc.access import Guard
from chefbotd.rpc.control_leases import ControlLeases, Sources
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.rpc.server import RpcServer
from chefbotd.transport.tcp import TcpServer
from tests.fakes.robot import FakeRobot


@dataclass
class Served:
    """What a test of the socket holds in its hands."""

    server: RpcServer
    robot: FakeRobot
    bus: Bus
    host: str
    port: int

    @property
    def clients(self) -> int:
        """How many clients are connected now."""
        return len(self.server.connections)

    @property
    def drops(self) -> Counter[str]:
        """Telemetry that slow clients lost, by topic."""
        return self.server.connections.drops

    @property
    def refused(self) -> Counter[str]:
        """Connections that were refused or ended, by the kind of error."""
        return self.server.connections.refused

    @property
    def faults(self) -> Counter[str]:
        """Requests that broke their handler, by method."""
        return self.server.connections.dispatcher.faults

    @property
    def void_commands(self) -> Counter[str]:
        """Commands that came before a stop or waited too long, by the kind of error."""
        return self.server.connections.dispatcher.void


def new_server(
    *, simulated: bool = False, port: int = 0, guard: Guard | None = None, **limits: Any
) -> tuple[RpcServer, FakeRobot, Bus]:
    """A server that does not run yet, with its fake robot and its bus."""
    robot, bus, clock, parameters = FakeRobot(), Bus(), LoopClock(), ApiParameters(port=port, **limits)
    robot.arm_role = parameters.arm_role
    leases = ControlLeases(parameters.lease_s, robot.stop_hold_s, robot.release, bus.publish)
    methods, topics = methods_and_topics(robot.features(leases, clock, simulated=simulated))
    server = RpcServer(
        methods,
        topics,
        bus,
        clock,
        parameters,
        leases,
        robot_name="testbot",
        session="s1",
        sources=Sources(robot.sources, robot.default_source, robot.take_over),
        command_timeout_s=robot.command_timeout_s,
        link_is_up=lambda: robot.link_is_up,
        stop_number=lambda: robot.stop_number,
        keyring=guard.keyring if guard is not None else None,
    )
    return server, robot, bus


def tcp_server(server: RpcServer, guard: Guard | None = None) -> TcpServer:
    """The TCP side of a server."""
    return TcpServer(server, server.connections.parameters, guard.tls if guard is not None else None)


@asynccontextmanager
async def serving(**options: Any) -> AsyncIterator[Served]:
    """Serve a fake robot on a free port for as long as the block lasts; the options of ``new_server``."""
    server, robot, bus = new_server(**options)
    tcp = tcp_server(server, options.get("guard"))
    running = asyncio.gather(server.run(), tcp.run())
    try:
        host, port = await tcp.address()
        yield Served(server, robot, bus, host, port)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


class LineClient:
    """A client that sends bytes and reads JSON lines, as ``nc`` would."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    def send(self, line: bytes) -> None:
        """Send bytes as they are, with a line end."""
        self._writer.write(line + b"\n")

    def send_raw(self, data: bytes) -> None:
        """Send bytes as they are."""
        self._writer.write(data)

    def request(self, method: str, request_id: int = 1, **params: Any) -> None:
        """Send a well-formed request."""
        self.send(
            json.dumps({"jsonrpc": "2.0", "id": request_id, "method": method, "params": params}).encode()
        )

    async def read(self, timeout_s: float = 10.0) -> dict[str, Any]:
        """The next message; raises ``EOFError`` at the end of the connection."""
        async with asyncio.timeout(timeout_s):
            line = await self._reader.readline()
        if not line.endswith(b"\n"):
            raise EOFError(f"the connection ended after {line!r}")
        message: dict[str, Any] = json.loads(line)
        return message

    async def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a request; its answer, with events in between left out."""
        self.request(method, **params)
        while True:
            message = await self.read()
            if message.get("id") == 1:
                return message

    def half_close(self) -> None:
        """Send no more, and say so."""
        self._writer.write_eof()

    def stop_reading(self) -> None:
        """Read nothing more from the socket."""
        self._writer.transport.pause_reading()  # type: ignore[attr-defined]

    def read_on(self) -> None:
        """Read again."""
        self._writer.transport.resume_reading()  # type: ignore[attr-defined]


@asynccontextmanager
async def line_client(served: Served, *, greeted: bool = True) -> AsyncIterator[LineClient]:
    """Connect, and read the greeting unless it is wanted."""
    reader, writer = await asyncio.open_connection(served.host, served.port, limit=1 << 20)
    client = LineClient(reader, writer)
    try:
        if greeted:
            assert (await client.read())["method"] == "hello"
        yield client
    finally:
        writer.close()
        await asyncio.sleep(0)
