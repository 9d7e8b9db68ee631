"""The client library: drive, watch and configure a running daemon over its command socket."""

from chefbotd.client.client import Client, Hello
from chefbotd.client.errors import (
    CallError,
    CallTimeout,
    ClientError,
    ConnectionLost,
    IncompatibleProtocol,
    NoGreeting,
)
from chefbotd.client.subscription import Event, Subscription

__all__ = [
    "CallError",
    "CallTimeout",
    "Client",
    "ClientError",
    "ConnectionLost",
    "Event",
    "Hello",
    "IncompatibleProtocol",
    "NoGreeting",
    "Subscription",
]
