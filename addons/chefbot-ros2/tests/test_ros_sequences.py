"""Random sequences of what ROS asks, beside everybody else's: no goal or velocity from before a stop moves the robot.

Dispatcher, navigation, leases and gate are the daemon's own, as in the daemon's search; requests are on their way for a
while, goals wait in a program of ROS, and the bridge hears of a stop late. ``make sequences`` runs more of them.
"""

import asyncio
import os
import random
from contextlib import AsyncExitStack
from typing import Any, cast

import pytest
from chefbot_ros2.commands import Commands

from chefbotd.client import Client
from chefbotd.core.geometry import Motion, Pose2D, Twist2D, WheelDuties
from tests.chefbotd.components.navigation.test_waiting_sequences import DEEDS, Daemon
from tests.fakes.sequences import run_sequences

LENGTH = 14
ON_ITS_WAY_S = 0.15
ROS_DEEDS = (
    *("goal_pose", "goal_pose", "a goal comes", "what has waited is sent"),
    *("cmd_vel", "cmd_vel", "hears of the stops", "hears of the stops"),
    *("slow line", "fast line", "connects again"),
)


class Line:
    """The bridge's connection: each request is on its way for ``lag_s``."""

    def __init__(self, daemon: Daemon) -> None:
        self._daemon, self.lag_s = daemon, 0.0

    async def call(self, method: str, on_progress: object = None, **params: Any) -> None:
        """Bring it to the daemon; what comes of it is seen there."""
        await asyncio.sleep(self.lag_s)
        self._daemon.call(method, **params)


class Bridged(Daemon):
    """A daemon with the bridge beside it; ``velocities`` has the stops before each was asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.commands, self._line = Commands("teleop", now_s=asyncio.get_running_loop().time), Line(self)
        self._connection = AsyncExitStack()
        self._waiting: tuple[int, int | None] | None = None
        self.velocities, self.moved, self.problem = list[int](), 0, ""
        self._accept = self.driving.command
        self.driving.command = self._command  # type: ignore[method-assign]

    async def begin(self) -> None:
        """Connect, and hear how the gate stands."""
        await self._connection.enter_async_context(self.commands.serving(cast("Client", self._line)))
        self.commands.stop_number = self.driving.stop_number

    async def end(self) -> None:
        """The connection ends."""
        await self._connection.aclose()

    def _command(self, source: str, motion: Motion | WheelDuties, client: int = 0) -> None:
        self._accept(source, motion, client)
        if source == "teleop" and isinstance(motion, Twist2D) and motion != Twist2D():
            self.moved += 1
            if self.velocities[round((motion.linear_m_s - 0.1) * 1e4)] != self.stops:
                self.problem = "a velocity from before a stop moves the robot"

    async def do(self, deed: str) -> None:
        """One step, and a moment for what follows."""
        commands = self.commands
        if deed == "goal_pose":
            self._navigate(self.stops, None)
        elif deed == "a goal comes":
            self._waiting = self.stops, commands.stop_number
        elif deed == "what has waited is sent" and self._waiting is not None:
            self._navigate(*self._waiting)
        elif deed == "cmd_vel":
            self.velocities.append(self.stops)
            commands.drive(0.1 + (len(self.velocities) - 1) * 1e-4, 0.0)
        elif deed == "hears of the stops":
            commands.stop_number = self.driving.stop_number
        elif deed.endswith("line"):
            self._line.lag_s = ON_ITS_WAY_S if deed == "slow line" else 0.0
        elif deed == "connects again":
            await self.end()
            await self.begin()
        await super().do(deed)
        assert not self.problem, self.problem

    def _navigate(self, stops: int, stop_number: int | None) -> None:
        self.goals.append(stops)
        self.commands.navigate("map", Pose2D(len(self.goals) - 1.0, 0.0), stop_number)


async def one(choose: random.Random) -> tuple[bool, bool]:
    """A random sequence; whether a velocity and whether a goal has moved the robot."""
    daemon = Bridged()
    sending = asyncio.create_task(daemon.navigation.run())
    deeds = choose.choices((*DEEDS, *ROS_DEEDS), k=LENGTH)
    has_moved = False
    try:
        await daemon.begin()
        for count, deed in enumerate(deeds, 1):
            try:
                await daemon.do(deed)
            except AssertionError as failure:
                raise AssertionError(f"{failure}: {', '.join(deeds[:count])}") from None
            has_moved = has_moved or bool(daemon.driver.moved)
        await daemon.end()
    finally:
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(sending, *others, return_exceptions=True)
    return daemon.moved > 0, has_moved


@pytest.mark.parametrize(
    "number", [150, pytest.param(int(os.environ.get("SEQUENCES", "10000")), marks=pytest.mark.slow)]
)
def test_nothing_that_ros_asked_for_before_a_stop_moves_the_robot(number: int) -> None:
    """Whatever waits in a program of ROS, in the bridge or on the line; and a share of the sequences does move it."""
    ended = run_sequences(one, number, seed=37)
    assert sum(by_velocity for by_velocity, _ in ended) > number / 50
    assert sum(by_goal for _, by_goal in ended) > number / 50
