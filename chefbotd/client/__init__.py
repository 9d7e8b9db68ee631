"""The client library: drive, watch and configure a running daemon over its command socket.

``Client`` is for asyncio, ``SyncClient`` for scripts and notebooks. Every error is a ``ChefbotError``.
"""

from chefbotd.client.blocking import SyncSubscription
from chefbotd.client.client import Client
from chefbotd.client.errors import (
    CallError,
    CallTimeout,
    CannotConnect,
    ChefbotError,
    ConnectionLost,
    GoalBlocked,
    GoalCancelled,
    GoalFault,
    GoalNotReached,
    GoalUnreachable,
    IncompatibleProtocol,
    MotionInterrupted,
    NoGreeting,
    NotReported,
    ProtocolError,
    RobotLost,
    SubscriptionConflict,
    TokenWithheld,
)
from chefbotd.client.event import Event, Gap
from chefbotd.client.handshake import DaemonGreeting
from chefbotd.client.sleep_watch import SleepWatch
from chefbotd.client.subscription import Subscription
from chefbotd.client.sync import SyncClient

__all__ = [
    "CallError",
    "CallTimeout",
    "CannotConnect",
    "ChefbotError",
    "Client",
    "ConnectionLost",
    "DaemonGreeting",
    "Event",
    "Gap",
    "GoalBlocked",
    "GoalCancelled",
    "GoalFault",
    "GoalNotReached",
    "GoalUnreachable",
    "IncompatibleProtocol",
    "MotionInterrupted",
    "NoGreeting",
    "NotReported",
    "ProtocolError",
    "RobotLost",
    "SleepWatch",
    "Subscription",
    "SubscriptionConflict",
    "SyncClient",
    "SyncSubscription",
    "TokenWithheld",
]
