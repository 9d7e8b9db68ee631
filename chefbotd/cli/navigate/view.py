"""Draws a navigating robot again and again, and the table of the legs at the end."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from rich import box
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from chefbotd.cli.common.console import Printer
from chefbotd.cli.common.echo import writing
from chefbotd.cli.maps.draw import draw_map
from chefbotd.cli.navigate.scene import Leg, NavigationScene, Served, Show

STATUS_ROWS, ROWS_IN_A_FILE = 5, 45
COLUMNS = (
    "leg to",
    "length, over shortest",
    "time, over ideal",
    "closest approach",
    "true error at the goal",
)


class NavigationView:
    """A picture on a terminal; lines in a file; nothing for a script."""

    def __init__(self, *, quiet: bool) -> None:
        self._console = Printer(quiet=quiet, highlight=False)
        self._told, self._draw_again_s = "", 0.0

    @contextmanager
    def showing(self) -> Iterator[Show]:
        """Yield what shows each change."""
        if not self._console.redraws:
            yield self._say_what_is_new
            return
        with Live(console=self._console, auto_refresh=False, transient=True) as live:
            yield lambda scene: self._draw(live, scene)

    def _draw(self, live: Live, scene: NavigationScene) -> None:
        """Draw, but spend no more than a quarter of the time on it: the computer has a robot to simulate."""
        began_s = time.monotonic()
        if began_s < self._draw_again_s:
            return
        live.update(self.picture(scene), refresh=True)
        self._draw_again_s = began_s + 4 * (time.monotonic() - began_s)

    def _say_what_is_new(self, scene: NavigationScene) -> None:
        told = f"{scene.doing}: {scene.reason}" if scene.state != "idle" and scene.reason else scene.doing
        if told != self._told:
            self._told = told
            with writing():
                self._console.print(told)

    def picture(self, scene: NavigationScene) -> Group:
        """The map with all that is on it, and what the robot does."""
        head = Text(f"{scene.doing} ...", "bold")
        if scene.grid is None:
            return Group(head)
        return Group(head, Text(_standing(scene)), self.drawn(scene))

    def drawn(self, scene: NavigationScene) -> Text:
        """The map with all that is on it, as large as the terminal is."""
        if scene.grid is None:
            return Text()
        rows = max(1, self._console.height - STATUS_ROWS) if self._console.redraws else ROWS_IN_A_FILE
        return draw_map(scene.grid, self._console.width, rows, scene.marks(), color=self._console.draws_color)

    def show(self, served: Served) -> None:
        """What came of it."""
        with writing():
            self._console.print(found_text(served))
            self._console.print(_table(served.legs))


def _standing(scene: NavigationScene) -> str:
    left = "" if scene.distance_m is None else f", {scene.distance_m:.1f} m to go"
    return (
        f"{scene.localization}, {scene.state}{left}: {scene.reason}" if scene.reason else scene.localization
    )


def found_text(served: Served) -> str:
    """How it found out where it was."""
    found = served.found
    how = "turning where it stood" if found.turned else "without a motion"
    off = f"{100 * found.off_m:.1f} cm and {math.degrees(found.off_rad):.1f} degrees off the truth"
    return f"It found out where it was within {found.seconds:.1f} s, {how}: {off}."


def _table(legs: tuple[Leg, ...]) -> Table:
    table = Table(*COLUMNS, box=box.SIMPLE_HEAD, pad_edge=False)
    for leg in legs:
        table.add_row(*row(leg))
    return table


def row(leg: Leg) -> tuple[str, ...]:
    """A leg in words; one that failed says why."""
    if leg.failure is not None:
        return (leg.place, f"{leg.length_m:.1f} m", f"{leg.seconds:.0f} s", _cm(leg.closest_m), leg.failure)
    return (
        leg.place,
        f"{leg.length_m:.1f} m, {leg.length_m / leg.shortest_m:.2f}",
        f"{leg.seconds:.0f} s, {leg.seconds / leg.ideal_s:.2f}",
        _cm(leg.closest_m),
        f"{_cm(leg.off_m)}, {math.degrees(leg.off_rad):.1f} degrees",
    )


def _cm(metres: float) -> str:
    return f"{100 * metres:.1f} cm" if math.isfinite(metres) else "?"


def as_json(served: Served) -> dict[str, Any]:
    """The same for a script."""
    return {
        "found": asdict(served.found),
        "legs": [{name: _finite(value) for name, value in asdict(leg).items()} for leg in served.legs],
        "seconds": served.seconds,
        "failures": list(served.failures),
    }


def _finite(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value
