"""Kills at random moments, with a real broker: ``python addons/chefbot-fleet/benchmarks/kills_online.py`` (KILLS=50).

mosquitto, the manager and the robots' side of VDA 5050 are the real programs; the robots' bodies are discs. While four
robots bring one order after the other, broker, manager and a robot are killed so often each, at random moments, and
started again up to two seconds later. The broker is stopped for 12 s (SIGSTOP) as often besides: what is on its way then
arrives when it is too old. People count what they loaded and unloaded; each robot notes orders that it drove though they
came later than it takes them.
"""

import asyncio
import itertools
import os
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import structlog

from chefbotd.transport.ports import reserve_port

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from chefbot_fleet.demo.story import Demonstration, pairs
from fleet_discs import SPEED_M_S, DiscRobot

ROBOTS, WAITING, STOPPED_S = 4, 5, 12.0


class Run:
    """Orders that never end, until they do; and what is killed meanwhile."""

    def __init__(self, folder: Path) -> None:
        self.shown = Demonstration(
            folder, DiscRobot, robots=ROBOTS, count=0, page_port=reserve_port(), speed_m_s=SPEED_M_S
        )
        self.chance, self.given, self.is_over = random.Random(0), list[str](), False

    async def give_orders(self) -> None:
        """So that some always wait; the same one again where the manager did not answer."""
        for number, (pick, drop) in enumerate(pairs()):
            name = f"order {number}"
            while not self.is_over:
                with suppress(OSError):
                    if (
                        sum(order["stage"] == "waiting" for order in (await self.shown.fleet())["orders"])
                        < WAITING
                    ):
                        await self.shown.order(name, pick, drop)
                        self.given.append(name)
                        break
                await asyncio.sleep(0.2)
            if self.is_over:
                return

    async def until_done(self) -> dict[str, Any]:
        """When nothing is left to do, or has not been done in ten minutes."""
        fleet: dict[str, Any] = {}
        with suppress(TimeoutError):
            async with asyncio.timeout(600.0):
                while fleet.get("done", -1) < len(self.given):
                    await asyncio.sleep(1.0)
                    with suppress(OSError):
                        fleet = await self.shown.fleet()
        return fleet

    async def kill_broker(self) -> None:
        """It is away for up to two seconds."""
        await self.shown.broker.kill()
        await asyncio.sleep(self.chance.uniform(0.0, 2.0))
        await self.shown.broker.start()

    async def stop_broker(self) -> None:
        """It says nothing for a while; then all that was on its way arrives."""
        self.shown.broker.pause()
        await asyncio.sleep(STOPPED_S)
        self.shown.broker.go_on()

    async def kill_manager(self) -> None:
        """It has nothing but its database then."""
        await self.shown.manager.kill()
        await asyncio.sleep(self.chance.uniform(0.0, 2.0))
        await self.shown.manager.start()

    async def kill_robot(self) -> None:
        """Its agent forgets its order; its body stays where it is."""
        robot = self.chance.choice(self.shown.robots)
        await robot.switch_off()
        await asyncio.sleep(self.chance.uniform(0.0, 2.0))
        await robot.switch_on()
        await robot.join()


async def one(name: str, kill: Callable[[Run], Awaitable[None]], times: int) -> bool:
    """One kind of victim; whether nothing was lost, done by two robots, or driven late."""
    with tempfile.TemporaryDirectory() as folder:
        run = Run(Path(folder))
        await run.shown.broker.start()
        await run.shown.manager.start()
        try:
            for robot in run.shown.robots:
                await robot.switch_on()
                await robot.join()
            orders = asyncio.create_task(run.give_orders())
            for _ in range(times):
                await asyncio.sleep(run.chance.uniform(0.5, 3.0))
                await kill(run)
            run.is_over = True
            await orders
            fleet = await run.until_done()
        finally:
            for robot in run.shown.robots:
                await robot.remove()
            await run.shown.manager.kill()
            await run.shown.broker.kill()
    by: dict[tuple[str, str], Counter[str]] = {}
    for robot in run.shown.robots:
        for question, _ in robot.worked:
            words = question.rstrip(".").split()
            by.setdefault((words[1], f"order {words[words.index('order') + 1]}"), Counter())[
                robot.serial
            ] += 1
    lost = sum(not by.get((word, order)) for order, word in itertools.product(run.given, ("load", "take")))
    two = sum(len(robots) > 1 for robots in by.values())
    again = sum(robots.total() - len(robots) for robots in by.values())
    late = sum(len(robot.late) for robot in run.shown.robots if isinstance(robot, DiscRobot))
    print(
        f"{name:15}{times:6}{len(run.given):8}{fleet['done']:6}{lost:6}{two:13}{again:25}{late:13}"
        f"{fleet['deadlocks']:11}",
        flush=True,
    )
    return not (lost or two or late) and (again == 0 or kill is Run.kill_robot)


def main() -> None:
    """A line for each kind; exit code 1 if something was lost, doubled or driven late."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(50))
    times = int(os.environ.get("KILLS", "50"))
    print(
        "what            times  orders  done  lost  done by two  again by the same robot  driven late  deadlocks"
    )
    kinds = (
        ("broker killed", Run.kill_broker),
        ("broker stopped", Run.stop_broker),
        ("manager killed", Run.kill_manager),
        ("robot killed", Run.kill_robot),
    )
    passed = [asyncio.run(one(name, kill, times)) for name, kill in kinds]
    sys.exit(0 if all(passed) else 1)


if __name__ == "__main__":
    main()
