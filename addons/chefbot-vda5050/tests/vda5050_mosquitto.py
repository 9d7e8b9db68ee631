"""A mosquitto of one's own on a free port of the loopback interface, which can be killed and started again."""

import asyncio
import contextlib
import os
import shutil
import signal
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from chefbotd.transport.ports import reserve_port

PATH = f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin"


def program(name: str) -> str:
    """A program's path; without it a test is skipped, and fails where ADDONS_TESTS=required."""
    found = shutil.which(name, path=PATH)
    if found is None:
        text = f"{name} is not installed: make addons-tools"
        if os.environ.get("ADDONS_TESTS") == "required":
            pytest.fail(text)
        pytest.skip(text)
    return found


class Mosquitto:
    """The broker's process; ``port`` stays when it is started again. It keeps nothing on the disk."""

    def __init__(self, folder: Path, extra: str = "") -> None:
        self.port = reserve_port()
        self._program = program("mosquitto")
        self._config = folder / "mosquitto.conf"
        lines = ("set_tcp_nodelay true", "persistence false", f"listener {self.port} 127.0.0.1")
        allowed = "" if "password_file" in extra else "allow_anonymous true"
        self._config.write_text("\n".join((*lines, allowed, extra, "")))
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        """Run, and wait until it listens."""
        self._process = await asyncio.create_subprocess_exec(
            self._program,
            "-c",
            str(self._config),
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.DEVNULL,
        )
        async with asyncio.timeout(100.0):
            while True:
                with contextlib.suppress(OSError):
                    _, writer = await asyncio.open_connection("127.0.0.1", self.port)
                    writer.close()
                    return
                await asyncio.sleep(0.02)

    def send_signal(self, number: signal.Signals) -> None:
        """Stop it as it is (SIGSTOP), or let it go on (SIGCONT)."""
        assert self._process is not None
        self._process.send_signal(number)

    async def kill(self) -> None:
        """End it at once, without a word to its clients."""
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()


@contextlib.asynccontextmanager
async def mosquitto(folder: Path, extra: str = "") -> AsyncIterator[Mosquitto]:
    """A broker that runs, and that is gone at the end."""
    broker = Mosquitto(folder, extra)
    await broker.start()
    try:
        yield broker
    finally:
        await broker.kill()


class Relay:
    """A cable between a robot and the broker, which can be cut: neither end says a word."""

    def __init__(self, broker_port: int) -> None:
        self.port = 0
        self._broker_port = broker_port
        self._writers: list[asyncio.StreamWriter] = []

    async def take(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Pass bytes on in both directions."""
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._broker_port)
        self._writers += [writer, far_writer]
        await asyncio.gather(_pass(reader, far_writer), _pass(far_reader, writer))

    def cut(self) -> None:
        """Break all connections."""
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()


async def _pass(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()
    writer.close()


@contextlib.asynccontextmanager
async def relay(broker_port: int) -> AsyncIterator[Relay]:
    """A cable that lies."""
    now = Relay(broker_port)
    server = await asyncio.start_server(now.take, "127.0.0.1", 0)
    now.port = server.sockets[0].getsockname()[1]
    try:
        yield now
    finally:
        now.cut()
        server.close()
