"""How a program beside the daemon reaches it: one address, one token, one certificate, and one rule for the token.

Every add-on has the same options: ``--token-file``, ``--ca`` and ``--clear-token``.
"""

import ssl
from contextlib import AbstractAsyncContextManager
from pathlib import Path

from chefbotd.client.client import Client
from chefbotd.core.record import Record

CA_HELP = "Speak TLS with the daemon, and trust the certificates in this PEM file."
CLEAR_TOKEN_HELP = "Send tokens to a daemon on another computer without --ca, where others can read them."  # noqa: S105


class DaemonAccess(Record, frozen=True):
    """Where the daemon is, and what is shown to it; ``clear_token``: a token may go to another computer without TLS."""

    host: str
    port: int
    token: str | None = None
    tls: ssl.SSLContext | None = None
    clear_token: bool = False

    def __repr__(self) -> str:
        """Without the token."""
        return f"DaemonAccess({self.host!r}, {self.port}, encrypted={self.tls is not None})"

    def connect(self, name: str) -> AbstractAsyncContextManager[Client]:
        """A connection with our token."""
        return self.connect_as(self.token, name)

    def connect_as(self, token: str | None, name: str | None) -> AbstractAsyncContextManager[Client]:
        """A connection with another's token, by the same rule."""
        return Client.connect(
            self.host, self.port, token=token, tls=self.tls, name=name, clear_token=self.clear_token
        )


def daemon_access(
    host: str, port: int, token_file: Path | None, ca: Path | None, *, clear_token: bool
) -> DaemonAccess:
    """What a program's options say.

    Raises:
        ValueError: the file has no token, or no certificates; the text is for people.
    """
    return DaemonAccess(host, port, read_token(token_file), trusting(ca), clear_token)


def read_token(file: Path | None) -> str | None:
    """The last word of a file: a token, alone or after its role. Raises ``ValueError`` where there is none."""
    if file is None:
        return None
    try:
        words = file.read_text().split()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{file}: no token can be read: {error}") from error
    if not words:
        raise ValueError(f"{file} is empty: expected a token")
    return words[-1]


def trusting(ca: Path | None) -> ssl.SSLContext | None:
    """What trusts these certificates; None: the connection is not encrypted. Raises ``ValueError``."""
    try:
        return None if ca is None else ssl.create_default_context(cafile=ca)
    except (OSError, ssl.SSLError) as error:
        raise ValueError(f"{ca}: no certificates: {error}") from error
