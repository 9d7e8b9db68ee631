"""A method of the socket, as a row of a table."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from pydantic import BaseModel

from chefbotd.messages.params import Params
from chefbotd.messages.roles import Role
from chefbotd.rpc.fanout import Receiver
from chefbotd.rpc.jsonrpc import ErrorKind, Failure
from chefbotd.rpc.session import Session


class Caller(Receiver, Protocol):
    """The client behind a request; ``session`` says who it is and what it may."""

    session: Session

    def reply(self, message: bytes) -> None:
        """Send an answer; never waits."""
        ...

    def end(self, failure: Failure) -> None:
        """Send this error, and close the connection."""
        ...


class Unserved(Exception):
    """A well-formed request that the socket itself cannot carry out."""

    def __init__(self, kind: ErrorKind, message: str, details: Mapping[str, object] | None = None) -> None:
        super().__init__(message)
        self.kind, self.details = kind, details or {}


@dataclass(frozen=True, slots=True)
class Method:
    """``handle`` takes the caller and checked parameters; ``afterwards`` runs when the answer is on its way.

    ``role`` is what a client needs for it, None: not even a token. An ``urgent`` method passes every rate limit, is
    never refused for its form, and may overtake others; one that ``moves`` the robot, or lets it move, is not carried
    out when it was overtaken. One that is served ``when_crowded`` can also be called from a place kept for stops. A
    ``constant`` one always answers the same.
    """

    role: Role | None
    params: type[Params]
    result: type[BaseModel]
    handle: Callable[[Caller, Any], BaseModel]
    afterwards: Callable[[Caller, Any], None] | None = None
    urgent: bool = False
    moves: bool = False
    when_crowded: bool = False
    constant: bool = False

    @property
    def summary(self) -> str:
        """The handler's own first line."""
        return (self.handle.__doc__ or "").partition("\n")[0]
