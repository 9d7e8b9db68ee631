"""The truth about a simulated robot, for other processes: a file that is mapped into their memory."""

import mmap
import struct
from pathlib import Path

import numpy as np

from chefbotd.components.simulation.arrays import Vector
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record

COUNTER = struct.Struct("<Q")
HEAD = struct.Struct("<ddddQQ")
MOST_DISCS = 128
SLOT_SIZE = HEAD.size + 24 * MOST_DISCS
SIZE = COUNTER.size + 2 * SLOT_SIZE


class Truth(Record, frozen=True):
    """A time, a pose, the discs around the robot (D x 3: x, y, radius), and how often the robot has begun to touch."""

    stamp_s: float
    world_from_base: Pose2D
    discs: Vector
    touches: int = 0


class TruthWriter:
    """Makes the file, or goes on with the one that is there, and keeps it up to date.

    The counter at its head says how many truths have been written. They go to its two slots by turns, and the counter
    is moved last: so a writer that is killed while it writes leaves the truth before.
    """

    def __init__(self, path: Path) -> None:
        """Raises ``OSError``: the file cannot be made."""
        if not path.exists() or path.stat().st_size != SIZE:
            path.write_bytes(bytes(SIZE))
        with path.open("r+b") as file:  # never shorter: others may have it in their memory
            self._memory = mmap.mmap(file.fileno(), SIZE)
        (self._count,) = COUNTER.unpack_from(self._memory)

    def write(self, truth: Truth) -> None:
        """Replace the truth in the file. Of more discs than fit, the first are kept."""
        discs, pose, start = truth.discs[:MOST_DISCS], truth.world_from_base, _slot(self._count + 1)
        HEAD.pack_into(
            self._memory,
            start,
            truth.stamp_s,
            pose.x_m,
            pose.y_m,
            pose.heading_rad,
            len(discs),
            truth.touches,
        )
        start += HEAD.size
        self._memory[start : start + 24 * len(discs)] = discs.astype("<f8").tobytes()
        self._count += 1
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
        """The newest truth; None while there is none."""
        count, data = 0, b""
        while (newest := COUNTER.unpack_from(self._memory)[0]) != count:  # else written over meanwhile
            count = newest
            data = self._memory[_slot(count) : _slot(count) + SLOT_SIZE]
        if not count:
            return None
        stamp_s, x_m, y_m, heading_rad, discs, touches = HEAD.unpack_from(data)
        rows = np.frombuffer(data, "<f8", 3 * discs, HEAD.size).reshape(-1, 3)
        return Truth(stamp_s, Pose2D(x_m, y_m, heading_rad), rows, touches)

    def close(self) -> None:
        """Close the file."""
        self._memory.close()


def _slot(count: int) -> int:
    """Where the truth of this number begins."""
    return COUNTER.size + count % 2 * SLOT_SIZE
