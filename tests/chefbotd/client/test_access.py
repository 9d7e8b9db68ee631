"""To whom a client shows its token."""

import asyncio
import json
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
import trustme
from structlog.testing import capture_logs

from chefbotd.client import Client, TokenWithheld, handshake
from chefbotd.client.access import DaemonAccess, daemon_access, read_token, trusting
from chefbotd.client.handshake import is_this_computer

TOKEN = "t" * 32
HELLO = {"protocol": "1.0", "robot": "r", "session": "s", "link": "up", "auth": "token", "capabilities": []}


@asynccontextmanager
async def greeter(tls: ssl.SSLContext | None = None) -> AsyncIterator[tuple[int, list[dict[str, Any]]]]:
    """Somebody who greets as a daemon does, and says yes to everything: its port, and what it was asked."""
    asked: list[dict[str, Any]] = []

    async def greet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(json.dumps({"jsonrpc": "2.0", "method": "hello", "params": HELLO}).encode() + b"\n")
        while line := await reader.readline():
            request = json.loads(line)
            asked.append(request)
            writer.write(json.dumps({"jsonrpc": "2.0", "id": request["id"], "result": {}}).encode() + b"\n")
        writer.close()

    async with await asyncio.start_server(greet, "127.0.0.1", 0, ssl=tls) as server:
        yield server.sockets[0].getsockname()[1], asked


@pytest.fixture
def elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every daemon is on another computer."""
    monkeypatch.setattr(handshake, "is_this_computer", lambda address: False)


@pytest.mark.usefixtures("elsewhere")
def test_a_token_is_not_shown_to_whoever_greets_on_another_computer() -> None:
    """The connection ends, and the error says what to do; with the user's word it is shown."""

    async def scenario() -> None:
        async with greeter() as (port, asked):
            with pytest.raises(TokenWithheld, match=r"not encrypted.*--ca.*--clear-token"):
                async with DaemonAccess("127.0.0.1", port, TOKEN).connect("test"):
                    pass
            assert asked == []
            async with DaemonAccess("127.0.0.1", port, TOKEN, clear_token=True).connect("test"):
                assert asked[0]["params"] == {"token": TOKEN}

    asyncio.run(scenario())


@pytest.mark.usefixtures("elsewhere")
def test_a_program_of_ones_own_is_warned() -> None:
    """The library sends it, and the log says that others can read it."""

    async def scenario() -> None:
        async with greeter() as (port, asked), Client.connect(port=port, token=TOKEN):
            assert asked[0]["method"] == "authenticate"

    with capture_logs() as lines:
        asyncio.run(scenario())
    assert [line["event"] for line in lines] == ["token_in_clear"]


@pytest.mark.usefixtures("elsewhere")
def test_a_certificate_lets_the_token_go(tmp_path: Path) -> None:
    """Of the daemon that has it; another one is not trusted."""
    authority, context = trustme.CA(), ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert("127.0.0.1").configure_cert(context)
    authority.cert_pem.write_to_path(tmp_path / "ca.pem")
    trustme.CA().cert_pem.write_to_path(tmp_path / "other.pem")
    (tmp_path / "token").write_text(f"agent {TOKEN}\n")

    async def scenario() -> None:
        async with greeter(context) as (port, asked):
            for ca, trusted in (("other.pem", False), ("ca.pem", True)):
                access = daemon_access(
                    "127.0.0.1", port, tmp_path / "token", tmp_path / ca, clear_token=False
                )
                if trusted:
                    async with access.connect("test"):
                        assert asked[0]["params"] == {"token": TOKEN}
                else:
                    with pytest.raises(ConnectionError, match="certificate"):
                        await access.connect("test").__aenter__()
                    assert asked == []

    asyncio.run(scenario())


@pytest.mark.parametrize(
    ("address", "here"),
    [
        ("127.0.0.1", True),
        ("127.8.9.1", True),
        ("::1", True),
        ("::ffff:127.0.0.1", True),
        ("192.168.1.5", False),
        ("fe80::1%eth0", False),
        ("localhost", False),  # a name is not what is connected
        ("", False),
    ],
)
def test_only_the_loopback_interface_is_this_computer(address: str, here: bool) -> None:
    """By the address of the other end, and not by the name that was given."""
    assert is_this_computer(address) is here


def test_what_is_no_token_and_no_certificate_is_said(tmp_path: Path) -> None:
    """With the file's name."""
    empty = tmp_path / "empty"
    empty.write_text("\n")
    with pytest.raises(ValueError, match="empty is empty: expected a token"):
        read_token(empty)
    with pytest.raises(ValueError, match="gone: no token can be read"):
        read_token(tmp_path / "gone")
    with pytest.raises(ValueError, match="empty: no certificates"):
        trusting(empty)
    assert read_token(None) is trusting(None) is None
