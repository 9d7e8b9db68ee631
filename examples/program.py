"""Runs an example's ``main(robot)``: for the robot of a daemon, or for a simulated one that knows where it is.

The simulated one runs faster than real time. ``chefbotctl sweep`` runs the same programs over seeds and worlds.
"""

import argparse
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from chefbotd.cli.common.context import run_until_signalled
from chefbotd.cli.common.echo import echo
from chefbotd.client import Client

Program = Callable[[Client], Awaitable[str]]
Simulated = Callable[[str, int], Mapping[str, Any]]
"""What ``localized_robot`` takes for a world and a seed: where it starts, places, people."""


def run(main: Program, simulated: Simulated) -> None:
    """Run it as the options of the command line say, and print what it returns."""
    parser = argparse.ArgumentParser()
    parser.add_argument(
        "--connect", metavar="HOST:PORT", help="the robot's daemon; without it, one is simulated"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the simulated robot's noise")
    options = parser.parse_args()
    try:
        if options.connect is None:
            echo(run_simulated(main, simulated, options.seed))
        else:
            host, _, port = options.connect.rpartition(":")
            echo(run_until_signalled(_run_connected(main, host, int(port))))
    except KeyboardInterrupt:
        echo("Ended: the robot brakes.")


def run_simulated(main: Program, simulated: Simulated, seed: int = 1) -> str:
    """What it returns with the robot in the simulated flat, on the virtual clock."""
    from chefbotd.clock import run_virtual
    from chefbotd.testing.on_map import localized_robot

    async def run() -> str:
        keywords = dict(simulated("flat", seed))
        overrides = {"sim.seed": seed, **keywords.pop("overrides", {})}
        async with localized_robot("flat", overrides=overrides, **keywords) as robot:
            return await main(robot.client)

    return run_virtual(run())


async def _run_connected(main: Program, host: str, port: int) -> str:
    async with Client.connect(host, port) as robot:
        await robot.wait_until_armed()
        return await main(robot)
