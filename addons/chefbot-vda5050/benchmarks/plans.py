"""What looking for a way costs before an order is taken: nodes that are new, known ones, and eight new ones together.

    python addons/chefbot-vda5050/benchmarks/plans.py

The simulated robot stands in the flat; its daemon and its worker are processes on the real clock, so a computer that is
busy counts.
"""

import asyncio
import random
import statistics
import tempfile
import time
from functools import partial
from pathlib import Path

import click
from chefbot_vda5050.chefbot import ChefBot
from chefbot_vda5050.messages import NodePosition

from chefbotd.client import Client
from chefbotd.components.worker.spawn import spawn
from chefbotd.testing.on_map import localized_robot

TIMES, TOGETHER = 40, 8


async def main() -> None:
    """Print the times."""
    chance = random.Random(1)
    found: dict[str, list[float]] = {"a new node": [], "a known node": [], f"{TOGETHER} new nodes": []}
    with tempfile.TemporaryDirectory() as folder:
        async with localized_robot(folder=Path(folder), spawn_worker=spawn) as simulated:
            robot = ChefBot(partial(Client.connect, *simulated.client.address, name="fleet"))
            task = asyncio.create_task(robot.run())
            while not robot.facts.localized:  # noqa: ASYNC110 - as a person looks
                await asyncio.sleep(0.1)
            for number in range(TIMES):
                await asyncio.sleep(chance.uniform(0.1, 0.3))  # at any moment of the worker's turn
                x = 1.4 + 0.01 * number
                node = NodePosition(x=x, y=2.55, map_id="flat")
                others = [NodePosition(x=x, y=2.45 + 0.01 * k, map_id="flat") for k in range(TOGETHER)]
                works = (
                    lambda node=node: robot.unreachable(node),
                    lambda node=node: robot.unreachable(node),
                    lambda others=others: asyncio.gather(*(robot.unreachable(one) for one in others)),
                )
                for times, work in zip(found.values(), works, strict=True):
                    began_s = time.perf_counter()
                    await work()
                    times.append(1000 * (time.perf_counter() - began_s))
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
    for what, times in found.items():
        times.sort()
        click.echo(
            f"{what}: median {statistics.median(times):.2f} ms, 95 % within {times[int(0.95 * TIMES)]:.2f} ms"
        )


if __name__ == "__main__":
    asyncio.run(main())
