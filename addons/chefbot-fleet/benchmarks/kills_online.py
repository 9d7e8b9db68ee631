"""Kills at random moments, with a real broker: ``python addons/chefbot-fleet/benchmarks/kills_online.py`` (KILLS=50).

mosquitto, the manager and the robots' side of VDA 5050 are the real programs. While robots bring one order after the
other, one of these is killed so often, at random moments, and started again up to two seconds later. The broker is
stopped for 12 s (SIGSTOP) as often besides: what is on its way then arrives when it is too old.

In the first lines the robots' bodies are four discs, which note orders that they drove though those came later than they
take them. In the last two they are three simulated ChefBots, each with its daemon and worker: there "driven late" is not
looked at, but what touches is. People count what they loaded and unloaded, and where the robot truly stood.
Words choose lines by how they begin: ``kills_online.py daemon ChefBot``.
"""

import asyncio
import os
import random
import sys
import tempfile
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import structlog

from chefbotd.transport.ports import reserve_port

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from chefbot_fleet.demo.chefbots import ChefBot
from chefbot_fleet.demo.programs import shared_clock
from chefbot_fleet.demo.report import count_elsewhere, tasks
from chefbot_fleet.demo.story import PLACES, Demonstration, MakeRobot, pairs
from fleet_discs import SPEED_M_S, DiscRobot

WAITING, STOPPED_S, PACE = 5, 12.0, 100.0
UNTIL_DONE_S = 1800.0


class Bodies(NamedTuple):
    """What the robots are: how many, how fast the manager takes them to be, and how long nobody is killed."""

    make: MakeRobot
    robots: int
    speed_m_s: float
    pause_s: tuple[float, float]


DISCS = Bodies(DiscRobot, 4, SPEED_M_S, (0.5, 3.0))
CHEFBOTS = Bodies(ChefBot, 3, 0.2, (3.0, 20.0))


class Run:
    """Orders that never end, until they do; and what is killed meanwhile."""

    def __init__(self, folder: Path, bodies: Bodies) -> None:
        self.shown = Demonstration(
            folder, bodies.make, robots=bodies.robots, count=0, page_port=reserve_port(),
            speed_m_s=bodies.speed_m_s,
        )  # fmt: skip
        self.chance, self.is_over = random.Random(0), False

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
                        break
                await asyncio.sleep(0.2)
            if self.is_over:
                return

    async def until_done(self) -> dict[str, Any]:
        """When every order has ended, or after half an hour."""
        fleet: dict[str, Any] = {}
        with suppress(TimeoutError):
            async with asyncio.timeout(UNTIL_DONE_S):
                while not fleet or self.shown.count_ended(fleet) < len(self.shown.orders):
                    await asyncio.sleep(1.0)
                    with suppress(OSError):
                        fleet = await self.shown.fleet()
        return fleet

    async def kill_broker(self) -> None:
        """It is away for up to two seconds."""
        await self.shown.broker.kill()
        await self.a_while()
        await self.shown.broker.start()

    async def stop_broker(self) -> None:
        """It says nothing for a while; then all that was on its way arrives."""
        self.shown.broker.pause()
        await asyncio.sleep(STOPPED_S)
        self.shown.broker.go_on()

    async def kill_manager(self) -> None:
        """It has nothing but its database then."""
        await self.shown.manager.kill()
        await self.a_while()
        await self.shown.manager.start()

    async def kill_robot(self) -> None:
        """Its agent forgets its order; its body stays where it is. A ChefBot's daemon and worker are killed too."""
        robot = self.chance.choice(self.shown.robots)
        await robot.switch_off()
        await self.a_while()
        await robot.switch_on()
        await robot.join()

    async def kill_daemon(self) -> None:
        """The agent lives, and keeps its order; the robot stands, and finds out again where it is."""
        robot = self.chance.choice(self.shown.robots)
        if isinstance(robot, ChefBot):
            await robot.daemon.kill()
            await self.a_while()
            await robot.switch_on()

    async def a_while(self) -> None:
        """Up to two seconds."""
        await asyncio.sleep(self.chance.uniform(0.0, 2.0))


Kind = tuple[Callable[[Run], Awaitable[None]], Bodies]
KINDS: dict[str, Kind] = {
    "broker killed": (Run.kill_broker, DISCS),
    "broker stopped": (Run.stop_broker, DISCS),
    "manager killed": (Run.kill_manager, DISCS),
    "agent killed": (Run.kill_robot, DISCS),
    "daemon killed": (Run.kill_daemon, CHEFBOTS),
    "ChefBot killed": (Run.kill_robot, CHEFBOTS),
}


@asynccontextmanager
async def running(shown: Demonstration, folder: Path) -> AsyncIterator[None]:
    """All programs, until the end."""
    clock = shared_clock(folder, PACE)
    try:
        for program in (clock, shown.broker, shown.manager):
            await program.start()
        await asyncio.gather(*(robot.switch_on() for robot in shown.robots))
        for robot in shown.robots:
            await robot.join()
        yield
    finally:
        for robot in shown.robots:
            await robot.remove()
        for program in (shown.manager, shown.broker, clock):
            await program.kill()


async def one(name: str, kind: Kind, times: int) -> bool:
    """One kind of victim; whether nothing was lost, done by two robots or elsewhere, driven late, or touched."""
    kill, bodies = kind
    with tempfile.TemporaryDirectory() as temporary:
        run = Run(Path(temporary), bodies)
        shown = run.shown
        async with running(shown, Path(temporary)), shown.measuring():
            orders = asyncio.create_task(run.give_orders())
            for _ in range(times):
                await asyncio.sleep(run.chance.uniform(*bodies.pause_s))
                await kill(run)
            run.is_over = True
            await orders
            fleet = await run.until_done()
    worked = {robot.serial: robot.worked for robot in shown.robots}
    given, done = len(shown.orders), fleet.get("done", 0)
    by = [Counter(serial for serial, _ in work) for work in tasks(shown.orders, worked).values()]
    lost, two = sum(not robots for robots in by), sum(len(robots) > 1 for robots in by)
    again = sum(robots.total() - len(robots) for robots in by)
    elsewhere = count_elsewhere(shown.orders, worked, PLACES)
    late = [len(robot.late) for robot in shown.robots if isinstance(robot, DiscRobot)]
    touches = shown.measured.touches.total()
    print(
        f"{name:15}{times:6}{given:8}{done:6}{lost:6}{two:13}{again:25}{sum(late) if late else '-':>13}"
        f"{elsewhere:11}{touches:9}{fleet.get('deadlocks', 0):11}",
        flush=True,
    )
    for sentence in shown.measured.touched:
        print(sentence, flush=True)
    may_repeat = kill in (Run.kill_robot, Run.kill_daemon)
    return (
        done == given
        and not (lost or two or any(late) or elsewhere or touches)
        and (again == 0 or may_repeat)
    )


def main() -> None:
    """A line for each kind; exit code 1 if something was lost, doubled, done elsewhere or late, or touched."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(50))
    times, words = int(os.environ.get("KILLS", "50")), tuple(sys.argv[1:])
    print(
        "what            times  orders  done  lost  done by two  again by the same robot  driven late  elsewhere"
        "  touches  deadlocks"
    )
    passed = [
        asyncio.run(one(name, kind, times)) for name, kind in KINDS.items() if name.startswith(words or "")
    ]
    sys.exit(0 if passed and all(passed) else 1)


if __name__ == "__main__":
    main()
