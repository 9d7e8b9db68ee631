"""The states of a connection, and the transitions between them."""

from collections.abc import Mapping
from enum import Enum, auto


class State(Enum):
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


class Event(Enum):
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


READING = {State.OPEN, State.DRAINING}
SERVING = {State.OPEN, State.HALF_CLOSED}

NEXT: Mapping[tuple[State, Event], State] = {
    (State.OPEN, Event.EOF): State.HALF_CLOSED,
    (State.OPEN, Event.END): State.DRAINING,
    (State.OPEN, Event.DRAIN_OVER): State.OPEN,
    (State.OPEN, Event.SERVED): State.OPEN,
    (State.OPEN, Event.CLOSE): State.CLOSED,
    (State.OPEN, Event.LOST): State.LOST,
    (State.HALF_CLOSED, Event.EOF): State.HALF_CLOSED,
    (State.HALF_CLOSED, Event.END): State.DRAINED,
    (State.HALF_CLOSED, Event.DRAIN_OVER): State.HALF_CLOSED,
    (State.HALF_CLOSED, Event.SERVED): State.CLOSED,
    (State.HALF_CLOSED, Event.CLOSE): State.CLOSED,
    (State.HALF_CLOSED, Event.LOST): State.LOST,
    (State.DRAINING, Event.EOF): State.DRAINED,
    (State.DRAINING, Event.END): State.DRAINING,
    (State.DRAINING, Event.DRAIN_OVER): State.DRAINED,
    (State.DRAINING, Event.SERVED): State.DRAINING,
    (State.DRAINING, Event.CLOSE): State.CLOSED,
    (State.DRAINING, Event.LOST): State.LOST,
    (State.DRAINED, Event.EOF): State.DRAINED,
    (State.DRAINED, Event.END): State.DRAINED,
    (State.DRAINED, Event.DRAIN_OVER): State.DRAINED,
    (State.DRAINED, Event.SERVED): State.CLOSED,
    (State.DRAINED, Event.CLOSE): State.CLOSED,
    (State.DRAINED, Event.LOST): State.LOST,
    (State.LOST, Event.EOF): State.LOST,
    (State.LOST, Event.END): State.LOST,
    (State.LOST, Event.DRAIN_OVER): State.LOST,
    (State.LOST, Event.SERVED): State.CLOSED,
    (State.LOST, Event.CLOSE): State.CLOSED,
    (State.LOST, Event.LOST): State.LOST,
    (State.CLOSED, Event.EOF): State.CLOSED,
    (State.CLOSED, Event.END): State.CLOSED,
    (State.CLOSED, Event.DRAIN_OVER): State.CLOSED,
    (State.CLOSED, Event.SERVED): State.CLOSED,
    (State.CLOSED, Event.CLOSE): State.CLOSED,
    (State.CLOSED, Event.LOST): State.CLOSED,
}
