"""The simulated robot inside the daemon's own process: board and lidars still on real ptys, its true pose on the bus."""

import asyncio
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from chefbotd.clock import Clock
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.pty import PluggedLidars, PtyBoard
from chefbotd.components.simulation.shared_floor import floor_of, left_where_it_stands
from chefbotd.components.simulation.simulation import Simulation, board_sender, build_launchpad
from chefbotd.components.simulation.truth_file import Truth, TruthWriter

TRUTH_PERIOD_S = 0.02


class EmbeddedBoard:
    """A board and its robot's lidars, plugged in while the context lasts; ``run`` simulates them.

    ``device`` is the board's path, ``pty`` its cable, ``lidar_devices`` has each lidar's path by its name.
    """

    def __init__(self, simulation: Simulation, clock: Clock) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="chefbotd-")
        self._truth_file: TruthWriter | None = None
        self.device = Path(self._folder.name) / "board"
        self._clock = clock
        simulation = left_where_it_stands(simulation)
        self._floor = floor_of(simulation)
        self.pty = PtyBoard(lambda data: self._runner.receive(data), self.device)
        send = board_sender(simulation, self.pty.send, lambda: self.pty.host)
        self._runner = BoardRunner(build_launchpad(simulation), send, clock)
        self._lidars = PluggedLidars(simulation, self._runner, clock, self.device)
        self.lidar_devices = self._lidars.devices

    def __enter__(self) -> Self:
        self.pty.plug()
        self._lidars.plug()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._lidars.unplug()
        self.pty.unplug()
        if self._truth_file is not None:
            self._truth_file.close()
        self._folder.cleanup()

    def share_truth(self) -> Path:
        """Keep the truth in a file for other processes, and return its path (read by ``truth_file.TruthReader``)."""
        path = Path(self._folder.name) / "truth"
        self._truth_file = TruthWriter(path)
        return path

    async def run(self, publish: Callable[[object], None]) -> None:
        """Simulate until cancelled, publishing ``TruthSimulated`` 50 times a second."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._runner.run())
            group.create_task(self._lidars.run())
            if self._floor is not None:
                group.create_task(self._floor.run(self._runner, self._clock))
            while True:
                truth = self._runner.truth(self._clock.now_s())
                publish(truth)
                if self._truth_file is not None:
                    discs = self._runner.crowd.discs
                    self._truth_file.write(Truth(truth.stamp_s, truth.world_from_base, discs))
                await asyncio.sleep(TRUTH_PERIOD_S)
