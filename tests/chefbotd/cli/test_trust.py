"""chefbotctl at a guarded socket: the token from a file, the certificates to believe."""

import ssl
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import pytest
import trustme
from click.testing import CliRunner, Result
from structlog.testing import capture_logs

from chefbotd.api import Guard
from chefbotd.api.access import Keyring
from chefbotd.cli.control import main
from chefbotd.cli.exits import Exit
from chefbotd.clock import run_virtual
from tests.fakes.api import free_port, serving

TOKEN = "d" * 32
AUTHORITY = trustme.CA()


def guard() -> Guard:
    """One driver's token, and TLS."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    AUTHORITY.issue_cert("127.0.0.1").configure_cert(context)
    return Guard(Keyring.parse(f"drive {TOKEN}", "tokens"), context)


def stop(tmp_path: Path, token: str | None, *, ca: bool = True) -> Result:
    """``chefbotctl stop`` at a daemon that wants a token and speaks TLS."""
    port = free_port()
    args = [f"--connect=127.0.0.1:{port}"]
    if token is not None:
        (tmp_path / "token").write_text(token + "\n")
        args.append(f"--token-file={tmp_path / 'token'}")
    if ca:
        AUTHORITY.cert_pem.write_to_path(tmp_path / "ca.pem")
        args.append(f"--ca={tmp_path / 'ca.pem'}")

    def run(talk: Coroutine[Any, Any, Any]) -> Any:
        async def beside_a_daemon() -> Any:
            async with serving(port=port, guard=guard()):
                return await talk

        return run_virtual(beside_a_daemon())

    with capture_logs():
        return CliRunner().invoke(main, [*args, "stop"], obj=run)


def test_the_token_is_read_from_a_file(tmp_path: Path) -> None:
    """With the token and the authority's certificate the command is carried out."""
    assert stop(tmp_path, TOKEN).exit_code == Exit.OK


@pytest.mark.parametrize(("token", "kind"), [(None, "unauthenticated"), ("w" * 32, "wrong_token")])
def test_a_missing_or_wrong_token_is_a_refusal(tmp_path: Path, token: str | None, kind: str) -> None:
    """The exit code says refused, the message why, and not with which token."""
    result = stop(tmp_path, token)
    assert (result.exit_code, kind in result.stderr) == (Exit.REFUSED, True)
    assert "wwww" not in result.output


def test_plain_text_at_a_tls_socket_is_a_lost_connection(tmp_path: Path) -> None:
    """Without --ca nothing is understood, and the program says so and ends."""
    assert stop(tmp_path, TOKEN, ca=False).exit_code == Exit.CONNECTION_LOST


def test_a_file_that_holds_no_certificate_is_a_wrong_argument(tmp_path: Path) -> None:
    """The option and the file are named."""
    (tmp_path / "ca.pem").write_text("nothing")
    result = CliRunner().invoke(main, [f"--ca={tmp_path / 'ca.pem'}", "stop"])
    assert (result.exit_code, "--ca" in result.output) == (Exit.USAGE, True)
