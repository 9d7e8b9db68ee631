"""Velocities on their way to a daemon that is slow to answer."""

import asyncio
from typing import Any, cast

import pytest
from chefbot_ros2.commands import Commands

from chefbotd.client import Client


class SlowDaemon:
    """Answers a velocity when ``answers`` is released; ``driven`` is what it was asked for, forwards."""

    def __init__(self) -> None:
        self.driven: list[float] = []
        self.params: dict[str, Any] = {}
        self.asked, self.answers = asyncio.Semaphore(0), asyncio.Semaphore(0)

    async def call(self, method: str, **params: Any) -> None:
        """Wait for the release."""
        self.driven.append(params["linear_m_s"])
        self.params = params
        self.asked.release()
        await self.answers.acquire()


async def settle() -> None:
    """Until nothing more happens by itself."""
    for _ in range(10):
        await asyncio.sleep(0)


@pytest.mark.parametrize(
    ("waited_s", "linear_m_s", "driven"),
    [
        (0.1, 0.5, [0.3, 0.5]),
        (3.0, 0.5, [0.3]),
        (3.0, 0.0, [0.3, 0.0]),
    ],
)
def test_a_motion_that_waited_too_long_is_not_carried_out_and_a_stop_is(
    waited_s: float, linear_m_s: float, driven: list[float]
) -> None:
    """Its publisher may have died meanwhile; a robot that stands harms nobody. The next velocity is carried out."""

    async def scenario() -> None:
        now_s, daemon, refused = [0.0], SlowDaemon(), list[str]()
        commands = Commands("ros2", refused.append, lambda: now_s[0])
        async with commands.serving(cast("Client", daemon)):
            commands.drive(0.3, 0.0)
            await daemon.asked.acquire()
            commands.drive(linear_m_s, 0.0)
            now_s[0] = waited_s
            daemon.answers.release()
            await settle()
            assert daemon.driven == driven
            assert len(refused) == 2 - len(driven)
            daemon.answers.release()
            commands.drive(0.2, 0.0)
            await settle()
            assert daemon.driven == [*driven, 0.2]

    asyncio.run(scenario())


def test_the_wait_begins_when_it_came_and_not_when_it_was_passed_on() -> None:
    """It may have waited before, for the loop."""

    async def scenario() -> None:
        daemon = SlowDaemon()
        commands = Commands("ros2", now_s=lambda: 10.0)
        async with commands.serving(cast("Client", daemon)):
            commands.drive(0.5, 0.0, 9.7)
            await settle()
            assert daemon.driven == []
            commands.drive(0.5, 0.0, 9.9)
            await settle()
            assert daemon.driven == [0.5]

    asyncio.run(scenario())


@pytest.mark.parametrize(("linear_m_s", "expected"), [(0.3, {"if_stop_number": 7}), (0.0, {})])
def test_a_motion_names_the_stop_that_was_known_when_it_came_and_a_zero_none(
    linear_m_s: float, expected: dict[str, int]
) -> None:
    """Another stop while it waits makes it void in the daemon; a robot that is to stand always may."""

    async def scenario() -> None:
        daemon = SlowDaemon()
        commands = Commands("ros2", now_s=lambda: 10.0)
        commands.stop_number = 7
        async with commands.serving(cast("Client", daemon)):
            commands.drive(linear_m_s, 0.0)
            commands.stop_number = 8
            await daemon.asked.acquire()
        numbers = {key: value for key, value in daemon.params.items() if key == "if_stop_number"}
        assert numbers == expected

    asyncio.run(scenario())
