"""What happens in the demonstration, and what is counted meanwhile."""

import asyncio
import contextlib
import itertools
import json
import math
import sys
import urllib.request
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any, Final, Protocol

import click
import yaml

from chefbot_fleet.demo.programs import Program, mosquitto
from chefbot_fleet.demo.report import Measured, report
from chefbot_fleet.roadmap import Point
from chefbotd.components.simulation.truth_file import Truth
from chefbotd.components.simulation.worlds import draw

MAP: Final = Path(draw.__file__).with_name("office.yaml")
PLACES: Final[dict[str, Point]] = {
    **{f"room {k + 1}": (6 * k + 2.9, 1.6) for k in range(4)},
    **{f"room {k + 5}": (6 * k + 4.6, 8.0) for k in range(3)},
    "room 8": (21.5, 8.3),
}
STARTS: Final[tuple[Point, ...]] = ((1.5, 4.4), (4.5, 4.4), (8.5, 4.4), (12.0, 4.4), (15.5, 4.4), (20.0, 4.4))
SPEED_M_S: Final = 0.2
"""What a ChefBot makes on the average, with its stops and turns."""

GONE_S: Final = 60.0
ENDED: Final = frozenset({"done", "failed", "cancelled"})
GIVES_UP_S: Final = 1800.0
"""When no order has ended for so long, in real time, none is waited for any more."""

MEASURES_EVERY_S: Final = 0.05
TOKEN: Final = "demonstration"  # noqa: S105 - it is told to everybody


class Robot(Protocol):
    """A robot that can be switched on and off."""

    serial: str
    worked: list[tuple[str, Point]]

    async def switch_on(self) -> None:
        """Start it, and wait until it knows where it is."""

    async def join(self) -> None:
        """Put it into the fleet."""

    async def switch_off(self) -> None:
        """Kill its programs; its body stays where it is."""

    async def remove(self) -> None:
        """The end of it."""

    def truth(self) -> Truth | None:
        """Where it truly is, by the robots' clock."""


class _GivenUp(Exception):
    """Nothing more is to be expected; the text says why."""


MakeRobot = Callable[[str, Point, Path, int], Robot]
"""By its serial number, its start, a folder for its files, and the broker's port."""


class Demonstration:
    """A broker, a manager and so many robots, who bring ``count`` orders whatever is killed."""

    def __init__(
        self, folder: Path, make: MakeRobot, *, robots: int, count: int, page_port: int,
        speed_m_s: float = SPEED_M_S, gone_s: float = GONE_S, gives_up_s: float = GIVES_UP_S,
    ) -> None:  # fmt: skip
        self._count, self._gone_s, self._url = count, gone_s, f"http://127.0.0.1:{page_port}"
        self._gives_up_s, self._ended, self._ended_s = gives_up_s, 0, math.inf
        (folder / "places.yaml").write_text(yaml.safe_dump({name: list(at) for name, at in PLACES.items()}))
        (folder / "token").write_text(TOKEN)
        self.broker = mosquitto(folder)
        port = self.broker.port or 0
        self.manager = Program(
            folder / "manager.log", sys.executable, "-P", "-m", "chefbot_fleet.cli", "run",
            str(MAP), str(folder / "places.yaml"), f"127.0.0.1:{port}", "--robots", str(robots),
            "--database", str(folder / "fleet.db"), "--token-file", str(folder / "token"),
            "--port", str(page_port), "--speed-m-s", str(speed_m_s), "--lost-after-s", "40",
            port=page_port,
        )  # fmt: skip
        self.robots = [make(f"r{k + 1}", STARTS[k], folder, port) for k in range(robots)]
        self.measured = Measured([robot.serial for robot in self.robots])
        self.orders: dict[str, tuple[str, str]] = {}

    async def run(self) -> bool:
        """All of it; whether every order was done once, where it was to be done, and nothing touched."""
        await self.broker.start()
        await self.manager.start()
        try:
            await asyncio.gather(*[robot.switch_on() for robot in self.robots])
            click.echo(
                "All robots know where they are."
            )  # before the first one drives: nobody knows of the others yet
            await asyncio.gather(*[robot.join() for robot in self.robots])
            async with self.measuring():
                try:
                    await self._until(lambda fleet: len(fleet["robots"]) == len(self.robots))
                    click.echo("All robots are in the fleet.")
                    await self._order()
                    await self._disturb()
                    await self._until_ended(self._count)
                except _GivenUp as why:
                    click.echo(f"\nGiven up: {why}")
            worked = {one.serial: one.worked for one in self.robots}
            return report(self.measured, self.orders, worked, PLACES)
        finally:
            await asyncio.gather(*[robot.remove() for robot in self.robots])
            await self.manager.kill()
            await self.broker.kill()

    async def _disturb(self) -> None:
        """Switch a robot off and on, kill the broker, kill the manager."""
        gone = self.robots[len(self.robots) // 2]
        await self._until_ended(self._share(1))
        click.echo(f"Robot {gone.serial} is switched off for {self._gone_s:g} s, wherever it is.")
        await gone.switch_off()
        back_s = self.measured.seconds + self._gone_s
        await self._until(lambda fleet: self.measured.seconds >= back_s)
        click.echo(f"Robot {gone.serial} is switched on.")
        try:
            async with asyncio.timeout(self._gives_up_s):
                await gone.switch_on()
        except TimeoutError:
            raise _GivenUp(f"{gone.serial} does not know where it is after {self._gives_up_s:g} s") from None
        await gone.join()
        await self._until_ended(self._share(2))
        click.echo("The broker is killed, and started again after five seconds.")
        await self.broker.kill()
        await asyncio.sleep(5.0)
        await self.broker.start()
        await self._until_ended(self._share(3))
        click.echo("The manager is killed, and started again.")
        await self.manager.kill()
        await self.manager.start()

    def _share(self, quarters: int) -> int:
        """So many quarters of all orders, and one at least."""
        return max(self._count * quarters // 4, 1)

    async def _order(self) -> None:
        for number, (pick, drop) in zip(range(self._count), pairs(), strict=False):
            await self.order(f"order {number + 1}", pick, drop)

    async def order(self, name: str, pick: str, drop: str) -> None:
        """Give an order to the manager. Raises ``OSError`` if it is not there."""
        body = json.dumps({"id": name, "pick": pick, "drop": drop}).encode()
        request = urllib.request.Request(  # noqa: S310 - our own port
            f"{self._url}/api/orders", body, {"Authorization": f"Bearer {TOKEN}"}
        )
        await asyncio.to_thread(_fetch, request)
        self.orders[name] = pick, drop

    async def fleet(self) -> dict[str, Any]:
        """What the manager's page shows. Raises ``OSError`` if it is not there."""
        shown: dict[str, Any] = await asyncio.to_thread(_fetch, f"{self._url}/api/fleet")
        return shown

    async def _until_ended(self, count: int) -> None:
        await self._until(lambda fleet: self.count_ended(fleet) >= count)

    def count_ended(self, fleet: dict[str, Any]) -> int:
        """So many of the orders that were given are done, or have failed or been cancelled."""
        return len(self.orders) - sum(order["stage"] not in ENDED for order in fleet["orders"])

    async def _until(self, condition: Callable[[dict[str, Any]], bool]) -> None:
        """Raises ``_GivenUp`` when no order has ended for too long."""
        shown, loop = -1, asyncio.get_running_loop()
        self._ended_s = min(self._ended_s, loop.time())
        while True:
            with contextlib.suppress(OSError):
                fleet = await self.fleet()
                if fleet["done"] // 5 != shown:
                    shown = fleet["done"] // 5
                    self._show(fleet)
                if (count := self.count_ended(fleet)) != self._ended:
                    self._ended, self._ended_s = count, loop.time()
                self.measured.waits({one["name"].split("/")[-1] for one in fleet["robots"] if one["waits"]})
                if condition(fleet):
                    return
            if loop.time() - self._ended_s > self._gives_up_s:
                raise _GivenUp(f"no order has ended for {self._gives_up_s:g} s")
            await asyncio.sleep(1.0)

    def _show(self, fleet: dict[str, Any]) -> None:
        click.echo(f"\n{fleet['done']} of {self._count} orders done after {self.measured.seconds:.0f} s")
        for one in fleet["robots"]:
            click.echo(f"  {one['name']:12} {one['doing']:32} {'; '.join(one['waits'])}")

    @contextlib.asynccontextmanager
    async def measuring(self) -> AsyncIterator[None]:
        """Measure the robots' true poses and touches meanwhile."""

        async def measure() -> None:
            while True:
                self.measured.take({robot.serial: robot.truth() for robot in self.robots})
                await asyncio.sleep(MEASURES_EVERY_S)

        task = asyncio.create_task(measure())
        try:
            yield
        finally:
            task.cancel()


def pairs() -> Iterator[tuple[str, str]]:
    """Where orders begin and end, again and again."""
    return itertools.cycle(itertools.islice(itertools.permutations(PLACES, 2), 0, None, 5))


def _fetch(request: Any) -> Any:
    with urllib.request.urlopen(request, timeout=30.0) as answer:  # noqa: S310 - our own port
        return json.loads(answer.read())
