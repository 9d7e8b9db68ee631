"""chefbotctl at a guarded socket: the token from a file, the certificates to believe."""

import ssl
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import pytest
import trustme
from click.testing import CliRunner, Result
from structlog.testing import capture_logs

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotctl import main
from chefbotd.clock import run_virtual
from chefbotd.rpc.access import Guard, Keyring
from chefbotd.transport.ports import reserve_port
from chefbotd.transport.tcp import NO_TLS
from tests.fakes.api import serving

TOKEN = "d" * 32
AUTHORITY = trustme.CA()


def guard() -> Guard:
    """One driver's token, and TLS."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    AUTHORITY.issue_cert("127.0.0.1").configure_cert(context)
    return Guard(Keyring.parse(f"drive {TOKEN}", "tokens"), context)


def stop(
    tmp_path: Path,
    token: str | None,
    *,
    ca: bool = True,
    believed: Path | None = None,
    guarded: bool = True,
    host: str = "127.0.0.1",
    log: list[Any] | None = None,
) -> Result:
    """``chefbotctl stop`` at a daemon that wants a token and speaks TLS, or neither."""
    port = reserve_port()
    args = [f"--connect={host}:{port}"]
    if token is not None:
        (tmp_path / "token").write_text(token + "\n")
        args.append(f"--token-file={tmp_path / 'token'}")
    if ca:
        AUTHORITY.cert_pem.write_to_path(tmp_path / "ca.pem")
        args.append(f"--ca={believed or tmp_path / 'ca.pem'}")

    def run(talk: Coroutine[Any, Any, Any]) -> Any:
        async def beside_a_daemon() -> Any:
            async with serving(port=port, **({"guard": guard()} if guarded else {})):
                return await talk

        return run_virtual(beside_a_daemon())

    with capture_logs() as lines:
        result = CliRunner().invoke(main, [*args, "stop"], obj=run)
    if log is not None:
        log.extend(lines)
    return result


def test_the_token_is_read_from_a_file(tmp_path: Path) -> None:
    """With the token and the authority's certificate the command is carried out."""
    assert stop(tmp_path, TOKEN).exit_code == Exit.OK


@pytest.mark.parametrize(("token", "kind"), [(None, "unauthenticated"), ("w" * 32, "wrong_token")])
def test_a_missing_or_wrong_token_is_a_refusal(tmp_path: Path, token: str | None, kind: str) -> None:
    """The exit code says refused, the message why, and not with which token."""
    result = stop(tmp_path, token)
    assert (result.exit_code, kind in result.stderr) == (Exit.REFUSED, True)
    assert "wwww" not in result.output


def test_plain_text_at_a_tls_socket_cannot_connect(tmp_path: Path) -> None:
    """Without --ca nothing is understood: the program names the option, the daemon's log what the client left out."""
    log: list[Any] = []
    result = stop(tmp_path, TOKEN, ca=False, log=log)
    assert [line["error"] for line in log if line["event"] == "client_not_admitted"] == [NO_TLS]
    assert (result.exit_code, "--ca is needed" in result.stderr) == (Exit.CANNOT_CONNECT, True)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (b"", "found 0 words"),
        (b"driver " + b"d" * 32, "found 2 words"),
        (b"# only a comment\n", "found 0 words"),
        (b"d" * 513, "found 1 words"),
        (b"\xff", "text"),
    ],
)
def test_a_file_that_is_no_token_is_a_wrong_argument(tmp_path: Path, text: bytes, found: str) -> None:
    """Nothing, a role that is none, a comment, far too much, no text: told before anything is connected."""
    (tmp_path / "token").write_bytes(text)
    result = CliRunner().invoke(main, [f"--token-file={tmp_path / 'token'}", "stop"])
    assert (result.exit_code, found in result.stderr) == (Exit.USAGE, True)
    assert "ddd" not in result.output


def test_a_certificate_of_somebody_else_is_named(tmp_path: Path) -> None:
    """What is wrong with it is said in words, and not as the system's error of that number."""
    stranger = tmp_path / "stranger.pem"
    trustme.CA().cert_pem.write_to_path(stranger)
    result = stop(tmp_path, TOKEN, believed=stranger)
    assert result.exit_code == Exit.CANNOT_CONNECT
    assert "(TLS: unable to get local issuer certificate); --ca has to name the daemon's own" in result.stderr


def test_a_certificate_of_another_address_asks_for_the_right_name(tmp_path: Path) -> None:
    """A daemon that has shown a certificate is running: nobody is sent to look for it."""
    result = stop(tmp_path, TOKEN, host="localhost")
    assert result.exit_code == Exit.CANNOT_CONNECT
    assert "call it by a name or an address that is in its certificate" in result.stderr
    assert "running" not in result.stderr


def test_tls_at_a_plain_socket_is_told(tmp_path: Path) -> None:
    """The daemon's greeting is no handshake."""
    result = stop(tmp_path, TOKEN, guarded=False)
    assert (result.exit_code, "(TLS: " in result.stderr) == (Exit.CANNOT_CONNECT, True)
    assert "not permitted" not in result.stderr
    assert "leave --ca out" in result.stderr


def test_a_file_that_holds_no_certificate_is_a_wrong_argument(tmp_path: Path) -> None:
    """The option and the file are named."""
    (tmp_path / "ca.pem").write_text("nothing")
    result = CliRunner().invoke(main, [f"--ca={tmp_path / 'ca.pem'}", "stop"])
    assert (result.exit_code, "--ca" in result.output) == (Exit.USAGE, True)
