"""The simulated robot inside the daemon's own process: board and lidars still on real ptys, its true pose on the bus."""

import asyncio
import mmap
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from chefbotd.clock import Clock
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record
from chefbotd.sim.arrays import Vector
from chefbotd.sim.board import BoardRunner
from chefbotd.sim.pty import PluggedLidars, PtyBoard
from chefbotd.sim.simulation import Simulation, board_sender, build_launchpad

SIZE = 4096
COUNTER = struct.Struct("<Q")
HEAD = struct.Struct("<ddddQ")
MOST_DISCS = 128


class Truth(Record, frozen=True):
    """A time, a pose, and the discs around the robot (D x 3: x, y, radius)."""

    stamp_s: float
    world_from_base: Pose2D
    discs: Vector


class TruthWriter:
    """Makes the file and keeps it up to date. The counter at its head is odd while it is being written."""

    def __init__(self, path: Path) -> None:
        """Raises ``OSError``: the file cannot be made."""
        path.write_bytes(bytes(SIZE))
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), SIZE)
        self._count = 0

    def write(self, truth: Truth) -> None:
        """Replace the truth in the file. Of more discs than fit, the first are kept."""
        discs, pose = truth.discs[:MOST_DISCS], truth.world_from_base
        COUNTER.pack_into(self._memory, 0, self._count + 1)
        HEAD.pack_into(
            self._memory,
            COUNTER.size,
            truth.stamp_s,
            pose.x_m,
            pose.y_m,
            pose.heading_rad,
            len(discs),
        )
        start = COUNTER.size + HEAD.size
        self._memory[start : start + 24 * len(discs)] = discs.astype("<f8").tobytes()
        self._count += 2
        COUNTER.pack_into(self._memory, 0, self._count)

    def close(self) -> None:
        """Close the file."""
        self._memory.close()


class TruthReader:
    """Reads what another process writes."""

    def __init__(self, path: Path) -> None:
        """Raises ``OSError``: there is no such file."""
        with path.open("rb") as file:
            self._memory = mmap.mmap(file.fileno(), SIZE, access=mmap.ACCESS_READ)

    def read(self) -> Truth | None:
        """The newest truth; None while there is none, or while it is being written."""
        data = self._memory[:]
        (before,), (after,) = COUNTER.unpack_from(data), COUNTER.unpack_from(self._memory)
        if before == 0 or before % 2 or after != before:
            return None
        stamp_s, x_m, y_m, heading_rad, count = HEAD.unpack_from(data, COUNTER.size)
        start = COUNTER.size + HEAD.size
        discs = np.frombuffer(data[start : start + 24 * count], "<f8").reshape(-1, 3)
        return Truth(stamp_s, Pose2D(x_m, y_m, heading_rad), discs)

    def close(self) -> None:
        """Close the file."""
        self._memory.close()


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
            while True:
                truth = self._runner.truth(self._clock.now_s())
                publish(truth)
                if self._truth_file is not None:
                    discs = self._runner.crowd.discs
                    self._truth_file.write(Truth(truth.stamp_s, truth.world_from_base, discs))
                await asyncio.sleep(TRUTH_PERIOD_S)
