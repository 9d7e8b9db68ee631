"""The states of a connection, and the transitions between them."""

from collections.abc import Mapping
from enum import Enum, auto


class ConnectionState(Enum):
    """What a connection still does for its client."""

    OPEN = auto()
    """Bytes are read, requests are served in order, urgent ones before the others when those have to wait."""
    HALF_CLOSED = auto()
    """The client sends no more; what it has sent is served, and then the connection is closed."""
    DRAINING = auto()
    """The connection is being ended; bytes are read for a limited time, and only urgent requests are served."""
    DRAINED = auto()
    """Nothing more is read; urgent requests among what was read are still served."""
    LOST = auto()
    """The socket is gone; urgent requests among what had arrived are still served."""
    CLOSED = auto()
    """Nothing is read or served any more."""


class ConnectionEvent(Enum):
    """What changes the state of a connection."""

    EOF = auto()
    """The client has closed its sending side."""
    END = auto()
    """The daemon ends the connection for a reason."""
    DRAIN_OVER = auto()
    """The time or the amount for draining is used up."""
    SERVED = auto()
    """Nothing that was read is left to be served."""
    CLOSE = auto()
    """The daemon closes the connection without draining it."""
    LOST = auto()
    """The socket is gone."""


READING = ConnectionState.OPEN, ConnectionState.DRAINING
SERVING = ConnectionState.OPEN, ConnectionState.HALF_CLOSED

NEXT: Mapping[tuple[ConnectionState, ConnectionEvent], ConnectionState] = {
    (ConnectionState.OPEN, ConnectionEvent.EOF): ConnectionState.HALF_CLOSED,
    (ConnectionState.OPEN, ConnectionEvent.END): ConnectionState.DRAINING,
    (ConnectionState.OPEN, ConnectionEvent.DRAIN_OVER): ConnectionState.OPEN,
    (ConnectionState.OPEN, ConnectionEvent.SERVED): ConnectionState.OPEN,
    (ConnectionState.OPEN, ConnectionEvent.CLOSE): ConnectionState.CLOSED,
    (ConnectionState.OPEN, ConnectionEvent.LOST): ConnectionState.LOST,
    (ConnectionState.HALF_CLOSED, ConnectionEvent.EOF): ConnectionState.HALF_CLOSED,
    (ConnectionState.HALF_CLOSED, ConnectionEvent.END): ConnectionState.DRAINED,
    (ConnectionState.HALF_CLOSED, ConnectionEvent.DRAIN_OVER): ConnectionState.HALF_CLOSED,
    (ConnectionState.HALF_CLOSED, ConnectionEvent.SERVED): ConnectionState.CLOSED,
    (ConnectionState.HALF_CLOSED, ConnectionEvent.CLOSE): ConnectionState.CLOSED,
    (ConnectionState.HALF_CLOSED, ConnectionEvent.LOST): ConnectionState.LOST,
    (ConnectionState.DRAINING, ConnectionEvent.EOF): ConnectionState.DRAINED,
    (ConnectionState.DRAINING, ConnectionEvent.END): ConnectionState.DRAINING,
    (ConnectionState.DRAINING, ConnectionEvent.DRAIN_OVER): ConnectionState.DRAINED,
    (ConnectionState.DRAINING, ConnectionEvent.SERVED): ConnectionState.DRAINING,
    (ConnectionState.DRAINING, ConnectionEvent.CLOSE): ConnectionState.CLOSED,
    (ConnectionState.DRAINING, ConnectionEvent.LOST): ConnectionState.LOST,
    (ConnectionState.DRAINED, ConnectionEvent.EOF): ConnectionState.DRAINED,
    (ConnectionState.DRAINED, ConnectionEvent.END): ConnectionState.DRAINED,
    (ConnectionState.DRAINED, ConnectionEvent.DRAIN_OVER): ConnectionState.DRAINED,
    (ConnectionState.DRAINED, ConnectionEvent.SERVED): ConnectionState.CLOSED,
    (ConnectionState.DRAINED, ConnectionEvent.CLOSE): ConnectionState.CLOSED,
    (ConnectionState.DRAINED, ConnectionEvent.LOST): ConnectionState.LOST,
    (ConnectionState.LOST, ConnectionEvent.EOF): ConnectionState.LOST,
    (ConnectionState.LOST, ConnectionEvent.END): ConnectionState.LOST,
    (ConnectionState.LOST, ConnectionEvent.DRAIN_OVER): ConnectionState.LOST,
    (ConnectionState.LOST, ConnectionEvent.SERVED): ConnectionState.CLOSED,
    (ConnectionState.LOST, ConnectionEvent.CLOSE): ConnectionState.CLOSED,
    (ConnectionState.LOST, ConnectionEvent.LOST): ConnectionState.LOST,
    (ConnectionState.CLOSED, ConnectionEvent.EOF): ConnectionState.CLOSED,
    (ConnectionState.CLOSED, ConnectionEvent.END): ConnectionState.CLOSED,
    (ConnectionState.CLOSED, ConnectionEvent.DRAIN_OVER): ConnectionState.CLOSED,
    (ConnectionState.CLOSED, ConnectionEvent.SERVED): ConnectionState.CLOSED,
    (ConnectionState.CLOSED, ConnectionEvent.CLOSE): ConnectionState.CLOSED,
    (ConnectionState.CLOSED, ConnectionEvent.LOST): ConnectionState.CLOSED,
}
