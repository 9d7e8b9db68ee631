"""The errors of the client library: one base class, and a subclass for each kind; for a goal, one for each end of it."""

from collections.abc import Mapping
from typing import Any, Final


class ChefbotError(Exception):
    """The base of everything that the client library raises of its own."""


class CannotConnect(ChefbotError, ConnectionError):
    """No program listens there, or its certificate is not trusted; ``__cause__`` is the system's error."""


class ConnectionLost(ChefbotError, ConnectionError):
    """The connection ended while something was still expected of it."""


class NoGreeting(ConnectionLost):
    """The other end sent no greeting: it is no daemon, or it expects TLS."""


class TokenWithheld(ChefbotError):
    """The token was not shown: the connection is not encrypted, and leads to another computer."""


class CallTimeout(ChefbotError, TimeoutError):
    """What was waited for did not come in time. A call may or may not have been carried out by the daemon."""


class MotionInterrupted(ChefbotError):
    """The program did not run for longer than the robot obeys a command: the robot has braked, and the motion is over.

    The next command moves the robot again.
    """


class CallError(ChefbotError):
    """The daemon refused: ``kind`` is stable (docs/api.md lists them), ``message`` is for people."""

    def __init__(self, code: int, kind: str, message: str, data: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.code, self.kind, self.message = code, kind, message
        self.data: Mapping[str, Any] = data or {}

    @classmethod
    def from_wire(cls, error: Mapping[str, Any]) -> "CallError":
        """The ``error`` member of a JSON-RPC answer."""
        data = error.get("data") or {}
        return cls(error["code"], data.get("kind", "unknown"), error["message"], data)


class ProtocolError(ChefbotError):
    """The daemon sent something that does not fit the protocol as this client knows it."""


class IncompatibleProtocol(ProtocolError):
    """The daemon greeted with a major version that this client does not speak."""


class NotReported(ChefbotError):
    """The robot has not reported this topic yet."""


class SubscriptionConflict(ChefbotError):
    """A topic is subscribed on this client already, with another rate or policy; the daemon keeps one of each."""


class GoalNotReached(ChefbotError):
    """The base of these: ``end`` and ``cause`` are stable, ``reason`` is a sentence for people, ``goal`` a number.

    ``cause`` is empty where navigation itself ended the goal.
    """

    end: str = ""

    def __init__(self, goal: int, reason: str, end: str = "", cause: str = "") -> None:
        super().__init__(reason)
        self.goal, self.reason, self.end, self.cause = goal, reason, end or self.end, cause


class GoalUnreachable(GoalNotReached):
    """There is no way to it on the map."""

    end = "unreachable"


class GoalBlocked(GoalNotReached):
    """Something was in the way for too long, whatever the robot tried."""

    end = "blocked"


class GoalCancelled(GoalNotReached):
    """Somebody cancelled it, or asked for another one."""

    end = "cancelled"


class RobotLost(GoalNotReached):
    """The robot did not know where it was for too long."""

    end = "lost"


class GoalFault(GoalNotReached):
    """Something made driving impossible, such as an emergency stop or a dead lidar."""

    end = "fault"


BY_END: Final = {
    error.end: error for error in (GoalUnreachable, GoalBlocked, GoalCancelled, RobotLost, GoalFault)
}


def not_reached(goal: int, end: str, reason: str, cause: str = "") -> GoalNotReached:
    """The error of an end; an end that this version does not know is the base's."""
    return BY_END.get(end, GoalNotReached)(goal, reason, end, cause)
