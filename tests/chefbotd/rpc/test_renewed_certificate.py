"""A certificate that is replaced while the daemon serves."""

import asyncio
import ssl
from pathlib import Path

import pytest
import trustme
from structlog.testing import capture_logs

from chefbotd.client import Client
from chefbotd.clock import run_virtual
from chefbotd.rpc.access import AccessError, load_guard, renew_certificate
from chefbotd.rpc.parameters import ApiParameters
from tests.fakes.api import serving


def issue(folder: Path) -> ssl.SSLContext:
    """Write a certificate for this computer and its key, of a new authority; a client that trusts that alone."""
    authority = trustme.CA()
    certificate = authority.issue_cert("127.0.0.1")
    key = folder / "key.pem"
    key.touch(mode=0o600)
    certificate.private_key_pem.write_to_path(key)
    certificate.cert_chain_pems[0].write_to_path(folder / "cert.pem")
    client = ssl.create_default_context()
    authority.configure_trust(client)
    return client


def test_new_connections_see_the_new_certificate_and_old_ones_go_on(tmp_path: Path) -> None:
    """Files that do not fit are refused, and the certificate before goes on; then the new pair is shown."""
    parameters = ApiParameters(tls_certificate=tmp_path / "cert.pem", tls_key=tmp_path / "key.pem")

    async def main() -> None:
        before = issue(tmp_path)
        guard = load_guard(parameters, {})
        assert guard.tls is not None
        async with (
            serving(guard=guard) as served,
            Client.connect(served.host, served.port, tls=before) as old,
        ):
            fitting = (tmp_path / "key.pem").read_bytes()
            after = issue(tmp_path)
            renewed = (tmp_path / "key.pem").read_bytes()
            (tmp_path / "key.pem").write_bytes(fitting)  # only one of the two has been replaced
            with pytest.raises(AccessError, match="TLS with"):
                renew_certificate(guard.tls, parameters)
            async with Client.connect(served.host, served.port, tls=before) as robot:
                await robot.ping()
            (tmp_path / "key.pem").write_bytes(renewed)
            renew_certificate(guard.tls, parameters)
            async with Client.connect(served.host, served.port, tls=after) as robot:
                await robot.ping()
            with pytest.raises(Exception, match=r"(?i)certificate"):
                async with Client.connect(served.host, served.port, tls=before):
                    raise AssertionError("connected")
            await old.ping()
            await asyncio.sleep(0)

    with capture_logs():
        run_virtual(main())
