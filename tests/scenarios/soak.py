"""A long simulated drive with seeded faults, and what must hold at every step of it.

``python -m tests.scenarios.soak MINUTES [SEED [ROBOT]]`` runs one on the virtual clock and prints what happened.
"""

import asyncio
import random
import resource
import sys

from chefbotd.clock import run_virtual
from chefbotd.process import logs
from chefbotd.settings import Settings
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.scenarios.invariants import Invariants, Report
from tests.scenarios.random_driver import RandomDriver
from tests.scenarios.robots import settings_of

CYCLES_S = {"chefbot": 0.05, "khan": 0.02}
"""The board's; KHAN's loops are laid out for its own 50 Hz, ChefBot's hold at 20 Hz too."""

LEAST_STEPS_SHARE = 0.8
"""Of the cycles that the board has: the others are lost with the link, or fall into a restart."""

MOST_GROWTH_MB = 4.0
"""An hour has 70,000 steps: 60 bytes kept at each are found out."""


def soak(minutes: float, seed: int, robot_name: str = "chefbot") -> Report:
    """Drive for so many simulated minutes; raises ``AssertionError`` when anything does not hold."""
    report = Report(robot_name, minutes)
    cycle = {"sim.board.cycle_s": CYCLES_S[robot_name]} if robot_name in CYCLES_S else {}
    settings = settings_of(robot_name, {"sim.seed": seed, **cycle})

    async def scenario() -> None:
        async with simulated_robot(settings) as robot:
            await _drive(robot, settings, report, random.Random(seed))

    try:
        run_virtual(scenario())
    except BaseExceptionGroup as broken:
        failed = broken.subgroup(AssertionError)
        if failed is None:
            raise
        raise failed.exceptions[0] from None
    return report


async def _drive(robot: SimulatedRobot, settings: Settings, report: Report, rng: random.Random) -> None:
    invariants = Invariants(robot, settings, report)
    random_driver = RandomDriver(robot, invariants, rng, restarts=settings.sim.board.resets)
    async with asyncio.TaskGroup() as group:  # what does not hold ends the drive, wherever it is
        watching = group.create_task(invariants.watch())
        await random_driver.go(report.minutes / 4)
        before_mb = _resident_mb()
        await random_driver.go(3 * report.minutes / 4)
        report.resident_growth_mb = _resident_mb() - before_mb
        watching.cancel()
    report.faults.update({f"injected: {name}": n for name, n in random_driver.injected.items()})
    await _check_the_end(robot, settings, report)


async def _check_the_end(robot: SimulatedRobot, settings: Settings, report: Report) -> None:
    stats = await robot.client.call("get_stats")
    assert stats["internal_errors"] == 0, f"{stats['internal_errors']} control steps failed"
    assert not stats["service_failures"], f"services failed: {stats['service_failures']}"
    assert report.resident_growth_mb < MOST_GROWTH_MB, f"memory grew by {report.resident_growth_mb} MB"
    least = LEAST_STEPS_SHARE * 60 * report.minutes / settings.sim.board.cycle_s
    assert report.control_steps > least, f"{report.control_steps} control steps of more than {least:.0f}"


def _resident_mb() -> float:
    """The most that this process has ever had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    logs.configure("error")
    minutes, seed, robot = (*sys.argv[1:], *("60", "1", "chefbot")[len(sys.argv) - 1 :])
    print(soak(float(minutes), int(seed), robot).dump())  # noqa: T201
