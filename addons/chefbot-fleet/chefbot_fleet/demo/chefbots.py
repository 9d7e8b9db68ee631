"""A simulated ChefBot of the demonstration: its daemon with its worker, its agent, and the people who load it.

All robots stand on one floor (``simulation.shared_floor``), so each is seen by the others' lidars, and keep to one
clock (``chefbotd.shared_clock``): on a computer that is too slow for all of them, all are slowed down alike.
"""

import asyncio
import contextlib
import sys
from pathlib import Path
from typing import Final

import click

from chefbot_fleet.demo.programs import Program
from chefbot_fleet.roadmap import Point
from chefbotd.client import ChefbotError, Client
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.simulation.rooms import BUILDINGS
from chefbotd.components.simulation.truth_file import Truth, TruthReader
from chefbotd.core.geometry import Pose2D
from chefbotd.transport.ports import reserve_port

BUILDING: Final = "office"
WORK_S: Final = 0.5
"""So long people take to load or unload a robot, in real time."""

AGAIN_S: Final = 1.0
SEARCHES_S: Final = 20.0
"""After so long somebody tells a robot where it stands."""


class ChefBot:
    """Its programs and its people.

    ``worked`` is what people were asked to load or unload, and where the robot truly stood then; ``told`` is how often
    people had to tell it where it is.
    """

    def __init__(self, serial: str, start: Point, folder: Path, broker_port: int) -> None:
        self.serial, self.folder, self.port = serial, folder / serial, reserve_port()
        self.worked: list[tuple[str, Point]] = []
        self.told = 0
        self._truth_path = folder / f"{serial}.truth"
        self._reader: TruthReader | None = None
        self._start = Pose2D(*start)
        self.folder.mkdir()
        save(MapStore(self.folder, 3), BUILDING, BUILDINGS[BUILDING].grid())
        self.daemon = Program(
            folder / f"{serial}.daemon.log", sys.executable, "-P", "-m", "chefbotd.cli.programs.chefbotd",
            "run", "--sim", "--config", "chefbot_lidar", "--sketch", "chefbot",
            port=self.port, environment=self._settings(folder),
        )  # fmt: skip
        self._agent = Program(
            folder / f"{serial}.agent.log", sys.executable, "-P", "-m", "chefbot_vda5050.cli", "run",
            f"127.0.0.1:{broker_port}", serial, "--daemon", f"127.0.0.1:{self.port}", "--carries-kg", "2",
        )  # fmt: skip
        self._people: asyncio.Task[None] | None = None
        self._is_localized = asyncio.Event()

    def _settings(self, folder: Path) -> dict[str, str]:
        values = {
            "robot.name": self.serial,
            "api.port": self.port,
            "maps.folder": self.folder,
            "recording.enabled": "false",
            "worker.niceness": 0,
            "sim.seed": sum(self.serial.encode()),
            "sim.shared_clock": folder / "clock",
            "sim.world.map_path": BUILDING,
            "sim.world.shared_truth": self._truth_path,
            "sim.world.start_x_m": self._start.x_m,
            "sim.world.start_y_m": self._start.y_m,
            "sim.world.start_heading_rad": self._start.heading_rad,
        }
        return {f"CHEFBOTD_{key.upper().replace('.', '__')}": str(value) for key, value in values.items()}

    async def switch_on(self) -> None:
        """Start its daemon, and wait until it knows where it is; the first time somebody tells it."""
        self._is_localized.clear()
        await self.daemon.start()
        if self._people is None:
            self._people = asyncio.create_task(self._attend())
        await self._is_localized.wait()

    async def join(self) -> None:
        """Start its agent, which puts it into the fleet."""
        await self._agent.start()

    async def switch_off(self) -> None:
        """Kill daemon, worker and agent; its body stays where it is."""
        await self._agent.kill()
        await self.daemon.kill()

    async def remove(self) -> None:
        """The end of it."""
        if self._people is not None:
            self._people.cancel()
            await asyncio.gather(self._people, return_exceptions=True)
        await self.switch_off()

    def truth(self) -> Truth | None:
        """Where it truly is; None: it has not been there yet."""
        if self._reader is None and self._truth_path.exists():
            with contextlib.suppress(ValueError):  # the file is being made
                self._reader = TruthReader(self._truth_path)
        return None if self._reader is None else self._reader.read()

    async def _attend(self) -> None:
        """People: they give the robot its map, tell it where it is if it cannot find out, and answer its questions."""
        while True:
            try:
                async with (
                    Client.connect("127.0.0.1", self.port, name="people") as client,
                    asyncio.TaskGroup() as tasks,
                ):
                    tasks.create_task(self._localize(client))
                    tasks.create_task(self._answer(client))
            except* (ChefbotError, OSError, TimeoutError):
                pass  # it is switched off, or not ready yet
            await asyncio.sleep(AGAIN_S)

    async def _localize(self, client: Client) -> None:
        if not self.told:
            await client.load_map(BUILDING)
            await self._tell(client)
        while not await _finds_itself(client):
            await self._tell(client)
        self._is_localized.set()

    async def _tell(self, client: Client) -> None:
        truth = self.truth()
        if truth is not None:
            pose = truth.world_from_base
            await client.set_pose(pose.x_m, pose.y_m, pose.heading_rad)
            if self.told:
                click.echo(f"Somebody tells {self.serial} where it stands.")
            self.told += 1

    async def _answer(self, client: Client) -> None:
        async with client.subscribe("agents", policy="ordered") as events:
            answered = set[int]()
            async for event in events:
                for question in event.data.questions:
                    if question.question_id not in answered:
                        answered.add(question.question_id)
                        await asyncio.sleep(WORK_S)
                        truth = self.truth()
                        place = Pose2D() if truth is None else truth.world_from_base
                        self.worked.append((question.question, (place.x_m, place.y_m)))
                        await client.answer_agent(question.question_id, question.choices[0])


async def _finds_itself(client: Client) -> bool:
    """Whether the robot finds out where it is, in the time that people leave it."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(SEARCHES_S), client.subscribe("localization") as events:
            async for event in events:
                if event.data.state == "localized":
                    return True
    return False
