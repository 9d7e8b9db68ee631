"""How long a simulated hour of a navigating robot takes on one core: the whole daemon, its worker and the simulator.

A ChefBot with a lidar is sent from place to place in the flat, on the virtual clock, all in one process. The processor's
time counts, not the clock's, so that what else the computer does matters little.
"""

import asyncio
import itertools
import logging
import time

import structlog

from benchmarks.figures import Figure, Outcome
from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Pose2D
from chefbotd.testing.on_map import localized_robot

START = Pose2D(2.45, 2.6, 2.1)
PLACES = {
    "sofa": Pose2D(2.6, 4.0, 0.4),
    "dining table": Pose2D(2.6, 1.95, -0.6),
    "desk": Pose2D(5.3, 6.75, 2.4),
    "kitchen": Pose2D(6.4, 1.6, -1.57),
}
SIMULATED_S, QUICK_SIMULATED_S = 300.0, 60.0
TARGET_MINUTES = 3.0
"""Twenty simulated hours in an hour."""


def run(*, quick: bool = False) -> Outcome:
    """The processor's minutes for a simulated hour, and how many of those fit into an hour."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.ERROR))
    try:
        simulated_s, processor_s, goals = run_virtual(_drive(QUICK_SIMULATED_S if quick else SIMULATED_S))
    finally:
        structlog.reset_defaults()
    share = processor_s / simulated_s
    figure = Figure("a simulated hour of navigation", 60.0 * share, "min", TARGET_MINUTES)
    return Outcome(
        (figure, Figure("simulated hours in an hour", 1.0 / share, "")), (f"{goals} goals were reached",)
    )


async def _drive(least_s: float) -> tuple[float, float, int]:
    """Simulated seconds, the processor's, and goals; a goal that is not reached raises an error."""
    loop = asyncio.get_running_loop()
    async with localized_robot("flat", START, PLACES) as robot:
        began_s, processor_s = loop.time(), time.process_time()
        goals, places = 0, itertools.cycle(PLACES)
        while loop.time() - began_s < least_s:
            await robot.client.navigate_to(place=next(places))
            goals += 1
        return loop.time() - began_s, time.process_time() - processor_s, goals
