"""How clients are admitted: without authentication, with a token, or with a token and TLS."""

import ssl
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import trustme

TOKENS = {"observe": "o" * 32, "drive": "d" * 32, "admin": "a" * 32}


@dataclass(frozen=True, slots=True)
class Access:
    """The settings that guard the socket, and what a client of each role needs to come in."""

    overrides: Mapping[str, object] = field(default_factory=dict)
    tokens: Mapping[str, str] = field(default_factory=dict)
    tls: ssl.SSLContext | None = None

    def key(self, role: str = "admin") -> dict[str, Any]:
        """For ``Client.connect``."""
        return {"token": self.tokens.get(role), "tls": self.tls}


@contextmanager
def unguarded() -> Iterator[Access]:
    """Loopback, where nobody is asked."""
    yield Access()


@contextmanager
def by_token() -> Iterator[Access]:
    """A token for each role."""
    with _folder() as folder:
        yield Access(_token_file(folder), TOKENS)


@contextmanager
def by_token_and_tls() -> Iterator[Access]:
    """The same, and a certificate of an authority that our clients trust."""
    authority, trusting = trustme.CA(), ssl.create_default_context()
    authority.configure_trust(trusting)
    issued = authority.issue_cert("127.0.0.1")
    with _folder() as folder:
        certificate, key = folder / "cert.pem", folder / "key.pem"
        certificate.write_bytes(b"".join(pem.bytes() for pem in issued.cert_chain_pems))
        _write_private(key, issued.private_key_pem.bytes())
        files = {"api.tls_certificate": str(certificate), "api.tls_key": str(key)}
        yield Access({**_token_file(folder), **files}, TOKENS, trusting)


@contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="chefbotd-access-") as folder:
        yield Path(folder)


def _token_file(folder: Path) -> dict[str, object]:
    path = folder / "tokens"
    _write_private(path, "\n".join(f"{role} {token}" for role, token in TOKENS.items()).encode())
    return {"api.token_file": str(path)}


def _write_private(path: Path, content: bytes) -> None:
    path.touch(mode=0o600)
    path.write_bytes(content)
