"""Programs that the demonstration starts, kills and starts again."""

import asyncio
import contextlib
import os
import shutil
import signal
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

import click

from chefbotd.transport.ports import reserve_port

NOTHING: Final[Mapping[str, str]] = MappingProxyType({})
STARTS_WITHIN_S: Final = 300.0
"""Whoever starts for the first time compiles first, on a computer that may be busy."""


class Program:
    """A program whose output goes to ``log``. It is ready when its ``port`` listens, or its ``socket`` exists."""

    def __init__(
        self,
        log: Path,
        *words: str,
        port: int | None = None,
        socket_path: Path | None = None,
        environment: Mapping[str, str] = NOTHING,
    ) -> None:
        self.port, self._log, self._words, self._socket = port, log, words, socket_path
        self._environment = {**os.environ, **environment}
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        """Run, and wait until it is ready.

        Raises:
            click.ClickException: it has ended instead, with its last words.
        """
        with self._log.open("ab") as log:
            self._process = await asyncio.create_subprocess_exec(
                *self._words, stdin=asyncio.subprocess.DEVNULL, stdout=log, stderr=log, env=self._environment,
                start_new_session=True,  # a Ctrl-C is for the demonstration, which ends them all
            )  # fmt: skip
        async with asyncio.timeout(STARTS_WITHIN_S):
            while not await self._is_ready():
                if self._process.returncode is not None:
                    said = self._log.read_text(encoding="utf-8", errors="replace").strip()
                    raise click.ClickException(f"{self._words[0]} has ended: {said.rpartition(chr(10))[2]}")
                await asyncio.sleep(0.05)

    async def _is_ready(self) -> bool:
        if self._socket is not None:
            return self._socket.exists()
        return self.port is None or await listens(self.port)

    async def kill(self) -> None:
        """End it at once, without a word to anybody (SIGKILL)."""
        if self._process is not None and self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            await self._process.wait()

    def pause(self) -> None:
        """Stop it where it is (SIGSTOP)."""
        self._signal(signal.SIGSTOP)

    def go_on(self) -> None:
        """Let it go on."""
        self._signal(signal.SIGCONT)

    def _signal(self, number: signal.Signals) -> None:
        if self._process is not None and self._process.returncode is None:
            os.killpg(self._process.pid, number)


async def listens(port: int) -> bool:
    """Whether somebody listens at this port of this computer."""
    try:
        _, writer = await asyncio.open_connection("127.0.0.1", port)
    except OSError:
        return False
    writer.close()
    return True


def shared_clock(folder: Path, pace: float) -> Program:
    """The robots' clock, ``clock`` in the folder; it goes at ``pace`` times real time at most."""
    path = folder / "clock"
    words = (sys.executable, "-P", "-m", "chefbotd.shared_clock", str(path), str(pace))
    return Program(folder / "clock.log", *words, socket_path=path)


def mosquitto(folder: Path) -> Program:
    """Debian's broker, for this computer alone.

    Raises:
        click.ClickException: it is not installed.
    """
    path = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
    if path is None:
        raise click.ClickException("mosquitto is not installed: apt install mosquitto")
    port, config = reserve_port(), folder / "mosquitto.conf"
    config.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n")
    return Program(folder / "mosquitto.log", path, "-c", str(config), port=port)
