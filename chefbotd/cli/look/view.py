"""Draws a state as a table, and a scan as text: from above, the robot in the middle, two by four dots a character."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.live import Live
from rich.text import Text

from chefbotd.cli.common import output
from chefbotd.cli.common.console import Printer

if TYPE_CHECKING:
    from chefbotd.client.models import ScanData


Show = Callable[[Mapping[str, Any] | None, str], None]


@contextmanager
def board() -> Iterator[Show]:
    """Shows a state, and what keeps it from being newer."""
    with Live(console=Printer(highlight=False), auto_refresh=False) as live:
        yield lambda state, trouble: live.update(draw_state(state, trouble), refresh=True)


def draw_state(state: Mapping[str, Any] | None, trouble: str) -> RenderableType:
    """The table of the state, and a line below it."""
    below = Text(trouble, style="bold red") if trouble else Text("Ctrl-C ends this.", style="dim")
    return Group(below) if state is None else Group(output.status_table(state), below)


BRAILLE = 0x2800
DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""A braille character's bits, by the dot's row and column (Unicode 11, block U+2800)."""

ROBOT = "▲"
REACHES_M = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0)
SHOWN_SHARE = 0.9
"""The picture reaches as far as so many of the readings do, unless it is told how far."""


def points_m(scan: "ScanData") -> list[tuple[float, float]]:
    """Where the readings are, in the robot's frame: ahead and to the left."""
    points = []
    for bearing_rad, range_mm in zip(_bearings(scan), scan.range_mm, strict=True):
        if range_mm > 0:
            angle, range_m = bearing_rad + scan.yaw_rad, range_mm / 1000
            points.append((scan.x_m + range_m * math.cos(angle), scan.y_m + range_m * math.sin(angle)))
    return points


def _bearings(scan: "ScanData") -> Iterator[float]:
    if scan.bearing_mrad is not None:
        yield from (bearing / 1000 for bearing in scan.bearing_mrad)
        return
    step_rad = scan.bearing_step_rad or 0.0
    yield from (scan.bearing_start_rad + step_rad * index for index in range(len(scan.range_mm)))


def reach_of(points: Sequence[tuple[float, float]]) -> float:
    """How far a picture of these points is to reach, in metres."""
    if not points:
        return REACHES_M[1]
    ranges_m = sorted(max(abs(x), abs(y)) for x, y in points)
    wanted_m = ranges_m[int(SHOWN_SHARE * (len(ranges_m) - 1))]
    return next((reach_m for reach_m in REACHES_M if reach_m >= wanted_m), REACHES_M[-1])


def draw_scan(points: Sequence[tuple[float, float]], columns: int, rows: int, reach_m: float) -> Text:
    """The points in ``columns`` by ``rows`` characters, the nearer side of the picture ``reach_m`` from the robot."""
    columns, rows = max(columns, 3), max(rows, 3)
    wide, high = 2 * columns, 4 * rows
    dot_m = 2 * reach_m / min(wide, high)
    cells = [[0] * columns for _ in range(rows)]
    for x_m, y_m in points:
        right, down = math.floor(wide / 2 - y_m / dot_m), math.floor(high / 2 - x_m / dot_m)
        if 0 <= right < wide and 0 <= down < high:
            cells[down // 4][right // 2] |= DOTS[down % 4][right % 2]
    lines = ["".join(chr(BRAILLE + bits) if bits else " " for bits in line) for line in cells]
    middle, centre = rows // 2, columns // 2
    lines[middle] = lines[middle][:centre] + ROBOT + lines[middle][centre + 1 :]
    text = Text("\n".join(line.rstrip() for line in lines), no_wrap=True)
    text.highlight_regex(ROBOT, "bold green")
    return text


def caption(scan: "ScanData", points: Sequence[tuple[float, float]], reach_m: float) -> str:
    """What the picture does not say: which lidar, how many readings, the nearest of them, and the scale."""
    text = (
        f"{scan.lidar}: {len(points)} of {len(scan.range_mm)} beams, {1000 * scan.duration_s:.0f} ms a turn"
    )
    if points:
        x_m, y_m = min(points, key=lambda point: math.hypot(*point))
        degrees = math.degrees(math.atan2(y_m, x_m))
        text += f"; nearest {math.hypot(x_m, y_m):.2f} m from the base, {_side(degrees)}"
    return f"{text}; {reach_m:g} m to the edge"


def _side(degrees: float) -> str:
    if abs(degrees) < 1:
        return "ahead"
    if abs(degrees) > 179:
        return "behind"
    return f"{abs(degrees):.0f}° to the {'left' if degrees > 0 else 'right'}"
