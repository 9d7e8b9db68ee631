"""The real program as systemd starts it, with a socket that hears what it says to systemd."""

import asyncio
import os
import signal
import socket
import ssl
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
import trustme

from chefbotd.client import CannotConnect, Client
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


def certificate(folder: Path) -> ssl.SSLContext:
    """Write a certificate of an authority of its own, and its key; a context that trusts this authority alone."""
    authority, trusting = trustme.CA(), ssl.create_default_context()
    authority.configure_trust(trusting)
    issued = authority.issue_cert("127.0.0.1")
    issued.cert_chain_pems[0].write_to_path(folder / "robot.pem")
    issued.private_key_pem.write_to_path(folder / "robot.key")
    (folder / "robot.key").chmod(0o600)
    return trusting


def test_a_certificate_that_is_replaced_counts_for_new_clients_and_ends_no_connection(
    tmp_path: Path, heard: socket.socket
):
    """SIGHUP reads it: who trusts the old one alone gets in no more, and who was in goes on."""

    async def scenario() -> None:
        environment = {
            "NOTIFY_SOCKET": str(tmp_path / "notify"),
            "CHEFBOTD_API__TLS_CERTIFICATE": str(tmp_path / "robot.pem"),
            "CHEFBOTD_API__TLS_KEY": str(tmp_path / "robot.key"),
        }
        before = certificate(tmp_path)
        async with started(tmp_path, environment=environment) as program:
            await until(heard, "READY=1")
            connect = partial(Client.connect, "127.0.0.1", program.port, timeout_s=PATIENCE_S)
            async with connect(tls=before) as client:
                after = certificate(tmp_path)
                os.kill(program.process.pid, signal.SIGHUP)
                assert "the certificate was read" in (await until(heard, "reloaded"))[-1]
                with pytest.raises(CannotConnect, match="certificate"):
                    async with connect(tls=before):
                        pass
                async with connect(tls=after) as another:
                    await another.estop("a second client")
                assert (await client.get_state()).safety.mode == "estopped"

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
