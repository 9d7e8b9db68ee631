"""Whom rosbridge serves, with a daemon that is only a greeting."""

import asyncio
import ssl
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import trustme
from chefbot_ros2.rosbridge.server import POLICY_VIOLATION, Server, certified, main
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from chefbotd.client import CannotConnect

PATIENCE_S = 100.0
TOKEN = "d" * 32


class Greeting:
    """A daemon that greets with ``auth``; ``clients`` are the tokens of those who came to it by the bridge."""

    def __init__(self, auth: str) -> None:
        self._auth = auth
        self.clients: list[str | None] = []

    @asynccontextmanager
    async def connect_as(self, token: str | None, name: str) -> AsyncIterator[Any]:
        """The bridge's own connection never comes about."""
        if name == "rosbridge":
            raise CannotConnect("nobody there")
        self.clients.append(token)
        yield SimpleNamespace(hello=SimpleNamespace(auth=self._auth))


async def outcome(daemon: Greeting, token: str | None, *, needs_tokens: bool) -> tuple[int, str]:
    """The code and the reason with which a client is sent away; (0, the answer) if it is served."""
    port: asyncio.Future[int] = asyncio.get_running_loop().create_future()
    server = Server(daemon.connect_as, TOKEN, "ros2", needs_tokens=needs_tokens)
    running = asyncio.create_task(server.run("127.0.0.1", 0, [], port.set_result))
    try:
        async with asyncio.timeout(PATIENCE_S):
            query = "" if token is None else f"?token={token}"
            async with connect(f"ws://127.0.0.1:{await port}/{query}") as socket:
                try:
                    await socket.send('{"op": "call_service", "service": "/rosapi/nodes"}')
                    return 0, str(await socket.recv())
                except ConnectionClosed:
                    return socket.close_code or 0, socket.close_reason or ""
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


def test_where_others_reach_it_a_client_without_a_token_never_gets_to_the_daemon() -> None:
    """A daemon that trusts its own computer would take it for one of that."""
    daemon = Greeting("token")
    code, why = asyncio.run(outcome(daemon, None, needs_tokens=True))
    assert (code, why.partition(":")[0]) == (POLICY_VIOLATION, "show a token")
    assert daemon.clients == []


def test_where_others_reach_it_a_daemon_without_tokens_is_nobodys() -> None:
    """It would take any token for a valid one."""
    code, why = asyncio.run(outcome(Greeting("none"), "anything", needs_tokens=True))
    assert code == POLICY_VIOLATION
    assert "asks for no tokens" in why


@pytest.mark.parametrize(
    ("auth", "token", "needs_tokens"),
    [("token", TOKEN, True), ("none", None, False), ("token", TOKEN, False)],
)
def test_who_shows_its_token_and_who_is_on_this_computer_is_served(
    auth: str, token: str | None, needs_tokens: bool
) -> None:
    """The daemon gets the client's own token."""
    daemon = Greeting(auth)
    code, answer = asyncio.run(outcome(daemon, token, needs_tokens=needs_tokens))
    assert code == 0
    assert "/chefbot" in answer
    assert daemon.clients == [token]


def test_with_a_certificate_it_speaks_tls(tmp_path: Path) -> None:
    """A client that trusts its authority is served; the file that is no certificate is named."""
    authority, trusting = trustme.CA(), ssl.create_default_context()
    authority.configure_trust(trusting)
    file = tmp_path / "bridge.pem"
    authority.issue_cert("127.0.0.1").private_key_and_cert_chain_pem.write_to_path(file)

    async def scenario() -> str:
        port: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        server = Server(Greeting("none").connect_as, None, "ros2", tls=certified(file, None))
        running = asyncio.create_task(server.run("127.0.0.1", 0, [], port.set_result))
        try:
            async with connect(f"wss://127.0.0.1:{await port}", ssl=trusting) as socket:
                await socket.send('{"op": "call_service", "service": "/rosapi/nodes"}')
                return str(await socket.recv())
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    assert "/chefbot" in asyncio.run(asyncio.wait_for(scenario(), PATIENCE_S))
    (tmp_path / "none.pem").write_text("nothing")
    with pytest.raises(ValueError, match=r"none\.pem: no certificate"):
        certified(tmp_path / "none.pem", None)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "robot.local"])
def test_the_program_does_not_listen_beyond_this_computer_without_tokens(
    host: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nor with an empty file of them."""
    empty = tmp_path / "token"
    empty.write_text("\n")
    for words, why in (([], "needs the daemon's tokens"), (["--token-file", str(empty)], "is empty")):
        monkeypatch.setattr(sys, "argv", ["chefbot-rosbridge", "--host", host, "--port", "0", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 2
        assert why in capsys.readouterr().err
