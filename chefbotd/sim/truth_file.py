"""The truth about a simulated robot, for other processes: a file that is mapped into their memory."""

import mmap
import struct
from pathlib import Path

import numpy as np

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record
from chefbotd.sim.arrays import Vector

SIZE = 4096
COUNTER = struct.Struct("<Q")
HEAD = struct.Struct("<ddddQQ")
MOST_DISCS = 128


class Truth(Record, frozen=True):
    """A time, a pose, the discs around the robot (D x 3: x, y, radius), and how often the robot has begun to touch."""

    stamp_s: float
    world_from_base: Pose2D
    discs: Vector
    touches: int = 0


class TruthWriter:
    """Makes the file, or goes on with the one that is there, and keeps it up to date.

    The counter at its head is odd while it is being written.
    """

    def __init__(self, path: Path) -> None:
        """Raises ``OSError``: the file cannot be made."""
        if not path.exists() or path.stat().st_size != SIZE:
            path.write_bytes(bytes(SIZE))
        with path.open("r+b") as file:  # never shorter: others may have it in their memory
            self._memory = mmap.mmap(file.fileno(), SIZE)
        (count,) = COUNTER.unpack_from(self._memory)
        self._count = count + count % 2

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
            truth.touches,
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
        stamp_s, x_m, y_m, heading_rad, count, touches = HEAD.unpack_from(data, COUNTER.size)
        start = COUNTER.size + HEAD.size
        discs = np.frombuffer(data[start : start + 24 * count], "<f8").reshape(-1, 3)
        return Truth(stamp_s, Pose2D(x_m, y_m, heading_rad), discs, touches)

    def close(self) -> None:
        """Close the file."""
        self._memory.close()
