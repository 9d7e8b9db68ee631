"""Reads and writes map files in the format of ROS's map_server: an image and a YAML file.

Source: the documentation of map_server (https://wiki.ros.org/map_server) and what Nav2's map_io computes. Both read what
is written here, and what either writes is read. Where they differ (a scale's middle, colours with transparency), this
follows Nav2.

Pillow (extra ``maps``) is imported where an image is read or a PNG is written; a PGM is written without it.
"""

import codecs
import io
import math
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
import yaml
from pydantic import Field, ValidationError

from chefbotd.components.maps.outlines import Coordinate
from chefbotd.core.bounded_yaml import load_first_document
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from chefbotd.core.parameters import Parameters

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

LFS_POINTER: Final = b"version https://git-lfs.github.com/spec/"
"""How a file begins that Git put in the place of one in its large file storage (git-lfs, docs/spec.md)."""


class ImageMode(StrEnum):
    """How a pixel becomes a cell: one of three values, a scale between the thresholds, or the percentage itself."""

    TRINARY = "trinary"
    SCALE = "scale"
    RAW = "raw"


class MapFileError(ValueError):
    """A map file that cannot be read; its text names the file, and is ready to be shown."""


class MapDescription(Parameters):
    """The YAML file. ``origin`` is the pose of the image's lower left corner: x, y in metres, yaw in radians.

    ``notes`` say what was read otherwise than it is written. The thresholds may be equal, or in the wrong order:
    map_server asks first whether a pixel is occupied, then whether it is free.
    """

    image: str = Field(min_length=1)
    mode: ImageMode = ImageMode.TRINARY
    resolution: float = Field(ge=FINEST_M, le=COARSEST_M)
    origin: tuple[Coordinate, Coordinate, Coordinate]
    negate: Annotated[int, Field(ge=0, le=1)] = 0
    occupied_thresh: float = Field(OCCUPIED_THRESH, ge=0, le=1)
    free_thresh: float = Field(FREE_THRESH, ge=0, le=1)
    notes: tuple[str, ...] = ()


def parse_description(content: bytes | str, name: str) -> MapDescription:
    """The content of the YAML file called ``name``; keys that are nobody's are passed over, as map_server does.

    Raises:
        MapFileError: it is no YAML, or no map's.
    """
    text = content if isinstance(content, str) else _decode_text(content, name)
    try:
        values = _values(text)
    except ValueError as error:
        raise MapFileError(f"{name}: {error}") from error
    if not isinstance(values, dict):
        raise MapFileError(f"{name}: a map's YAML is keys and values, got {type(values).__name__}")
    fields, notes = _as_map_server_reads(values)
    try:
        return MapDescription.model_validate({**fields, "notes": notes})
    except ValidationError as error:
        raise MapFileError(f"{name}: {_explain(error)}") from error


def _decode_text(content: bytes, name: str) -> str:
    """The text; what is not UTF-8, such as an umlaut in a comment, was most likely written on Windows."""
    require_no_pointer(content, name)
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", "replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", "replace")


def _values(text: str) -> Any:
    """The values of the YAML; yaml-cpp takes a tab between them for a space, which PyYAML does not."""
    try:
        return load_first_document(text)
    except ValueError:
        if "\t" not in text:
            raise
        return load_first_document(text.replace("\t", " "))


def _as_map_server_reads(values: dict[Any, Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The values of our fields: a mode in whatever case, any number but 0 to negate, and no turn in place of NaN."""
    fields = {k: value for k, value in values.items() if k in MapDescription.model_fields and k != "notes"}
    mode, negate, origin = fields.get("mode"), fields.get("negate"), fields.get("origin")
    if isinstance(mode, str):
        fields["mode"] = mode.lower()
    if isinstance(negate, int):
        fields["negate"] = int(negate != 0)
    if not isinstance(origin, list) or len(origin) != 3 or not _is_nan(origin[2]):
        return fields, ()
    # What map_saver makes of a quaternion of zeros, which some programs for maps send: no turn is meant.
    fields["origin"] = [origin[0], origin[1], 0.0]
    return fields, (f"the origin's yaw is {origin[2]}: read as 0",)


def _is_nan(value: object) -> bool:
    try:
        return isinstance(value, str | float) and math.isnan(float(value))
    except ValueError:
        return False


def require_no_pointer(content: bytes, name: str) -> None:
    """Raises ``MapFileError`` where the file is the pointer that Git LFS leaves in place of it."""
    if content.startswith(LFS_POINTER):
        raise MapFileError(
            f"{name}: is only a pointer of Git LFS, not the file itself: run 'git lfs pull' where it was cloned"
        )


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

    require_no_pointer(data, description.image)
    try:
        with Image.open(io.BytesIO(data)) as image:
            if image.width * image.height > MOST_PIXELS:
                raise MapFileError(
                    f"{description.image}: {image.width} by {image.height} pixels are too many"
                )
            shade, opaque = _shades(image, average_alpha=description.mode is ImageMode.TRINARY)
    except MapFileError:
        raise
    except (UnidentifiedImageError, OSError, ValueError, Image.DecompressionBombError) as error:
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
    if description.mode is ImageMode.SCALE and occupied > free:  # else there is nothing between them
        cells = np.rint(np.clip((occupancy - free) / (occupied - free), 0, 1) * 100).astype(np.int8)
    cells[occupancy < free] = FREE
    cells[occupancy > occupied] = OCCUPIED
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
