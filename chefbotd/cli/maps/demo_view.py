"""Shows ``chefbotctl map demo``: the growing map, and the result at the end."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from chefbotd.cli.common.console import Printer
from chefbotd.cli.common.echo import writing
from chefbotd.cli.maps.against_truth import WallErrors
from chefbotd.cli.maps.demo import DemoResult
from chefbotd.cli.maps.draw import Mark, draw_map
from chefbotd.cli.maps.tour import Show, Tour
from chefbotd.core.geometry import Pose2D
from chefbotd.mapping.occupancy_grid import OccupancyGrid

STATUS_ROWS, ROWS_IN_A_FILE = 4, 45
ROBOT = "bold red"


class DemoView:
    """A picture that is drawn again on a terminal; lines in a file; nothing for a script."""

    def __init__(self, *, quiet: bool) -> None:
        self._console = Printer(quiet=quiet, highlight=False)
        self._told = ""

    def say(self, text: str) -> None:
        """Print a line."""
        with writing():
            self._console.print(text)

    @contextmanager
    def showing(self) -> Iterator[Show]:
        """Yield what shows each change."""
        if not self._console.redraws:
            yield self._say_what_is_new
            return
        with Live(console=self._console, auto_refresh=False, transient=True) as live:
            yield lambda tour: live.update(self._picture(tour), refresh=True)

    def _say_what_is_new(self, tour: Tour) -> None:
        doing = tour.doing.partition(" (")[0]
        if doing != self._told:
            self._told = doing
            self.say(f"{tour.doing}, {_standing(tour)}" if tour.state else tour.doing)

    def _picture(self, tour: Tour) -> Group:
        head = Text(f"{tour.doing} ... {_standing(tour)}" if tour.state else f"{tour.doing} ...", "bold")
        if tour.live.grid is None:
            return Group(head)
        return Group(head, self.drawn(tour.live.grid, tour.tracker.pose))

    def drawn(self, grid: OccupancyGrid, pose: Pose2D | None) -> Text:
        """The map with the robot in it, as large as the terminal is."""
        marks = [] if pose is None else [Mark(pose.x_m, pose.y_m, pose.heading_rad, style=ROBOT)]
        color = self._console.draws_color
        rows = max(1, self._console.height - STATUS_ROWS) if self._console.redraws else ROWS_IN_A_FILE
        return draw_map(grid, self._console.width, rows, marks, color=color)

    def show(self, result: DemoResult, errors: WallErrors, files: list[Path]) -> None:
        """The map, what it is worth, what it cost, and where it lies."""
        with writing():
            self._console.print(self.drawn(result.grid, result.pose))
            self._console.print(_table(result, errors))
            self._console.print("\n".join(str(file) for file in files), soft_wrap=True)


def _standing(tour: Tour) -> str:
    return f"{tour.keyframes} scans kept, {tour.loops} loops closed, fit {tour.fit:.2f}, {tour.state}"


def _table(result: DemoResult, errors: WallErrors) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_header=False)
    for row in rows(result, errors):
        table.add_row(*row)
    return table


def rows(result: DemoResult, errors: WallErrors) -> list[tuple[str, str]]:
    """What it is worth and what it cost, in words."""
    used, saved = result.processes, result.saved
    return [
        ("walls, off the true ones, median (p95)", f"{errors.median_m:.3f} m ({errors.p95_m:.3f} m)"),
        ("loops closed", str(saved.loops)),
        ("scans kept", f"{saved.keyframes} on {saved.path_m:.0f} m in {result.seconds:.0f} s"),
        ("control steps missed", f"{result.missed_steps} of {result.control_steps}"),
        ("daemon, with the simulator in it", _cost(used.daemon_cpu, used.daemon_mb)),
        ("worker, which makes the map", _cost(used.worker_cpu, used.worker_mb)),
    ]


def _cost(cpu: float | None, memory_mb: float | None) -> str:
    return f"{_number(cpu, '.2f')} of a core, {_number(memory_mb, '.0f')} MB"


def _number(value: float | None, form: str) -> str:
    return "?" if value is None or not math.isfinite(value) else format(value, form)


def as_json(result: DemoResult, errors: WallErrors, files: list[Path]) -> dict[str, Any]:
    """The same for a script."""
    used = result.processes
    return {
        "name": result.saved.name,
        "files": [str(file) for file in files],
        "walls": {"median_m": errors.median_m, "p95_m": errors.p95_m, "cells": errors.cells},
        "loops": result.saved.loops,
        "keyframes": result.saved.keyframes,
        "path_m": result.saved.path_m,
        "seconds": result.seconds,
        "control_steps": result.control_steps,
        "control_steps_missed": result.missed_steps,
        "worker_restarts": result.worker_restarts,
        "daemon": {"cpu": used.daemon_cpu, "rss_mb": used.daemon_mb},
        "worker": {"cpu": used.worker_cpu, "rss_mb": used.worker_mb},
    }
