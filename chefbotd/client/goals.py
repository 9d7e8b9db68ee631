"""The errors for a goal that was not reached: one for each end, with the robot's reason."""

from typing import Final

from chefbotd.client.errors import ChefbotError


class GoalNotReached(ChefbotError):
    """The base of these: ``end`` is stable, ``reason`` is a sentence for people, ``goal`` the goal's number."""

    end: str = ""

    def __init__(self, goal: int, reason: str, end: str = "") -> None:
        super().__init__(reason)
        self.goal, self.reason, self.end = goal, reason, end or self.end


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


def not_reached(goal: int, end: str, reason: str) -> GoalNotReached:
    """The error of an end; an end that this version does not know is the base's."""
    return BY_END.get(end, GoalNotReached)(goal, reason, end)
