"""The manifest of a saved version of a map: its files with checksums, the time of saving, and its extent.

The manifest is written last. So a version is whole if its manifest is there and every file is as it says.
"""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field, ValidationError

from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters

MANIFEST = "manifest.json"
FORMAT: Literal[1] = 1
MAX_BYTES = 65_536

DESCRIPTION, IMAGE, CELLS, GRAPH = "map.yaml", "map.pgm", "cells.zlib", "slam.npz"
"""map_server's two; each cell's percentage, one signed byte each, the lowest row first, compressed; SLAM's state."""


class NotAManifest(ValueError):
    """The bytes are no manifest of this format; the text says why."""


class FileEntry(Parameters):
    """A file of a version."""

    bytes: int = Field(ge=0)
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")


class Extent(Parameters):
    """A grid without its cells: where its outer corner lies in ``map``, its cells' size, and how many there are."""

    resolution_m: float = Field(ge=0.001, le=10.0)  # as map_server's files are imported
    columns: int = Field(ge=1)
    rows: int = Field(ge=1)
    x_m: float
    y_m: float
    heading_rad: float

    @property
    def map_from_grid(self) -> Pose2D:
        """Where the outer corner of the first cell lies in ``map``."""
        return Pose2D(self.x_m, self.y_m, self.heading_rad)


class Manifest(Parameters):
    """One saved version; ``saved_at_s`` is in seconds since 1970 (UTC), ``source`` says where the map is from."""

    format: Literal[1] = FORMAT
    version: int = Field(ge=1)
    saved_at_s: float
    source: str
    extent: Extent
    files: Mapping[str, FileEntry]

    @property
    def can_go_on(self) -> bool:
        """Whether SLAM can go on with it."""
        return GRAPH in self.files

    @property
    def total_bytes(self) -> int:
        """What its files take."""
        return sum(entry.bytes for entry in self.files.values())

    def to_json(self) -> bytes:
        """The file's content."""
        return self.model_dump_json(indent=2).encode() + b"\n"


def parse_manifest(data: bytes) -> Manifest:
    """Read it; raises ``NotAManifest``."""
    if len(data) > MAX_BYTES:
        raise NotAManifest(f"a manifest has at most {MAX_BYTES} bytes")
    try:
        manifest = Manifest.model_validate_json(data)
    except ValidationError as error:
        problem: Any = error.errors()[0]
        where = ".".join(map(str, problem["loc"]))
        raise NotAManifest(f"{where + ': ' if where else ''}{problem['msg']}") from error
    for name in manifest.files:
        if "/" in name or name in ("", ".", "..", MANIFEST):
            raise NotAManifest(f"files: {name!a} is not a file name")
    return manifest
