"""The socket's parameters: what may be served where, and with which guards."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from chefbotd.rpc.parameters import ApiParameters, is_loopback


@pytest.mark.parametrize(
    ("host", "loopback"),
    [
        ("127.0.0.1", True),
        ("127.8.9.10", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("192.168.1.5", False),
        ("robot.local", False),
        ("localhost.example.org", False),
    ],
)
def test_loopback_is_known_by_address(host: str, loopback: bool) -> None:
    """Names other than localhost may lead anywhere, and the wildcard leads everywhere."""
    assert is_loopback(host) is loopback


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "robot.local"])
def test_beyond_this_computer_a_token_is_needed(host: str) -> None:
    """Without one the configuration is refused, and the error says which keys to set; TLS alone is no guard."""
    for tls in ({}, {"tls_certificate": "c.pem", "tls_key": "k.pem"}):
        with pytest.raises(ValidationError, match=r"api\.token_file .*api\.tls_certificate.*127\.0\.0\.1"):
            ApiParameters(host=host, **tls)
    assert ApiParameters(host=host, token_file=Path("t")).host == host
    assert ApiParameters(host=host, token_credential="chefbotd.tokens").host == host


@pytest.mark.parametrize("half", [{"tls_certificate": "c.pem"}, {"tls_key": "k.pem"}])
def test_tls_needs_certificate_and_key(half: dict[str, Any]) -> None:
    """Half of a pair is refused, not ignored."""
    with pytest.raises(ValidationError, match="both"):
        ApiParameters(**half)


def test_a_credential_is_a_name_and_no_path() -> None:
    """It cannot lead out of systemd's directory."""
    with pytest.raises(ValidationError):
        ApiParameters(token_credential="../../etc/passwd")
