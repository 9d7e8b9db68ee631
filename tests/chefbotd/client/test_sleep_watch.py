"""A program that slept: its motion is over, and it has to begin anew."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import cast

import pytest

from chefbotd.client import Client, MotionInterrupted
from chefbotd.client.sleep_watch import KEPT_S, PERIOD_S, SleepWatch
from chefbotd.clock import VirtualLoop, run_virtual, suspended_s
from chefbotd.core.geometry import Twist2D
from tests.fakes.api import Served, serving
from tests.fakes.robot import WHEELS

TIMEOUT_S = 0.5
"""The dead-man of the fake robot's daemon."""


def stand_still(seconds: float) -> None:
    """Freeze the whole process for so long."""
    cast(VirtualLoop, asyncio.get_running_loop()).stand_still(seconds)


async def server_polls() -> None:
    """Let the server, which was frozen in the same process, see that nothing waits for it."""
    await asyncio.sleep(0.1)


def with_robot(scenario: Callable[[Served, Client], Awaitable[None]]) -> None:
    """Run a scenario with the real server on a fake robot, and a client connected to it."""

    async def main() -> None:
        async with serving() as served, Client.connect(served.host, served.port) as robot:
            await scenario(served, robot)

    run_virtual(main())


def speeds(served: Served) -> list[float]:
    """Every velocity ahead that arrived, in m/s."""
    return [call[2].linear_m_s for call in served.robot.calls if isinstance(call[-1], Twist2D)]  # type: ignore[attr-defined]


def test_the_greeting_tells_for_how_long_a_command_is_obeyed() -> None:
    """A program need not know the robot's configuration."""

    async def scenario(served: Served, robot: Client) -> None:
        assert robot.hello.command_timeout_s == TIMEOUT_S

    with_robot(scenario)


@pytest.mark.parametrize("slept_s", [0.65, 3.0, 500.0])
def test_a_motion_ends_where_its_program_slept(slept_s: float) -> None:
    """The next command is not sent, and says why; the one after it begins anew."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.drive(0.2, 0.0)
        await asyncio.sleep(0.05)
        stand_still(slept_s)
        with pytest.raises(
            MotionInterrupted, match=r"did not run for .* s, and the robot obeys a command for 0.5 s"
        ):
            await robot.drive(0.2, 0.0)
        assert speeds(served) == [0.2]
        await server_polls()
        await robot.drive(0.1, 0.0)
        assert speeds(served) == [0.2, 0.1]

    with_robot(scenario)


def test_a_sleep_is_still_known_a_second_later() -> None:
    """The program may have something else to do before it drives on."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.drive(0.2, 0.0)
        stand_still(10.0)
        await asyncio.sleep(1.0)
        with pytest.raises(MotionInterrupted):
            await robot.drive(0.2, 0.0)

    with_robot(scenario)


@pytest.mark.parametrize("slept_s", [0.1, 0.4])
def test_a_short_delay_ends_no_motion(slept_s: float) -> None:
    """The robot obeys its last command for longer than that."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.drive(0.2, 0.0)
        await asyncio.sleep(0.05)
        stand_still(slept_s)
        await server_polls()
        await robot.drive(0.2, 0.0)

    with_robot(scenario)


@pytest.mark.parametrize("pause_s", [0.6, 1.0, 5.0, 60.0])
def test_a_program_that_pauses_on_purpose_drives_again(pause_s: float) -> None:
    """Its event loop ran all the time: nothing slept."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.drive(0.2, 0.0)
        await asyncio.sleep(pause_s)
        await robot.drive(0.2, 0.0)
        assert speeds(served) == [0.2, 0.2]

    with_robot(scenario)


def test_zero_is_sent_after_a_sleep_too() -> None:
    """What brakes is never held back, and it ends the motion: the next command is another one."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.drive(0.2, 0.0)
        stand_still(3.0)
        await server_polls()
        await robot.drive(0.0, 0.0)
        await robot.drive(0.1, 0.0)
        assert speeds(served) == [0.2, 0.0, 0.1]

    with_robot(scenario)


def test_driving_for_a_time_ends_where_the_program_slept(monkeypatch: pytest.MonkeyPatch) -> None:
    """``drive_for`` raises, and has commanded zero."""

    def suspend() -> None:
        monkeypatch.setattr("chefbotd.client.sleep_watch.suspended_s", lambda: suspended_s() + 3.0)

    async def scenario(served: Served, robot: Client) -> None:
        asyncio.get_running_loop().call_later(1.0, suspend)
        with pytest.raises(MotionInterrupted):
            await robot.drive_for(10.0, linear_m_s=0.2)
        assert speeds(served)[-1] == 0.0
        assert 19 <= len(speeds(served)) <= 22  # one each 0.05 s for a second, and zero

    with_robot(scenario)


def test_wheels_stand_where_the_program_slept() -> None:
    """Wheel speeds are commands to move, too."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.set_wheel_velocities({WHEELS[0]: 1.0})
        stand_still(3.0)
        with pytest.raises(MotionInterrupted):
            await robot.set_wheel_velocities({WHEELS[0]: 1.0})

    with_robot(scenario)


def test_a_suspended_computer_counts_as_sleep(monkeypatch: pytest.MonkeyPatch) -> None:
    """The loop's clock stands while the computer is suspended; what the kernel's clock since boot has more is added."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.drive(0.2, 0.0)
        await asyncio.sleep(0.05)
        monkeypatch.setattr("chefbotd.client.sleep_watch.suspended_s", lambda: suspended_s() + 7200.0)
        with pytest.raises(MotionInterrupted, match=r"did not run for 7[12]\d\d\.\d s"):
            await robot.drive(0.2, 0.0)

    with_robot(scenario)


def test_suspension_is_what_the_clock_since_boot_has_more() -> None:
    """It is no less than zero, and the same at two looks: this computer is awake."""
    before_s, between_s, after_s = suspended_s(), time.monotonic(), suspended_s()
    assert between_s > 0
    assert before_s >= -1e-3
    assert after_s == pytest.approx(before_s, abs=0.05)


def test_the_watch_ends_by_itself() -> None:
    """A program that drives no more wakes for nothing."""

    async def scenario() -> None:
        watch = SleepWatch()
        watch.renew()
        await asyncio.sleep(KEPT_S + 2 * PERIOD_S)
        stand_still(5.0)
        assert watch.slept_s() == 0.0

    run_virtual(scenario())
