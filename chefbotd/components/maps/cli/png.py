"""Draws an occupancy grid as a PNG, with marks in it."""

import io
import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from chefbotd.components.maps.cli.draw import LIKELY_OCCUPIED, MapMark
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import UNKNOWN, OccupancyGrid

WISHED_PIXELS, MOST_PIXELS_A_CELL = 1000, 8
UNSEEN, WALL, MARK = (154, 160, 166), (20, 20, 24), (200, 30, 45)
ROBOT_M, DOT_M = 0.36, 0.1


def to_png(grid: OccupancyGrid, marks: Sequence[MapMark] = ()) -> bytes:
    """The grid's y axis up; small maps are enlarged. A mark with a heading is an arrow, any other a dot."""
    rows, columns = grid.percent.shape
    scale = max(1, min(MOST_PIXELS_A_CELL, WISHED_PIXELS // max(rows, columns)))
    pixels = _colors(grid).repeat(scale, axis=0).repeat(scale, axis=1)
    image = Image.fromarray(np.ascontiguousarray(np.flipud(pixels)), mode="RGB")
    canvas = ImageDraw.Draw(image)
    for mark in marks:
        if all(map(math.isfinite, (mark.x_m, mark.y_m, mark.heading_rad or 0.0))):
            _draw(canvas, grid, mark, scale)
    data = io.BytesIO()
    image.save(data, format="PNG")
    return data.getvalue()


def _colors(grid: OccupancyGrid) -> "np.ndarray[tuple[int, ...], np.dtype[np.uint8]]":
    """White where it is free, darker the likelier it is occupied, grey where nobody has looked."""
    shade = 255 - np.clip(grid.percent.astype(np.int16), 0, LIKELY_OCCUPIED) * 200 // LIKELY_OCCUPIED
    colors = np.repeat(shade[..., None], 3, axis=2).astype(np.uint8)
    colors[grid.percent == UNKNOWN] = UNSEEN
    colors[grid.percent >= LIKELY_OCCUPIED] = WALL
    return colors


def _draw(canvas: ImageDraw.ImageDraw, grid: OccupancyGrid, mark: MapMark, scale: int) -> None:
    pose = grid.map_from_grid.inverse().compose(Pose2D(mark.x_m, mark.y_m, mark.heading_rad or 0.0))
    per_m = scale / grid.resolution_m
    height = grid.percent.shape[0] * scale
    x, y = pose.x_m * per_m, height - pose.y_m * per_m
    if mark.heading_rad is None:
        radius = max(3.0, DOT_M * per_m)
        canvas.ellipse((x - radius, y - radius, x + radius, y + radius), fill=MARK)
    else:
        size = max(6.0, ROBOT_M / 2 * per_m)
        angles = (pose.heading_rad + turn for turn in (0.0, 2.5, -2.5))
        canvas.polygon([(x + size * math.cos(a), y - size * math.sin(a)) for a in angles], fill=MARK)
    if mark.label:
        canvas.text((x + 8, y - 7), mark.label, fill=MARK, font=ImageFont.load_default())
