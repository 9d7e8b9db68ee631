"""A command that comes too late ends no drive."""

import asyncio
from typing import cast

import pytest

from chefbotd.cli.drive.control import send_drive
from chefbotd.client import CallError, Client
from chefbotd.core.geometry import Twist2D


class Refusing:
    """A robot that refuses to drive."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self.asked: list[tuple[float, float]] = []

    async def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Note it, and refuse."""
        self.asked.append((linear_m_s, angular_rad_s))
        raise CallError(-32028, self._kind, "it will not")


def test_a_command_that_came_too_late_is_let_go() -> None:
    """It has moved nothing; whoever follows a course sends the next one."""
    robot = Refusing("too_old")
    asyncio.run(send_drive(cast("Client", robot), Twist2D(0.2, -0.3)))
    assert robot.asked == [(0.2, -0.3)]


@pytest.mark.parametrize("kind", ["stopped", "disarmed", "lease_held"])
def test_any_other_refusal_ends_the_drive(kind: str) -> None:
    """Somebody or something wants the robot to stand."""
    with pytest.raises(CallError):
        asyncio.run(send_drive(cast("Client", Refusing(kind)), Twist2D(0.2, -0.3)))
