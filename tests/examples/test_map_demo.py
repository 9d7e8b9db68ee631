"""How the demonstration of mapping takes it when its computer is too busy to keep up."""

import asyncio
from types import SimpleNamespace
from typing import cast

import pytest

from chefbotd.client import CallError, Client
from chefbotd.core.geometry import Twist2D
from examples.map_demo import steer


class Disarmed:
    """A robot that is disarmed by a fault."""

    def __init__(self, fault: str) -> None:
        self._fault = fault
        self.armed = 0

    async def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Refuse."""
        raise CallError(-32001, "disarmed", "the robot is disarmed")

    async def get_state(self) -> SimpleNamespace:
        """Say why."""
        return SimpleNamespace(safety=SimpleNamespace(fault=self._fault))

    async def arm(self) -> None:
        """Count it."""
        self.armed += 1


def test_a_robot_that_the_computer_held_up_is_armed_again() -> None:
    """The control loop stood still: the drive goes on."""
    robot = Disarmed("loop_blocked")
    asyncio.run(steer(cast("Client", robot), Twist2D(0.2, -0.3)))
    assert robot.armed == 1


def test_any_other_fault_ends_the_demonstration() -> None:
    """It is not armed over the head of a fault of its own."""
    robot = Disarmed("wheel_stalled")
    with pytest.raises(CallError):
        asyncio.run(steer(cast("Client", robot), Twist2D(0.2, -0.3)))
    assert robot.armed == 0
