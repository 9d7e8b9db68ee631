"""The messages from a depth camera's process to the daemon: the bearings once, then a scan for each image."""

import struct
from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from chefbotd.core.record import Record

HEADER = struct.Struct("<4sdI")
BEARINGS, SCAN = b"bear", b"scan"
MOST_BEAMS = 4096

Floats: TypeAlias = npt.NDArray[np.floating[Any]]


class BadMessage(ValueError):
    """Bytes that no depth camera's process writes."""


class DepthMessage(Record, frozen=True, eq=False):
    """``kind`` is ``BEARINGS`` (the stamp means nothing) or ``SCAN``, whose stamp is on the daemon's clock."""

    kind: bytes
    stamp_s: float
    values: npt.NDArray[np.float64]


def encode(kind: bytes, stamp_s: float, values: Floats) -> bytes:
    """The message's bytes; values are kept to single precision."""
    return HEADER.pack(kind, stamp_s, len(values)) + values.astype("<f4").tobytes()


class MessageReader:
    """Bytes to messages; how the bytes are chunked makes no difference."""

    def __init__(self) -> None:
        self._data = b""

    def feed_bytes(self, data: bytes) -> Iterator[DepthMessage]:
        """The messages that ``data`` completes.

        Raises:
            BadMessage: it is not a depth camera's process that writes.
        """
        self._data += data
        while len(self._data) >= HEADER.size:
            kind, stamp_s, count = HEADER.unpack_from(self._data)
            if kind not in (BEARINGS, SCAN) or count > MOST_BEAMS:
                raise BadMessage(f"expected a scan from the camera's process, got {self._data[:16]!r}")
            end = HEADER.size + 4 * count
            if len(self._data) < end:
                return
            values = np.frombuffer(self._data[HEADER.size : end], "<f4").astype(np.float64)
            self._data = self._data[end:]
            yield DepthMessage(kind, stamp_s, values)
