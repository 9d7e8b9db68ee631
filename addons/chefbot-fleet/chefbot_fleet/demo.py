"""``make fleet``: a broker, the manager, six simulated robots and 60 orders; a robot is switched off, the others killed.

The broker, the manager and the robots' side of VDA 5050 are the real ones, in real time. The robots' bodies are not:
they are discs that drive straight from node to node in the simulator's office, so fast that all of it takes minutes.
"""

import asyncio
import contextlib
import itertools
import json
import logging
import math
import os
import shutil
import socket
import sys
import tempfile
import time
import urllib.request
from collections import Counter
from collections.abc import AsyncIterator, Callable
from functools import partial
from pathlib import Path
from typing import Any

import click
import structlog
import yaml
from chefbot_vda5050.agent import VERSION, Agent
from chefbot_vda5050.broker import Broker, BrokerParameters
from chefbot_vda5050.factsheet import factsheet
from chefbot_vda5050.messages import NodePosition
from chefbot_vda5050.robot import DriveFailed
from chefbot_vda5050.topics import Headers, RobotName
from chefbot_vda5050.vehicle import Facts, Limits
from msgspec.structs import replace

from chefbot_fleet.roadmap import Point
from chefbotd.sim.rooms import BUILDINGS
from chefbotd.sim.worlds import draw

OFFICE = BUILDINGS["office"]
MAP = Path(draw.__file__).with_name("office.yaml")
PLACES: dict[str, Point] = {
    **{f"room {k + 1}": (6 * k + 2.9, 1.6) for k in range(4)},
    **{f"room {k + 5}": (6 * k + 4.6, 8.0) for k in range(3)},
    "room 8": (21.5, 8.3),
}
STARTS: tuple[Point, ...] = ((1.5, 4.4), (4.5, 4.4), (8.5, 4.4), (12.0, 4.4), (15.5, 4.4), (20.0, 4.4))
RADIUS_M, STEP_S, WORK_S, GONE_S = 0.2, 0.05, 0.5, 60.0


class SimulatedBody:
    """Drives straight at ``speed_m_s``; people load and unload it after ``WORK_S``. ``worked``: what they were asked."""

    def __init__(self, start: Point, speed_m_s: float, map_id: str) -> None:
        self.facts = Facts(connected=True, localized=True, map_id=map_id, x_m=start[0], y_m=start[1])
        self.driven_m = 0.0
        self.worked: list[str] = []
        self._speed_m_s, self._drive = speed_m_s, 0
        self._changed: Callable[[], None] = lambda: None

    def listen(self, changed: Callable[[], None], go_on: Callable[[], None]) -> None:
        """Tell of every change."""
        self._changed = changed

    def _set(self, **changes: Any) -> None:
        self.facts = replace(self.facts, **changes)
        self._changed()

    async def drive_to(self, position: NodePosition) -> None:
        """In steps, until it is there or another drive begins."""
        self._drive += 1
        drive = self._drive
        while (left_m := self.facts.distance_m(position)) > 1e-6:
            await asyncio.sleep(STEP_S)
            if drive != self._drive:
                raise DriveFailed("another drive began")
            step_m = min(self._speed_m_s * STEP_S, left_m)
            self.driven_m += step_m
            x_m = self.facts.x_m + (position.x - self.facts.x_m) * step_m / left_m
            y_m = self.facts.y_m + (position.y - self.facts.y_m) * step_m / left_m
            self._set(x_m=x_m, y_m=y_m, linear_m_s=self._speed_m_s)
        heading_rad = self.facts.heading_rad if position.theta is None else position.theta
        self._set(linear_m_s=0.0, heading_rad=heading_rad)

    async def stop(self) -> None:
        """Stand."""
        self._drive += 1
        self._set(linear_m_s=0.0)

    async def resume(self) -> None:
        """Be ready again."""
        self._set(paused=False)

    async def unreachable(self, position: NodePosition) -> str:
        """Everything on the lanes can be reached."""
        return ""

    async def set_pose(self, position: NodePosition) -> None:
        """It knows where it is."""

    async def say(self, text: str) -> None:
        """Nobody listens."""

    async def ask(self, question: str, choices: list[str], timeout_s: float) -> str | None:
        """People do what they are asked for."""
        await asyncio.sleep(WORK_S)
        self.worked.append(question)
        return choices[0]


async def robot(serial: str, body: SimulatedBody, port: int) -> None:
    """A robot's side of VDA 5050, until cancelled."""
    name = RobotName("chefbot", serial)
    headers = Headers(name, VERSION)
    agent = Agent(
        name,
        body,
        lambda kind, data: broker.publish(kind, data),
        factsheet=partial(factsheet, None, carries_kg=2.0, seconds=0.0),
        limits=Limits(),
        visualization_s=0.0,
        headers=headers,
    )
    broker = Broker(
        BrokerParameters(port=port),
        name,
        headers,
        receive=lambda kind, data, retained: agent.receive(kind, data, retained=retained),
        online=agent.set_online,
    )
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(agent.run())
        tasks.create_task(broker.run())


class Program:
    """A program that listens on a port, and can be killed and started again."""

    def __init__(self, port: int, *words: str) -> None:
        self.port, self._words = port, words
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        """Run, and wait until it listens."""
        self._process = await asyncio.create_subprocess_exec(
            *self._words, stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL
        )
        async with asyncio.timeout(120.0):
            while not await _listens(self.port):  # noqa: ASYNC110 - it is another process's
                await asyncio.sleep(0.1)

    async def kill(self) -> None:
        """End it at once."""
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()


async def _listens(port: int) -> bool:
    try:
        _, writer = await asyncio.open_connection("127.0.0.1", port)
    except OSError:
        return False
    writer.close()
    return True


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


class Demonstration:
    """What happens, and what is counted meanwhile."""

    def __init__(self, folder: Path, page_port: int, count: int, speed_m_s: float) -> None:
        path = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
        if path is None:
            raise click.ClickException("mosquitto is not installed: apt install mosquitto")
        self._count, self._url, port = count, f"http://127.0.0.1:{page_port}", _free_port()
        (folder / "mosquitto.conf").write_text(
            f"listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n"
        )
        (folder / "places.yaml").write_text(yaml.safe_dump({name: list(at) for name, at in PLACES.items()}))
        (folder / "token").write_text("demonstration")
        self._broker = Program(port, path, "-c", str(folder / "mosquitto.conf"))
        self._manager = Program(
            page_port, sys.executable, "-m", "chefbot_fleet.demo", "manager",
            str(MAP), str(folder / "places.yaml"), f"127.0.0.1:{port}", "--robots", "6",
            "--database", str(folder / "fleet.db"), "--token-file", str(folder / "token"),
            "--port", str(page_port), "--speed-m-s", str(speed_m_s), "--lost-after-s", "40",
        )  # fmt: skip
        self.bodies = {f"r{k + 1}": SimulatedBody(at, speed_m_s, MAP.stem) for k, at in enumerate(STARTS)}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self.nearest_m, self.waited_s = math.inf, Counter[str]()

    async def run(self) -> bool:
        """All of it; whether every order was done once and nothing touched."""
        begun_s = time.monotonic()
        await self._broker.start()
        await self._manager.start()
        try:
            for serial in self.bodies:
                self._switch_on(serial)
            async with self._measured():
                await self._until(lambda fleet: len(fleet["robots"]) == len(self.bodies))
                await self._order()
                await self._until(lambda fleet: fleet["done"] >= self._count // 4)
                click.echo("Robot r3 is switched off for a minute, wherever it is.")
                self._tasks["r3"].cancel()
                back_s = time.monotonic() + GONE_S
                await self._until(lambda fleet: time.monotonic() >= back_s)
                click.echo("Robot r3 is switched on.")
                self._switch_on("r3")
                await self._until(lambda fleet: fleet["done"] >= self._count // 2)
                click.echo("The broker is killed, and started again after five seconds.")
                await self._broker.kill()
                await asyncio.sleep(5.0)
                await self._broker.start()
                await self._until(lambda fleet: fleet["done"] >= self._count * 3 // 4)
                click.echo("The manager is killed, and started again.")
                await self._manager.kill()
                await self._manager.start()
                await self._until(lambda fleet: fleet["done"] >= self._count)
            return self._report(time.monotonic() - begun_s)
        finally:
            for task in self._tasks.values():
                task.cancel()
            await asyncio.gather(*self._tasks.values(), return_exceptions=True)
            await self._manager.kill()
            await self._broker.kill()

    def _switch_on(self, serial: str) -> None:
        self._tasks[serial] = asyncio.create_task(robot(serial, self.bodies[serial], self._broker.port))

    async def _order(self) -> None:
        pairs = itertools.cycle(pair for pair in itertools.permutations(PLACES, 2))
        for number, (pick, drop) in zip(
            range(self._count), itertools.islice(pairs, 0, None, 5), strict=False
        ):
            body = json.dumps({"id": f"order {number + 1}", "pick": pick, "drop": drop}).encode()
            request = urllib.request.Request(  # noqa: S310 - our own port
                f"{self._url}/api/orders", body, {"Authorization": "Bearer demonstration"}
            )
            await asyncio.to_thread(self._fetch, request)

    @staticmethod
    def _fetch(request: Any) -> Any:
        with urllib.request.urlopen(request, timeout=30.0) as answer:  # noqa: S310 - our own port
            return json.loads(answer.read())

    async def _until(self, condition: Callable[[dict[str, Any]], bool]) -> None:
        shown = -1
        while True:
            with contextlib.suppress(OSError):
                fleet = await asyncio.to_thread(self._fetch, f"{self._url}/api/fleet")
                if fleet["done"] // 5 != shown:
                    shown = fleet["done"] // 5
                    self._show(fleet)
                for one in fleet["robots"]:
                    self.waited_s[one["name"]] += bool(one["waits"])
                if condition(fleet):
                    return
            await asyncio.sleep(1.0)

    def _show(self, fleet: dict[str, Any]) -> None:
        click.echo(f"\n{fleet['done']} of {self._count} orders done")
        for one in fleet["robots"]:
            click.echo(f"  {one['name']:12} {one['doing']:32} {'; '.join(one['waits'])}")

    @contextlib.asynccontextmanager
    async def _measured(self) -> AsyncIterator[None]:
        task = asyncio.create_task(self._measure())
        try:
            yield
        finally:
            task.cancel()

    async def _measure(self) -> None:
        """How near two discs come, from the bodies themselves."""
        while True:
            for one, other in itertools.combinations(self.bodies.values(), 2):
                apart_m = math.hypot(one.facts.x_m - other.facts.x_m, one.facts.y_m - other.facts.y_m)
                self.nearest_m = min(self.nearest_m, apart_m)
            await asyncio.sleep(STEP_S / 2)

    def _report(self, seconds: float) -> bool:
        done = Counter(question for body in self.bodies.values() for question in body.worked)
        loads = {f"order {number + 1}" for number in range(self._count)}
        kept = [name for name in loads for kind in ("load", "take") if not _times(done, kind, name)]
        twice = [name for name in loads for kind in ("load", "take") if _times(done, kind, name) > 1]
        click.echo(f"\n{'robot':12} {'driven (m)':>10} {'waited (s)':>10} {'loads and unloads':>18}")
        for serial, body in self.bodies.items():
            waited_s = self.waited_s[f"chefbot/{serial}"]
            click.echo(f"{serial:12} {body.driven_m:10.0f} {waited_s:10} {len(body.worked):18}")
        touched = self.nearest_m <= 2 * RADIUS_M
        click.echo(
            f"\n{self._count} orders in {seconds:.0f} s: {len(kept)} lost, {len(twice)} done twice; nearest two robots "
            f"{self.nearest_m:.2f} m from middle to middle: {'they touched' if touched else 'nothing touched'}"
        )
        return not (kept or twice or touched)


def _times(done: Counter[str], kind: str, name: str) -> int:
    return sum(count for question, count in done.items() if f" {kind} {name} " in f"{question} ")


@click.command()
@click.option("--orders", default=60, show_default=True)
@click.option("--speed-m-s", default=2.0, show_default=True, help="a ChefBot drives 0.3")
@click.option("--port", default=7340, show_default=True, help="of the page")
def demonstrate(orders: int, speed_m_s: float, port: int) -> None:
    """Exit code 1 if an order was lost or done twice, or robots touched."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.ERROR))
    click.echo(f"Six simulated robots in an office: http://127.0.0.1:{port} (token: demonstration)")
    with tempfile.TemporaryDirectory() as folder:
        passed = asyncio.run(Demonstration(Path(folder), port, orders, speed_m_s).run())
    sys.exit(0 if passed else 1)


if __name__ == "__main__":
    if sys.argv[1:2] == ["manager"]:
        from chefbot_fleet.cli import main

        sys.argv[1] = "run"
        main()
    demonstrate()
