"""The walls of the map as a picture, for the page: whoever corrects lanes has to see them."""

import struct
import zlib

import numpy as np
import numpy.typing as npt

from chefbotd.core.occupancy_grid import OCCUPIED, UNKNOWN, OccupancyGrid
from chefbotd.core.record import Record

GREY, SHADED = 128, 60
"""Walls are grey, which is seen on white and on black; what nobody has looked at is shaded, and free space clear."""


class Walls(Record, frozen=True):
    """A PNG, and where it lies on the map: its lower left corner, width and height in metres."""

    png: bytes
    left_m: float
    bottom_m: float
    width_m: float
    height_m: float


def walls_of(grid: OccupancyGrid) -> Walls | None:
    """The picture of this map; None where the map is turned, as the page's is not."""
    if grid.map_from_grid.heading_rad:
        return None
    alpha = np.zeros(grid.percent.shape, np.uint8)
    alpha[grid.percent == UNKNOWN] = SHADED
    alpha[grid.percent == OCCUPIED] = 255
    pixels = np.stack((np.full_like(alpha, GREY), alpha), axis=2)[::-1]
    rows, columns = grid.percent.shape
    return Walls(
        _png(pixels),
        grid.map_from_grid.x_m,
        grid.map_from_grid.y_m,
        columns * grid.resolution_m,
        rows * grid.resolution_m,
    )


def _png(pixels: npt.NDArray[np.uint8]) -> bytes:
    """Rows of grey and alpha (H x W x 2), by the PNG specification, chapters 11 and 9 (filter 0)."""
    height, width, _ = pixels.shape
    lines = np.zeros((height, 1 + 2 * width), np.uint8)
    lines[:, 1:] = pixels.reshape(height, -1)
    header = struct.pack(">IIBBBBB", width, height, 8, 4, 0, 0, 0)
    chunks = (b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes(), 9)), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
