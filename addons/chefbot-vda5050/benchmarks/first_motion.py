"""How much later the robot moves by an order than by a goal of a client: simulated robot, daemon and worker.

    python addons/chefbot-vda5050/benchmarks/first_motion.py [TIMES]

Daemon and worker are processes' work on the real clock, so a computer that is busy counts. ``figures.py`` measures what
MQTT costs beside that.
"""

import asyncio
import random
import statistics
import sys
import tempfile
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import click
from chefbot_vda5050.chefbot import ChefBot
from chefbot_vda5050.messages import NodePosition
from chefbot_vda5050.service import limits
from msgspec.structs import replace
from test_vda5050_chefbot import END, START, RealFleet, order_from
from vda5050_fakes import is_idle

from chefbotd.client import Client
from chefbotd.components.worker.spawn import spawn
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot
from chefbotd.testing.on_map import localized_robot

LOOK_S = 0.002


async def main(times: int) -> None:
    """Print the times of goals, of orders to nodes that are new, and of orders to nodes that are known."""
    chance = random.Random(1)
    with tempfile.TemporaryDirectory() as folder:
        async with localized_robot(folder=Path(folder), spawn_worker=spawn) as simulated:
            robot = ChefBot(partial(Client.connect, *simulated.client.address, name="fleet"))
            now = RealFleet(
                robot, limits=replace(limits(load(packaged("chefbot_lidar")), 10.0), start_tolerance_m=9.0)
            )
            tasks = [asyncio.create_task(work) for work in (robot.run(), now.agent.run())]
            now.agent.set_online(True)
            await now.until(lambda state: state.agv_position is not None)
            found: dict[str, list[float]] = {
                "a goal": [],
                "an order, new nodes": [],
                "an order, known nodes": [],
            }
            for number in range(times):
                for what, seconds in found.items():
                    await asyncio.sleep(1.5 + chance.uniform(0.0, 0.2))  # at any moment of the worker's turn
                    seconds.append(await _first_motion(what, now, simulated, robot, number))
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
    for what, seconds in found.items():
        ms = sorted(1000 * one for one in seconds)
        middle, mean = statistics.median(ms), statistics.mean(ms)
        click.echo(f"{what}: median {middle:.0f} ms, mean {mean:.0f} ms, {ms[0]:.0f} to {ms[-1]:.0f} ms")


async def _first_motion(
    what: str, now: RealFleet, simulated: SimulatedRobot, robot: ChefBot, number: int
) -> float:
    """From the message to the wheels; then the robot is at the other end."""
    here = simulated.board.truth(simulated.now_s()).world_from_base
    to = END if abs(here.x_m - START[0]) < abs(here.x_m - END[0]) else START
    clock = asyncio.get_running_loop()
    began_s = clock.time()
    if what == "a goal":
        drive = asyncio.create_task(simulated.client.navigate_to(*to))
    else:
        if what.endswith("new nodes"):
            robot._ways.clear()
        else:
            await robot.unreachable(NodePosition(x=to[0], y=to[1], map_id="flat"))
            await asyncio.sleep(random.uniform(0.3, 0.5))
            began_s = clock.time()
        order_id = f"{what} {number}"
        await now.order(order_from((here.x_m, here.y_m), to), order_id=order_id)
    while abs(simulated.board.truth(simulated.now_s()).twist.linear_m_s) < 1e-3 and not _turns(simulated):  # noqa: ASYNC110 - as a camera looks
        await asyncio.sleep(LOOK_S)
    seconds = clock.time() - began_s
    if what == "a goal":
        await drive
    else:
        await now.until(lambda state: state.order_id == order_id and is_idle(state), within_s=120.0)
    return seconds


def _turns(simulated: SimulatedRobot) -> bool:
    return abs(simulated.board.truth(simulated.now_s()).twist.angular_rad_s) > 1e-3


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1]) if len(sys.argv) > 1 else 10))
