"""What can go wrong between a client and the daemon, each with a class of its own."""

from collections.abc import Mapping
from typing import Any


class ClientError(Exception):
    """The base of everything that the client library raises of its own."""


class CallError(ClientError):
    """The daemon answered with an error: ``kind`` is stable, ``message`` is for people."""

    def __init__(self, code: int, kind: str, message: str, data: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.code, self.kind, self.message = code, kind, message
        self.data: Mapping[str, Any] = data or {}

    @classmethod
    def from_wire(cls, error: Mapping[str, Any]) -> "CallError":
        """The ``error`` member of a JSON-RPC answer."""
        data = error.get("data") or {}
        return cls(error["code"], data.get("kind", "unknown"), error["message"], data)


class CallTimeout(ClientError, TimeoutError):
    """No answer came in time; the daemon may or may not have carried out the call."""


class ConnectionLost(ClientError, ConnectionError):
    """The connection ended while something was still expected of it."""


class NoGreeting(ConnectionLost):
    """Whoever listens there said nothing that we understand: no daemon, or one that speaks TLS where we do not."""


class IncompatibleProtocol(ClientError):
    """The daemon greeted with a protocol that this client does not speak."""
