"""A gamepad on the whole daemon and the simulated KHAN, beside a navigation that goes on talking."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from chefbotd.cli.drive.gamepad import Button, PadReading, StickScale
from chefbotd.cli.drive.joystick import JoystickPilot
from chefbotd.client import Client
from chefbotd.clock import run_virtual
from chefbotd.core.events import SafetyChanged
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample

HELD = PadReading(1.0, 0.0, frozenset({Button.ENABLE}))


class Pad:
    """A gamepad that is as the test says."""

    name = "Pad"

    def __init__(self) -> None:
        self.reading: PadReading | None = PadReading()

    def read(self) -> PadReading | None:
        return self.reading


Script = Callable[[SimulatedRobot, Pad], Awaitable[None]]


def with_a_pad(script: Script) -> None:
    """KHAN with its board up, and a pilot whose pad the script handles."""

    async def run() -> None:
        async with simulated_robot(load(packaged("khan"))) as robot:
            await asyncio.sleep(1.0)
            pad = Pad()
            async with Client.connect(*await robot.daemon.server.address()) as client:
                pilot = asyncio.create_task(
                    JoystickPilot(client, pad, lambda _text: None, StickScale()).run()
                )
                await asyncio.sleep(0.1)
                await script(robot, pad)
                pilot.cancel()
                await asyncio.gather(pilot, return_exceptions=True)

    run_virtual(run())


def speed_m_s(robot: SimulatedRobot) -> float:
    """How fast the robot really goes."""
    return robot.board.truth(0.0).twist.linear_m_s


async def navigate(robot: SimulatedRobot) -> None:
    """A planner's command five times a second."""
    while True:
        await robot.client.drive(0.1, 0.0, "move_base")
        await asyncio.sleep(0.2)


@pytest.mark.parametrize("released", sample([PadReading(1.0, 0.0), None]))
def test_who_lets_go_gives_the_robot_back(released: PadReading | None):
    """The button up, or the pad unplugged: navigation's live command is followed at once, and nobody is stopped."""

    async def script(robot: SimulatedRobot, pad: Pad) -> None:
        navigating = asyncio.create_task(navigate(robot))
        pad.reading = HELD
        await asyncio.sleep(1.5)
        assert speed_m_s(robot) == pytest.approx(0.2, rel=0.05)
        changes = robot.daemon.bus.subscribe(SafetyChanged, size=100)
        stop_hold_s, pad.reading = asyncio.get_running_loop().time(), released
        await asyncio.sleep(1.0)
        told = [changes.take_event() for _ in range(len(changes))]
        assert [event.source for event in told] == ["move_base"]
        assert told[0].stamp_s - stop_hold_s <= 0.02
        assert speed_m_s(robot) == pytest.approx(0.1, rel=0.05)
        navigating.cancel()

    with_a_pad(script)


def test_who_lets_go_leaves_no_velocity_behind():
    """With nobody else driving, 0.2 m/s at 3 m/s2 is over 0.067 s after a look saw it, not at the dead-man."""

    async def script(robot: SimulatedRobot, pad: Pad) -> None:
        pad.reading = HELD
        await asyncio.sleep(1.5)
        pad.reading = PadReading(1.0, 0.0)
        await asyncio.sleep(0.15)
        assert not any(robot.board.duty)
        state = (await robot.client.call("get_state"))["safety"]
        assert (state["source"], state["control"], state["mode"]) == (None, {}, "armed")

    with_a_pad(script)


def test_its_stop_is_for_everybody():
    """X forgets navigation's command too: the robot brakes until navigation says something new."""

    async def script(robot: SimulatedRobot, pad: Pad) -> None:
        await robot.client.drive(0.1, 0.0, "move_base")
        pad.reading = PadReading(down=frozenset({Button.STOP}))
        await asyncio.sleep(0.02)
        assert (await robot.client.call("get_state"))["safety"]["source"] is None

    with_a_pad(script)
