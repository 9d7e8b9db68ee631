"""What is known of the messages that were sent to somebody who is away."""

from typing import Literal

from chefbotd.core.record import Record


class ToldServer(Record, frozen=True):
    """A server, and how its last message fared: it ``waits`` to be taken, was ``taken``, or was ``given_up``.

    ``host`` is all that is shown of its address. ``at_s`` is when the last message was made, in seconds since 1970;
    ``waiting`` counts the messages that are not taken yet.
    """

    name: str
    host: str
    state: Literal["silent", "waits", "taken", "given_up"] = "silent"
    title: str = ""
    text: str = ""
    at_s: float = 0.0
    problem: str = ""
    waiting: int = 0
    sent: int = 0
    dropped: int = 0


class NotificationsData(Record, frozen=True):
    """Of what somebody is told, and the servers that are told."""

    kinds: tuple[str, ...] = ()
    servers: tuple[ToldServer, ...] = ()


class NotificationsChanged(NotificationsData, frozen=True, kw_only=True):
    """A message was made, taken or given up."""

    stamp_s: float
