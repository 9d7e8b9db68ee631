"""A robot that does not turn its wheels as fast as it is asked to says so by itself, and a healthy one does not."""

import asyncio

import pytest

from chefbotd.clock import run_virtual
from chefbotd.core.events import DriveWarned
from chefbotd.testing.daemon import simulated_robot
from tests.scenarios.robots import settings_of
from tests.scenarios.wires import rewire


def warnings_of(share: float, linear_m_s: float) -> list[str]:
    """What is said in 6 s of driving by a robot whose encoders count this share of the configured counts."""

    async def scenario() -> list[str]:
        async with simulated_robot(settings_of("chefbot", {"safety.guard.enabled": False})) as robot:
            told = robot.daemon.bus.subscribe(DriveWarned)
            rewire(robot, b"e", lambda counts: [b"%d" % round(share * int(count)) for count in counts])
            await asyncio.sleep(1.0)
            for _ in range(120):
                await robot.client.drive(linear_m_s, 0.0)
                await asyncio.sleep(0.05)
            return [event.reason for event in told.take_all()]

    return run_virtual(scenario())


@pytest.mark.parametrize("linear_m_s", [0.05, 0.1, 0.3])
def test_a_healthy_robot_says_nothing(linear_m_s: float) -> None:
    """As it was built with care, straight ahead from 0.05 to 0.3 m/s."""
    assert warnings_of(1.0, linear_m_s) == []


def test_counts_that_are_four_times_too_many_are_said_while_driving() -> None:
    """It drives at 0.24 m/s for 0.1 and measures 0.06: that, and what to do first."""
    (reason,) = warnings_of(0.25, 0.1)
    assert "at 0.05 m/s by the encoders, where 0.09 is asked for" in reason
    assert "Calibrate the encoders by hand" in reason


def test_counts_that_are_half_of_what_they_should_be_are_said_while_driving() -> None:
    """The encoders count twice: at what the robot measures as 0.2 m/s the duty gives half of that."""
    (reason,) = warnings_of(2.0, 0.2)
    assert "its motor can make 0.1" in reason
