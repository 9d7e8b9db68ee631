"""Simulated lidars, each on a pseudo-terminal of its own, as USB adapters beside the board's."""

import asyncio
import re
from collections.abc import Callable
from pathlib import Path

from chefbotd.clock import Clock
from chefbotd.sim.board import BoardRunner
from chefbotd.sim.lidar import LidarRunner
from chefbotd.sim.pty import PtyBoard
from chefbotd.sim.simulation import Simulation, build_lidars

PLAIN = re.compile(r"[\w.-]+")


class PluggedLidars:
    """The lidars of a simulated robot; ``devices`` has the path of each by its name: the board's, ``-`` and the name.

    A name that is not plain gives way to the lidar's number, from 0.
    """

    def __init__(
        self,
        simulation: Simulation,
        board: BoardRunner,
        clock: Clock,
        board_path: Path | None,
        seed: int | None = None,
    ) -> None:
        self._ptys: dict[str, PtyBoard] = {}
        self.devices: dict[str, Path] = {}
        self.runners: dict[str, LidarRunner] = {}
        for number, (name, lidar) in enumerate(build_lidars(simulation, seed).items()):
            if board_path is not None:
                told = name if PLAIN.fullmatch(name) else str(number)
                self.devices[name] = board_path.with_name(f"{board_path.name}-{told}")
            pty = self._ptys[name] = PtyBoard(self._receiver(name), self.devices.get(name))
            handover_s = simulation.parameters.lidar.handover_s
            self.runners[name] = LidarRunner(
                lidar, board, pty.send, clock, handover_s=handover_s, seed=number
            )

    def _receiver(self, name: str) -> Callable[[bytes], None]:
        return lambda data: self.runners[name].receive(data)

    def plug(self, name: str | None = None) -> dict[str, Path]:
        """Make the devices of all lidars, or of this one, and return their paths.

        Raises:
            KeyError: there is no lidar of this name.
            OSError: a device cannot be made.
        """
        names = self._ptys if name is None else (name,)
        return {each: self._ptys[each].plug() for each in names}

    def unplug(self, name: str | None = None) -> None:
        """Pull the cable of all lidars, or of this one. Raises ``KeyError`` if there is none of this name."""
        for each in self._ptys if name is None else (name,):
            self._ptys[each].unplug()

    async def run(self) -> None:
        """Simulate until cancelled."""
        async with asyncio.TaskGroup() as group:
            for runner in self.runners.values():
                group.create_task(runner.run())
