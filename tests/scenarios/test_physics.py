"""What a robot promises holds in the plane and by MuJoCo, which knows nothing of our own physics."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.components.simulation.plant import Push
from chefbotd.core.geometry import Pose2D
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.scenarios.robots import ROBOTS, settings_of

PHYSICS = ("planar", "mujoco")
MASS_KG = {"chefbot": 6.0, "khan": 3.0}

Scenario = Callable[[SimulatedRobot], Awaitable[None]]


def on(physics: str, robot_name: str, scenario: Scenario, **changes: Any) -> None:
    """Run a scenario on a plausible robot that has nothing in its way, with its board up."""
    if physics == "mujoco":
        pytest.importorskip("mujoco", reason="an extra")
    overrides = {"sim.physics": physics, "safety.guard.enabled": False}
    overrides |= {key.replace("__", "."): value for key, value in changes.items()}

    async def run() -> None:
        async with simulated_robot(settings_of(robot_name, overrides)) as robot:
            await asyncio.sleep(1.0)
            await scenario(robot)

    run_virtual(run())


async def drive(robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float) -> None:
    """Repeat a command at 20 Hz."""
    for _ in range(round(seconds / 0.05)):
        await robot.client.drive(linear_m_s, angular_rad_s)
        await asyncio.sleep(0.05)


def pose(robot: SimulatedRobot) -> Pose2D:
    """Where it really is."""
    return robot.board.truth(0.0).world_from_base


def apart_m(a: Pose2D, b: Pose2D) -> float:
    """The distance of two places."""
    return math.dist((a.x_m, a.y_m), (b.x_m, b.y_m))


async def odometry_of(robot: SimulatedRobot) -> Any:
    """The topic's latest data."""
    return (await robot.client.call("get_state"))["topics"]["odometry"]["data"]


async def safety(robot: SimulatedRobot) -> Any:
    """The topic's latest data."""
    return (await robot.client.call("get_state"))["safety"]


@pytest.mark.parametrize("physics", PHYSICS)
def test_odometry_follows_a_square(physics: str) -> None:
    """On a robot that is as configured, a 1 m square ends within 1 cm and 1 degree of what odometry says.

    By MuJoCo tyres give and treads have a width.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        for _ in range(4):
            await drive(robot, 0.2, 0.0, 5.0)
            await drive(robot, 0.0, 0.5, math.pi)
        await robot.client.stop()
        await asyncio.sleep(1.0)
        odometry, true = await odometry_of(robot), pose(robot)
        assert math.dist((odometry["x_m"], odometry["y_m"]), (true.x_m, true.y_m)) < 0.01
        assert abs(math.remainder(odometry["heading_rad"] - true.heading_rad, math.tau)) < math.radians(1)

    on(physics, "chefbot", scenario, sim__true__drawn="perfect")


@pytest.mark.parametrize("robot_name", ROBOTS)
@pytest.mark.parametrize("physics", PHYSICS)
def test_a_steady_speed_is_that_of_the_command(physics: str, robot_name: str) -> None:
    """From 2.5 s on the mean of 0.1 m/s is within 2 %, and what a plausible robot's radii are off: 0.3 %."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.1, 0.0, 2.5)
        began = pose(robot)
        await drive(robot, 0.1, 0.0, 4.0)
        assert apart_m(began, pose(robot)) / 4.0 == pytest.approx(0.1, rel=0.023)

    on(physics, robot_name, scenario)


@pytest.mark.parametrize("robot_name", ROBOTS)
@pytest.mark.parametrize("physics", PHYSICS)
@pytest.mark.parametrize("method", ["stop", "estop"])
def test_a_stop_stops(physics: str, robot_name: str, method: str) -> None:
    """At 0.3 m/s the robot is at rest 0.6 s later and 0.1 m further on, and stays; after an e-stop it does not drive."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.3, 0.0, 2.0)
        began = pose(robot)
        await robot.client.call(method)
        await asyncio.sleep(0.6)
        stopped = pose(robot)
        assert apart_m(began, stopped) < 0.1
        await asyncio.sleep(2.0)
        assert apart_m(stopped, pose(robot)) < 0.002
        if method == "estop":
            with pytest.raises(CallError, match="the emergency stop is on"):
                await robot.client.drive(0.2, 0.0)

    on(physics, robot_name, scenario)


@pytest.mark.parametrize("robot_name", ROBOTS)
@pytest.mark.parametrize("physics", PHYSICS)
def test_a_push_is_survived_and_measured(physics: str, robot_name: str) -> None:
    """A third of its weight pushes a robot at rest for 0.2 s: nothing latches, and its wheels measure the travel."""

    async def scenario(robot: SimulatedRobot) -> None:
        began = pose(robot)
        robot.board.push(Push(forward_n=9.81 / 3 * MASS_KG[robot_name]), 0.2)
        await asyncio.sleep(2.0)
        moved_m = apart_m(began, pose(robot))
        odometry = await odometry_of(robot)
        assert moved_m > 0.005
        assert math.hypot(odometry["x_m"], odometry["y_m"]) == pytest.approx(moved_m, abs=0.002)
        await drive(robot, 0.1, 0.0, 1.0)
        assert (await safety(robot))["fault"] is None

    on(physics, robot_name, scenario)
