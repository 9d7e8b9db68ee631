"""The wheels' mean speed at a steady command, on motors that are not those of the configuration."""

import asyncio
import math

import pytest

from chefbotd.clock import run_virtual
from chefbotd.core.events import WheelsDriven
from chefbotd.settings import Settings
from chefbotd.testing.daemon import simulated_robot
from tests.scenarios.robots import SKETCHED, settings_of

STEADY_S, DRIVEN_S = {"chefbot": 1.5, "khan": 2.5}, 5.0
OFF = 0.02
"""The most that the mean from ``STEADY_S`` on may be off. Measured: 0.01."""

OVERSHOOT = {"chefbot": 0.14, "khan": 0.16}
"""Of a start from rest on the motors of the configuration, as before the integral was made faster: static friction."""

SLOWEST_M_S = 0.03
SPEEDS_M_S = (0.1, 0.05, 0.2, -0.05)
PLANTS = {"as configured": (1.0, 1.0), "a dead zone of 10": (1.53, 1.0)} | {
    f"friction / {friction}, gain / {gain}": (friction, gain)
    for friction in (0.7, 1.3)
    for gain in (0.7, 1.3)
}
"""The feedforward's friction and duty per speed, as shares of what these motors need."""


def cases() -> list[object]:
    """Every sketch with every plant: at the slowest speed both ways, and at one of the others, which take turns."""
    found: list[object] = []
    for at, robot in enumerate((*SKETCHED, "khan")):
        for plant_at, plant in enumerate(PLANTS):
            for speed_m_s in (SPEEDS_M_S[(at + plant_at) % len(SPEEDS_M_S)], SLOWEST_M_S, -SLOWEST_M_S):
                is_quick = robot == SKETCHED[0] and (plant, speed_m_s) in [
                    ("a dead zone of 10", 0.05),
                    ("friction / 0.7, gain / 0.7", SLOWEST_M_S),
                ]
                marks = [] if is_quick else pytest.mark.slow
                found.append(pytest.param(robot, plant, speed_m_s, marks=marks))
    return found


def settings_for(robot: str, plant: str) -> Settings:
    """The robot with a feedforward for other motors than its own, and nothing else wrong with them."""
    own, (friction, gain) = settings_of(robot, {}).pid, PLANTS[plant]
    told = {"pid.ks_duty": friction * own.ks, "pid.kv_duty_per_m_s": gain * own.kv}
    return settings_of(robot, {"safety.guard.enabled": False, "sim.true.drawn": "perfect", **told})


@pytest.mark.parametrize(("robot", "plant", "speed_m_s"), cases())
def test_a_steady_command_is_followed_at_its_speed(robot: str, plant: str, speed_m_s: float) -> None:
    """From 1.5 s (KHAN 2.5 s) after a start from rest the mean of the true speed, and of odometry's, is within 2 %."""
    settings, steady_s = settings_for(robot, plant), STEADY_S[robot.partition("/")[0]]

    async def run() -> None:
        async with simulated_robot(settings) as simulated:
            await asyncio.sleep(1.5)
            driven = simulated.daemon.bus.subscribe(WheelsDriven, size=5000)
            loop, peak_m_s = asyncio.get_running_loop(), 0.0
            began_s = loop.time()
            places: dict[float, float] = {}
            while loop.time() < began_s + DRIVEN_S:
                await simulated.client.drive(speed_m_s, 0.0)
                for _ in range(5):
                    await asyncio.sleep(0.01)
                    truth = simulated.board.truth(loop.time())
                    places[loop.time() - began_s] = truth.world_from_base.x_m
                    peak_m_s = max(peak_m_s, math.copysign(1.0, speed_m_s) * truth.twist.linear_m_s)
            steady = [(at_s, x_m) for at_s, x_m in places.items() if at_s >= steady_s]
            (from_s, from_m), (to_s, to_m) = steady[0], steady[-1]
            assert (to_m - from_m) / (to_s - from_s) == pytest.approx(speed_m_s, rel=OFF)
            steps = [driven.take_event() for _ in range(len(driven))]
            steps = [step for step in steps if step.stamp_s >= began_s + steady_s]
            turned_rad = sum(steps[-1].position_rad) - sum(steps[0].position_rad)
            rolled_m = turned_rad / len(settings.chassis.wheels) * settings.chassis.wheels[0].radius_m
            over_s = steps[-1].stamp_s - steps[0].stamp_s
            assert rolled_m / over_s == pytest.approx(speed_m_s, rel=OFF)
            if plant == "as configured":
                assert peak_m_s <= (1 + OVERSHOOT[robot.partition("/")[0]]) * abs(speed_m_s)

    run_virtual(run())
