"""The framing of messages in a stream of bytes, in which TCP and WebSocket differ.

A framing does no I/O. Requests come out of it as lines, so that one backlog serves every transport.
"""

from functools import lru_cache
from typing import Protocol

from chefbotd.rpc import jsonrpc
from chefbotd.rpc.encoding import EventPayload, encode
from chefbotd.rpc.jsonrpc import Failure
from chefbotd.rpc.models import Dropped


class ConnectionFraming(Protocol):
    """One connection's framing, both ways."""

    @property
    def partial(self) -> bool:
        """Whether bytes were taken that are no part of a line yet."""
        ...

    @property
    def ended(self) -> bool:
        """Whether the client has said that it sends no more."""
        ...

    @property
    def failure(self) -> Failure | None:
        """Why nothing more can be read, if that is so."""
        ...

    def lines(self, data: bytes) -> bytes:
        """The requests in what the client has sent, cut anywhere, each with a line end."""
        ...

    def control(self) -> bytes:
        """What the framing itself has to answer by now."""
        ...

    def encode(self, message: bytes) -> bytes:
        """A message as it goes to the client."""
        ...

    def event(self, payload: EventPayload, /) -> bytes:
        """An event as it goes to the client; made once for all clients of this framing."""
        ...

    def describe_failure(self, failure: Failure, /) -> bytes:
        """The message that says why a connection ends."""
        ...

    def describe_drops(self, dropped: Dropped, /) -> bytes:
        """The message that says what a client has lost because it read too little; empty: it is not told."""
        ...

    def goodbye(self) -> bytes:
        """What is sent before our side closes."""
        ...


def describe_drops(dropped: Dropped) -> bytes:
    """The notification of JSON-RPC."""
    return jsonrpc.notification("dropped", encode(dropped))


@lru_cache(maxsize=4)
def _event_line(payload: EventPayload) -> bytes:
    """An event as a line; the fan-out hands one payload to many clients in turn, so the line is made once."""
    return jsonrpc.event(payload) + b"\n"


class LineFraming:
    """A line is a message: the stream is what the backlog takes."""

    partial, ended, failure = False, False, None
    describe_failure = staticmethod(jsonrpc.error)
    describe_drops = staticmethod(describe_drops)
    event = staticmethod(_event_line)

    def lines(self, data: bytes) -> bytes:
        """The bytes as they are."""
        return data

    def control(self) -> bytes:
        """Lines need none."""
        return b""

    def encode(self, message: bytes) -> bytes:
        """The message with a line end."""
        return message + b"\n"

    def goodbye(self) -> bytes:
        """A line socket just closes."""
        return b""
