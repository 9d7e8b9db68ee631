"""What a map costs in memory, and whether its cells can be meant: by its extent alone, so that the daemon can ask first.

Measured with localization, navigation and a search of the whole map together, in buildings with a room each 5 to 30 m
(Linux, CPython 3.11, numpy 2; the most that was resident, of which 104 to 110 MB are a worker without a map):

| map | measured | the estimate |
|---|---:|---:|
| 30 by 20 m in cells of 5 cm | 136 MB | 178 MB |
| 25 by 25 m, 2.5 cm | 183 MB | 239 MB |
| 75 by 50 m, 5 cm | 247 MB | 322 MB |
| 100 by 100 m, 10 cm | 294 MB | 370 MB |
| 100 by 100 m, 5 cm | 459 MB | 610 MB |
| 147 by 100 m, 5 cm | 622 MB | 826 MB |
| 300 by 300 m, 50 cm | 1122 MB | 1439 MB |

That is 59 bytes a cell and 11 kB a square metre; the estimate adds a quarter to a third. A plan that finds no way, which
is the dearest, took 25 bytes a cell more for a moment (100 by 100 m, 10 cm). The bounds of a search take most of the
square metres' share; they grow with the headings that it tries.
"""

from typing import Final

from chefbotd.components.maps.storage.manifest import Extent

WORKER_MB: Final = 150.0
"""A worker with all skills and without a map takes 104 to 110 MB; the rest is for scans and what it tells."""

BYTES_A_CELL: Final = 80.0
"""Costs, distances and what was seen take some 60 bytes for a cell of the map; plans, for a moment, the rest."""

BYTES_A_SQUARE_METRE: Final = 14_000.0
"""Likelihoods and surfaces on cells of 5 and 10 cm, and a search's bounds: they do not grow with the map's own cells."""

COARSEST_MEANT_M: Final = 0.25
"""A door of 0.9 m is not four cells wide in a coarser map: more likely a digit of the resolution is wrong."""

LONGEST_MEANT_M: Final = 1000.0
"""A floor of more than a kilometre: more likely the same."""


def needed_memory_mb(extent: Extent) -> float:
    """What the worker takes at most with this map, in MB."""
    cells = float(extent.rows * extent.columns)
    return WORKER_MB + (BYTES_A_CELL * cells + BYTES_A_SQUARE_METRE * cells * extent.resolution_m**2) / 1e6


def explain_size(extent: Extent) -> str:
    """The map's size in words."""
    width_m, height_m = extent.columns * extent.resolution_m, extent.rows * extent.resolution_m
    cells = f"{extent.columns} by {extent.rows} cells of {extent.resolution_m:g} m"
    return f"{width_m:.0f} by {height_m:.0f} m in {cells}"


def why_too_large(extent: Extent, most_mb: float) -> str:
    """Why a worker that may take ``most_mb`` cannot use this map, and what to do; empty where it can."""
    needed_mb = needed_memory_mb(extent)
    if needed_mb <= most_mb:
        return ""
    return (
        f"{explain_size(extent)} need about {needed_mb:.0f} MB, and the worker may take {most_mb:g}: crop the "
        "map to what the robot needs, make it again with larger cells, or allow more if the computer has it"
    )


def why_doubtful(extent: Extent) -> str:
    """Why this resolution was probably not meant; empty where it may be."""
    longest_m = max(extent.rows, extent.columns) * extent.resolution_m
    if extent.resolution_m <= COARSEST_MEANT_M and longest_m <= LONGEST_MEANT_M:
        return ""
    return f"a resolution of {extent.resolution_m:g} m makes it {explain_size(extent)}"
