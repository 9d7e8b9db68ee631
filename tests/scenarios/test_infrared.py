"""KHAN's infrared sensor, whose curve folds back, on the robot: no number in the fold, and no contact."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

import pytest

from chefbotd.clock import run_virtual
from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample

CUPBOARD_X_M, SENSOR_X_M, BODY_M = 2.7, 0.06, 0.16
FOLD_M, FULL_SPEED_M_S = 0.15, 1.0


@dataclass(frozen=True)
class Seen:
    """A reading, how far the sensor really was from the cupboard then, and whether the robot touched it."""

    measured: RangeMeasured
    distance_m: float
    in_contact: bool


Scenario = Callable[[SimulatedRobot], Awaitable[None]]


def facing_the_cupboard(scenario: Scenario, **overrides: object) -> None:
    """Run a scenario on KHAN that looks at the middle of the cupboard; overrides are ``section__key``."""
    dotted = {key.replace("__", "."): value for key, value in overrides.items()}

    async def run() -> None:
        settings = load(packaged("khan"), overrides={"sim.world.start_y_m": 0.8, **dotted})
        async with simulated_robot(settings) as robot:
            await scenario(robot)

    run_virtual(run())


async def watch(robot: SimulatedRobot, linear_m_s: float, seconds: float) -> list[Seen]:
    """Drive, and look at every reading within 5 ms of its coming."""
    inbox, seen = robot.daemon.bus.subscribe(RangeMeasured, size=1000), []
    for tick in range(round(seconds / 0.005)):
        if linear_m_s and tick % 10 == 0:
            await robot.client.drive(linear_m_s, 0.0)
        await asyncio.sleep(0.005)
        truth = robot.board.truth(0.0)
        distance_m = CUPBOARD_X_M - SENSOR_X_M - truth.world_from_base.x_m
        seen += [Seen(inbox.take_event(), distance_m, truth.in_contact) for _ in range(len(inbox))]
    inbox.close()
    return seen


@pytest.mark.parametrize("wire", sample(["khan", "khan_edges"]))
def test_at_full_speed_it_stops_before_the_cupboard(wire: str):
    """Nothing else guards: from 1 m/s to rest 0.15 to 0.25 m from the sensor, which is 0.10 m behind the bumper."""

    async def scenario(robot: SimulatedRobot) -> None:
        seen = await watch(robot, FULL_SPEED_M_S, 8.0)
        assert not any(each.in_contact for each in seen)
        assert 0.15 < seen[-1].distance_m < 0.25
        assert robot.board.truth(0.0).twist.linear_m_s == 0.0
        assert (await robot.client.call("get_state"))["safety"]["limited_by"] == "obstacle:front"
        await watch(robot, -0.2, 2.0)
        assert robot.board.truth(0.0).twist.linear_m_s == pytest.approx(-0.2, rel=0.05)

    facing_the_cupboard(scenario, robot__wire=wire)


@pytest.mark.parametrize("linear_m_s", sample([FULL_SPEED_M_S, 0.3, 0.1]))
@pytest.mark.parametrize("seed", sample([1, 2, 3]))
def test_driven_into_the_cupboard_it_tells_no_number_in_the_fold(linear_m_s: float, seed: int):
    """Unguarded until it leans on it, whatever the speed: a number only of what is at 0.20 m or beyond, within 2 cm.

    The sensor is 0.10 m from the cupboard then, and gives what 0.27 m does.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        seen = await watch(robot, linear_m_s, 1.0 + 2.6 / linear_m_s)
        assert seen[-1].in_contact
        assert seen[-1].distance_m == pytest.approx(CUPBOARD_X_M - SENSOR_X_M - (CUPBOARD_X_M - BODY_M))
        assert sum(each.distance_m < FOLD_M for each in seen) > 5
        numbers = [each for each in seen if each.measured.range_m is not None]
        assert len(numbers) > 10
        assert min(each.distance_m for each in numbers) > 0.18

    facing_the_cupboard(scenario, safety__guard__enabled=False, sim__seed=seed)


@pytest.mark.parametrize("interrupted", sample(["start", "board", "cable"]))
def test_in_front_of_the_cupboard_it_believes_nothing_after_an_interruption(interrupted: str):
    """0.12 m from it, which looks like 0.25 m: no number and no way ahead; from where it sees 0.4 m, both are back."""

    async def scenario(robot: SimulatedRobot) -> None:
        await asyncio.sleep(1.0)
        if interrupted == "board":
            await robot.client.reset_board()
            await asyncio.sleep(3.0)
        if interrupted == "cable":
            robot.device.unplug()
            await asyncio.sleep(0.5)
            robot.device.plug()
            await asyncio.sleep(2.5)
        if interrupted != "start":
            await robot.client.arm()
        seen = await watch(robot, 0.1, 1.0)
        assert {each.measured.status for each in seen} == {RangeStatus.AMBIGUOUS}
        assert seen[-1].distance_m == pytest.approx(seen[0].distance_m, abs=0.001)
        seen = await watch(robot, -0.2, 2.0)
        assert seen[-1].measured.status is RangeStatus.OK
        assert seen[-1].measured.range_m == pytest.approx(seen[-1].distance_m, rel=0.1)
        before_m = seen[-1].distance_m
        assert (await watch(robot, 0.1, 1.0))[-1].distance_m < before_m - 0.03

    facing_the_cupboard(scenario, sim__world__start_x_m=CUPBOARD_X_M - SENSOR_X_M - 0.12)


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_a_board_with_another_adc_stops_before_the_cupboard(bits: int):
    """``adc_bits`` says how many bits a reading has; at 0.5 m/s it stands 0.15 to 0.25 m from the sensor."""

    async def scenario(robot: SimulatedRobot) -> None:
        seen = await watch(robot, 0.5, 8.0)
        assert not any(each.in_contact for each in seen)
        assert 0.15 < seen[-1].distance_m < 0.25

    infrared = load(packaged("khan")).infrared[0].model_dump(exclude_unset=True, mode="json")
    facing_the_cupboard(
        scenario,
        sim__board__adc_bits=bits,
        infrared=[infrared | {"adc_bits": bits}],
        battery__adc_full_scale=2**bits - 1,
    )
