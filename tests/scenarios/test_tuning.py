"""Gains changed on a robot that drives: no bump, and a way back."""

import asyncio

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.scenarios.robots import OBEYED_S

STEADY_S = 4.0


async def steady_drive(robot: SimulatedRobot, seconds: float) -> list[list[int]]:
    """Drive at 0.1 m/s; the wheels' duty at every control step."""
    duty = []
    loop = asyncio.get_running_loop()
    ends_s = loop.time() + seconds
    async with robot.client.subscribe("wheels", policy="ordered") as samples:
        async for sample in samples:
            duty.append(sample.data.duty)
            await robot.client.drive(0.1, 0.0)
            if loop.time() > ends_s:
                break
    return duty


def test_tuning_while_driving_makes_no_bump() -> None:
    """Ki and kv are changed, and changed back, at a steady 0.1 m/s: duty moves no more than it does by itself."""

    async def scenario() -> tuple[int, list[int]]:
        async with simulated_robot() as robot:
            await robot.client.arm()
            steady = (await steady_drive(robot, STEADY_S))[-50:]
            ripple = max(duty[0] for duty in steady) - min(duty[0] for duty in steady)
            jumps = []
            for change in (robot.client.set_pid("all", ki=50.0, kv=300.0), robot.client.undo_pid()):
                before = (await steady_drive(robot, 1.0))[-1][0]
                await change
                after = (await steady_drive(robot, 0.05))[-1][0]
                jumps.append(abs(after - before))
            return ripple, jumps

    ripple, jumps = run_virtual(scenario())
    assert max(jumps) <= ripple + 3


@pytest.mark.slow
@pytest.mark.parametrize("robot_name", ["chefbot", "khan"])
def test_gains_far_off_make_no_bump_and_hold_back_no_stop(robot_name: str) -> None:
    """No feedforward from one moment to the next: no bump, and a stop just after it is through within its ramp."""

    async def scenario() -> tuple[list[int], float]:
        async with simulated_robot(load(packaged(robot_name))) as robot:
            await steady_drive(robot, STEADY_S)
            before = max(map(abs, robot.board.duty))
            await robot.client.set_pid("all", ks=0.0, kv=0.0, ka=0.0, integral_limit=2.5)
            retuned = max(map(abs, robot.board.duty))
            await steady_drive(robot, 0.05)
            after = max(map(abs, robot.board.duty))
            stopped_s = asyncio.get_running_loop().time()
            await robot.client.stop()
            for _ in range(500):
                if not any(robot.board.duty):
                    break
                await asyncio.sleep(0.002)
            return [before, retuned, after], asyncio.get_running_loop().time() - stopped_s

    duties, stopped_after_s = run_virtual(scenario())
    assert duties == pytest.approx([duties[0]] * 3, rel=0.12)
    assert stopped_after_s < 0.1 + OBEYED_S  # the ramp, and until the sketch obeys


def test_undo_is_shared_by_all_clients() -> None:
    """One client's change is taken back by another, wheel by wheel, to exactly what it was."""

    async def scenario() -> None:
        async with simulated_robot() as robot:
            before = await robot.client.get_pid()
            await robot.client.set_pid("left_wheel", kp=1.0, back_calculation_s=None)
            await robot.client.set_pid("all", kd=2.0)
            assert (await robot.client.undo_pid())["left_wheel"].kp == 1.0
            assert await robot.client.undo_pid() == before

    run_virtual(scenario())


@pytest.mark.parametrize("wheel", ["left_wheel", "all"])
def test_a_gain_out_of_range_changes_nothing(wheel: str) -> None:
    """It is refused, and there is nothing to undo."""

    async def scenario() -> list[str]:
        async with simulated_robot() as robot:
            kinds = []
            for attempt in (robot.client.set_pid(wheel, kp=-1.0), robot.client.undo_pid()):
                try:
                    await attempt
                except CallError as error:
                    kinds.append(error.kind)
            return kinds

    assert run_virtual(scenario()) == ["invalid_params", "nothing_to_undo"]
