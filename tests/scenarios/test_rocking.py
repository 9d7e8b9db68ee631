"""A driver who changes his mind: to and fro, faster than a wheel that stands would be noticed in one push."""

import asyncio
import itertools
import math

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import IS_FULL, sample
from tests.scenarios.robots import BOARDS, settings_of, sketch_of
from tests.scenarios.wires import Rewrite, frozen, reversed_from_now, rewire

on_every_board = pytest.mark.parametrize("robot_name", sample(BOARDS, 2))
PERIOD_S = 0.05
MOTIONS = [(0.3, 0.0), (0.05, 0.0), (0.0, 1.0), (0.2, 0.5)]
HALF_PERIODS_S = [0.1, 0.2, 0.5, 1.5]
ROCKS = list(itertools.product(MOTIONS, HALF_PERIODS_S))
STANDS = {"on the ground": {}, "lifted": {"sim.body.mass_kg": 0.0}}


async def rock(
    robot: SimulatedRobot, motion: tuple[float, float], half_period_s: float, seconds: float
) -> None:
    """Command a motion at 20 Hz, every half period the other way."""
    for step in range(round(seconds / PERIOD_S)):
        way = -1 if int(step * PERIOD_S / half_period_s + 1e-6) % 2 else 1
        await robot.client.drive(way * motion[0], way * motion[1])
        await asyncio.sleep(PERIOD_S)


async def fault_of(robot: SimulatedRobot) -> tuple[str | None, str]:
    """What the safety topic says, and why."""
    told = (await robot.client.call("get_state"))["safety"]
    return told["fault"], told["reason"]


@pytest.mark.slow
@on_every_board
@pytest.mark.parametrize("stand", sample(list(STANDS)))
def test_a_healthy_robot_may_be_rocked(robot_name: str, stand: str):
    """Every 0.1 to 1.5 s the other way, gently and not, ahead and in place: no fault in a minute (fast tier: 16 s)."""

    async def scenario() -> None:
        overrides = {"safety.guard.enabled": False, **STANDS[stand]}
        async with simulated_robot(settings_of(robot_name, overrides)) as robot:
            await asyncio.sleep(1.0)
            for motion, half_period_s in ROCKS if IS_FULL else ROCKS[::5]:
                await rock(robot, motion, half_period_s, 4.0)
                assert (await fault_of(robot))[0] is None, (motion, half_period_s)

    run_virtual(scenario())


@pytest.mark.slow
@pytest.mark.parametrize("motion", sample([((0.05, 0.3),), ((0.1, 1.0),)]))
def test_a_wheel_on_the_inside_of_a_tight_curve_may_stick(motion: tuple[float, float]):
    """KHAN's inner wheels are hardly asked to turn and dragged sideways: twelve seconds without a fault."""

    async def scenario() -> None:
        settings = settings_of("khan", {"safety.guard.enabled": False})
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.0)
            await rock(robot, motion, 60.0, 12.0)
            assert (await fault_of(robot))[0] is None

    run_virtual(scenario())


@pytest.mark.slow
@on_every_board
@pytest.mark.parametrize("motion", [(0.01, 0.0), (0.0, 0.05), (0.0, 0.1)])
def test_a_healthy_robot_may_creep(robot_name: str, motion: tuple[float, float]):
    """So slowly that friction holds it up first, ahead at 1 cm/s and in place at 0.05 and 0.1 rad/s: nothing latches."""

    async def scenario() -> None:
        slow_cycle = {} if sketch_of(robot_name) else {"sim.board.cycle_s": 0.05}
        async with simulated_robot(settings_of(robot_name, slow_cycle)) as robot:
            await asyncio.sleep(1.0)
            await rock(robot, motion, math.inf, 12.0)
            assert (await fault_of(robot))[0] is None

    run_virtual(scenario())


def found(
    robot_name: str, broken: Rewrite, motion: tuple[float, float], half_period_s: float
) -> tuple[float, str, str]:
    """How long a robot could be rocked with this encoder, and the fault that ended it with its reason."""

    async def scenario() -> tuple[float, str, str]:
        async with simulated_robot(settings_of(robot_name, {})) as robot:
            await asyncio.sleep(1.0)
            rewire(robot, b"e", broken)
            start_s = asyncio.get_running_loop().time()
            with pytest.raises(CallError, match="the robot is stopped"):
                await rock(robot, motion, half_period_s, 10.0)
            return asyncio.get_running_loop().time() - start_s, *await fault_of(robot)

    return run_virtual(scenario())


@pytest.mark.parametrize(
    ("robot_name", "motion"),
    sample(
        [
            ("chefbot", (0.2, 0.0)),
            ("chefbot", (0.0, 1.0)),
            ("khan", (0.2, 0.0)),
            ("khan", (0.3, 0.0)),
            ("chefbot/tiva_bare", (0.0, 1.0)),
            ("chefbot/duemilanove", (0.2, 0.0)),
            ("chefbot/tiva_second", (-0.2, 0.3)),
        ],
        4,
    ),
)
@pytest.mark.parametrize("half_period_s", sample([1.0, 0.3]))
def test_an_unplugged_encoder_is_found_however_often_the_driver_turns_round(
    robot_name: str, motion: tuple[float, float], half_period_s: float
):
    """Every 0.3 or 1 s the other way, ahead and in place: the left (front) wheel is stalled within four seconds."""
    after_s, fault, reason = found(robot_name, frozen(0), motion, half_period_s)
    assert fault == "wheel_stalled"
    assert reason.startswith(("left_wheel", "front_left_wheel"))
    assert 0.5 < after_s < 4.0  # no hair trigger


@on_every_board
@pytest.mark.parametrize("half_period_s", sample([1.0, 0.3]))
def test_a_reversed_encoder_is_found_however_often_the_driver_turns_round(
    robot_name: str, half_period_s: float
):
    """The same with its channels exchanged: reversed, within three seconds."""
    after_s, fault, reason = found(robot_name, reversed_from_now(0), (0.2, 0.0), half_period_s)
    assert fault == "wheel_reversed"
    assert reason.startswith(("left_wheel", "front_left_wheel"))
    assert after_s < 3.0
