"""The real program as systemd starts it, with a socket that hears what it says to systemd."""

import asyncio
import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.scenarios.process import PATIENCE_S, drive_on, drive_once, driving, started

pytestmark = pytest.mark.realtime


@pytest.fixture
def heard(tmp_path: Path) -> Iterator[socket.socket]:
    """Where NOTIFY_SOCKET leads."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.setblocking(False)
        yield listener


async def until(heard: socket.socket, word: str) -> list[str]:
    """What is said until this word is among it."""
    told: list[str] = []
    async with asyncio.timeout(PATIENCE_S):
        while not any(word in message for message in told):
            told.append((await asyncio.get_running_loop().sock_recv(heard, 4096)).decode())
    return told


def test_sighup_reloads_and_the_watchdog_is_fed_while_the_robot_drives(tmp_path: Path, heard: socket.socket):
    """Under systemd SIGHUP ends nothing: RELOADING, then READY with what came of it; the robot goes on driving."""

    async def scenario() -> None:
        environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "1000000"}
        async with driving(tmp_path, environment=environment) as (program, client):
            assert "STATUS=" in (await until(heard, "READY=1"))[-1]
            await until(heard, "WATCHDOG=1")
            reloading = asyncio.create_task(until(heard, "READY=1"))
            os.kill(program.process.pid, signal.SIGHUP)
            while not reloading.done():
                await drive_once(client)
                await asyncio.sleep(0.05)
            told = reloading.result()
            assert any("RELOADING=1\nMONOTONIC_USEC=" in message for message in told)
            assert "reloaded: nothing has changed" in told[-1]
            await drive_on(program.board, client)
            assert (await client.call("get_state"))["safety"]["armed"]
            program.process.terminate()
            assert await program.ended() == 0
            assert not program.board.told_to_move

    asyncio.run(scenario())


def test_a_pulled_cable_does_not_keep_the_watchdogs_word_back(tmp_path: Path, heard: socket.socket):
    """The board is gone, its port too: systemd is told so, and that the daemon is well."""

    async def scenario() -> None:
        environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "400000"}
        async with started(tmp_path, environment=environment) as program, program.client():
            await until(heard, "; board on ")
            program.board.unplug()
            told = await until(heard, "; no board on ")
            told += [message for _ in range(5) for message in await until(heard, "WATCHDOG=1")]
            assert sum("WATCHDOG=1" in message for message in told) >= 5

    asyncio.run(scenario())
