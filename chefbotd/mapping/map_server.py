"""Reads and writes map files in the format of ROS's map_server: an image and a YAML file.

Source: the documentation of map_server (https://wiki.ros.org/map_server) and what Nav2's map_io computes. Both read what
is written here, and what either writes is read. Where they differ (a scale's middle, colours with transparency), this
follows Nav2.

Pillow (extra ``maps``) is imported where an image is read or a PNG is written; a PGM is written without it.
"""

import io
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import numpy as np
import numpy.typing as npt
import yaml
from pydantic import Field, ValidationError, model_validator

from chefbotd.core.bounded_yaml import load_first_document
from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters
from chefbotd.mapping.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

if TYPE_CHECKING:
    from PIL.Image import Image

Pixels: TypeAlias = npt.NDArray[np.uint8]
Floats: TypeAlias = npt.NDArray[np.float64]
BLACK, GREY, WHITE = 0, 205, 254
"""What map_server writes for occupied, unknown and free."""

OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
"""map_server's own. Grey 205 is 0.19608 occupied and stays unknown with 0.196; with Nav2's 0.25 it is free."""

MOST_PIXELS = 1 << 28
FINEST_M, COARSEST_M = 0.001, 10.0
"""A map's cells: finer ones than a lidar can tell apart, and coarser ones than any robot fits between, are mistakes."""
FARTHEST_M = 1e6


class ImageMode(StrEnum):
    """How a pixel becomes a cell: one of three values, a scale between the thresholds, or the percentage itself."""

    TRINARY = "trinary"
    SCALE = "scale"
    RAW = "raw"


class MapFileError(ValueError):
    """A map file that cannot be read; its text names the file, and is ready to be shown."""


Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]


class MapDescription(Parameters):
    """The YAML file. ``origin`` is the pose of the image's lower left corner: x, y in metres, yaw in radians."""

    image: str = Field(min_length=1)
    mode: ImageMode = ImageMode.TRINARY
    resolution: float = Field(ge=FINEST_M, le=COARSEST_M)
    origin: tuple[Coordinate, Coordinate, Coordinate]
    negate: Annotated[int, Field(ge=0, le=1)] = 0
    occupied_thresh: float = Field(OCCUPIED_THRESH, ge=0, le=1)
    free_thresh: float = Field(FREE_THRESH, ge=0, le=1)

    @model_validator(mode="after")
    def _thresholds_are_apart(self) -> "MapDescription":
        if self.free_thresh >= self.occupied_thresh:
            raise ValueError(
                f"free_thresh must be below occupied_thresh, {self.occupied_thresh}, got {self.free_thresh}"
            )
        return self


def parse_description(text: str, name: str) -> MapDescription:
    """The YAML text of the file called ``name``; keys that are nobody's are passed over, as map_server does.

    Raises:
        MapFileError: it is no YAML, or no map's.
    """
    try:
        values = load_first_document(text)  # as yaml-cpp reads it
    except ValueError as error:
        raise MapFileError(f"{name}: {error}") from error
    if not isinstance(values, dict):
        raise MapFileError(f"{name}: a map's YAML is keys and values, got {type(values).__name__}")
    fields = {key: value for key, value in values.items() if key in MapDescription.model_fields}
    try:
        return MapDescription.model_validate(fields)
    except ValidationError as error:
        raise MapFileError(f"{name}: {_explain(error)}") from error


def _explain(error: ValidationError) -> str:
    problems = [(".".join(map(str, problem["loc"])), problem) for problem in error.errors()]
    return "; ".join(f"{key + ': ' if key else ''}{p['msg']} (got {p['input']!r})" for key, p in problems)


def parse_image(data: bytes, description: MapDescription) -> OccupancyGrid:
    """The grid of an image file (PGM, PNG, and whatever else Pillow reads) as its description means it.

    Raises:
        MapFileError: it is no image, or one too large.
        ModuleNotFoundError: Pillow is not installed.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(data)) as image:
            if image.width * image.height > MOST_PIXELS:
                raise MapFileError(
                    f"{description.image}: {image.width} by {image.height} pixels are too many"
                )
            shade, opaque = _shades(image, average_alpha=description.mode is ImageMode.TRINARY)
    except (UnidentifiedImageError, OSError, Image.DecompressionBombError) as error:
        raise MapFileError(f"{description.image}: cannot be read as an image: {error}") from error
    percent = np.flipud(_percent(shade, opaque, description))
    x_m, y_m, yaw_rad = description.origin
    return OccupancyGrid(description.resolution, Pose2D(x_m, y_m, yaw_rad), np.ascontiguousarray(percent))


def _shades(image: "Image", *, average_alpha: bool) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Shades from 0 (black) to 255, the average of a pixel's channels, and where the image is opaque.

    Whether the average includes the transparency is the mode's: map_server's first one did, and stayed so.
    """
    if image.mode.startswith("I"):  # 16 bits
        return np.asarray(image, np.float64) / 257.0, np.ones((image.height, image.width), np.bool_)
    if image.mode == "L" and "transparency" not in image.info:  # all channels alike: an eighth of the memory
        return np.asarray(image, np.float64), np.ones((image.height, image.width), np.bool_)
    has_alpha = "A" in image.getbands() or "transparency" in image.info
    rgba = np.asarray(image.convert("RGBA"), np.float64)
    channels = rgba if has_alpha and average_alpha else rgba[..., :3]
    return channels.mean(axis=-1), rgba[..., 3] == 255


def _percent(
    shade: Floats, opaque: npt.NDArray[np.bool_], description: MapDescription
) -> npt.NDArray[np.int8]:
    """Cells from shades; a transparent pixel is unknown on a scale."""
    if description.mode is ImageMode.RAW:
        return np.where(np.rint(shade) <= OCCUPIED, np.rint(shade), UNKNOWN).astype(np.int8)
    occupancy = (shade if description.negate else 255 - shade) / 255
    free, occupied = description.free_thresh, description.occupied_thresh
    cells = np.full(shade.shape, UNKNOWN, np.int8)
    if description.mode is ImageMode.SCALE:
        cells = np.rint(np.clip((occupancy - free) / (occupied - free), 0, 1) * 100).astype(np.int8)
    cells[occupancy > occupied] = OCCUPIED
    cells[occupancy < free] = FREE
    if description.mode is ImageMode.SCALE:
        cells[~opaque] = UNKNOWN
    return cells


def to_image(grid: OccupancyGrid, mode: ImageMode = ImageMode.TRINARY) -> bytes:
    """The image file of a grid: PGM, but on a scale PNG, since only that can be transparent.

    Trinary keeps free (to 19 percent), occupied (from 65) and unknown, which is also what lies between; the others keep
    every percent.

    Raises:
        ModuleNotFoundError: a PNG is wanted, and Pillow is not installed.
    """
    percent = np.flipud(grid.percent)
    if mode is ImageMode.TRINARY:
        pixels = np.full(percent.shape, GREY, np.uint8)
        pixels[percent >= OCCUPIED_THRESH * 100] = BLACK
        pixels[(percent != UNKNOWN) & (percent <= FREE_THRESH * 100)] = WHITE
        return _pgm(pixels)
    if mode is ImageMode.RAW:
        return _pgm(np.where(percent == UNKNOWN, 255, percent).astype(np.uint8))
    shades = np.rint((100 - np.maximum(percent, 0).astype(np.float64)) * 2.55).astype(np.uint8)
    opaque = np.where(percent == UNKNOWN, 0, 255).astype(np.uint8)
    from PIL import Image

    image = Image.fromarray(np.stack([shades, opaque], axis=-1), mode="LA")
    data = io.BytesIO()
    image.save(data, format="PNG")
    return data.getvalue()


def to_description(grid: OccupancyGrid, image: str, mode: ImageMode = ImageMode.TRINARY) -> str:
    """The YAML text beside the image file called ``image``, whose name is relative to it."""
    origin = grid.map_from_grid
    description: dict[str, Any] = {
        "image": image,
        "mode": str(mode),
        "resolution": grid.resolution_m,
        "origin": [origin.x_m, origin.y_m, origin.heading_rad],
        "negate": 0,
        "occupied_thresh": 1.0 if mode is ImageMode.SCALE else OCCUPIED_THRESH,
        "free_thresh": 0.0 if mode is ImageMode.SCALE else FREE_THRESH,
    }
    return yaml.safe_dump(description, sort_keys=False, default_flow_style=None)


def _pgm(pixels: Pixels) -> bytes:
    rows, columns = pixels.shape
    return b"P5\n%d %d\n255\n%b" % (columns, rows, pixels.tobytes())
