"""What the demonstration shows: where the robot is while it drives, and a table of how that ended."""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Table

from chefbotd.cli.common import state_text
from chefbotd.cli.common.console import Printer
from chefbotd.cli.common.echo import echo, writing
from chefbotd.cli.common.latency import Latencies, percentile
from chefbotd.cli.drive.course import deviation
from chefbotd.cli.drive.course_driver import Progress, Report, Walk
from chefbotd.core.geometry import Pose2D

PERCENTS = (50, 95, 99)
KINDS: dict[str, Callable[[Latencies], list[float]]] = {
    "ping round trip": Latencies.round_trips_s,
    "odometry's age on arrival": Latencies.ages_s,
}


class View:
    """Shows a walk: live on a terminal, line by line in a file, and at the end only when it is to be JSON."""

    def __init__(self, as_json: bool, console: Console | None = None) -> None:
        self._as_json = as_json
        self._console = console or Printer(quiet=as_json, highlight=False)

    def say(self, text: str) -> None:
        """A line on the way."""
        with writing():
            self._console.print(text)

    @contextmanager
    def progress(self) -> Iterator[Report]:
        """Takes the moments of a walk."""
        if not self._console.is_terminal:
            yield self._line_by_leg()
            return
        told = TextColumn("{task.fields[pose]}")
        columns = (TextColumn("{task.description}"), BarColumn(20), TimeElapsedColumn(), told)
        with Bar(*columns, console=self._console, transient=True) as bar:
            task = bar.add_task("starting", total=1.0, pose="")
            yield lambda now: bar.update(
                task,
                description=now.name,
                completed=(now.leg + now.share) / now.legs,
                pose=state_text.pose(now.odometric),
            )

    def _line_by_leg(self) -> Report:
        begun: set[int] = set()

        def report(now: Progress) -> None:
            if now.leg not in begun:
                begun.add(now.leg)
                self.say(f"{now.name} of {now.legs // 2}: from {state_text.pose(now.odometric)}")

        return report

    def show(self, walk: Walk, problems: Sequence[str]) -> None:
        """How it ended."""
        if self._as_json:
            echo(json.dumps(as_json(walk, problems)))
            return
        with writing():
            self._console.print(poses(walk), latencies(walk.latencies), sep="")
        self.say(f"[{'red' if problems else 'green'}]{closing_words(walk)}[/]")


def as_json(walk: Walk, problems: Sequence[str]) -> dict[str, Any]:
    """The walk for a script; latencies in milliseconds."""
    late = {
        kind: {f"p{p}_ms": 1000 * percentile(of(walk.latencies), p) for p in PERCENTS}
        for kind, of in KINDS.items()
    }
    marks = [asdict(mark) for mark in walk.marks]
    return {"marks": marks, "seconds": walk.seconds, "latencies": late, "problems": list(problems)}


def poses(walk: Walk) -> Table:
    """Commanded, odometric and true pose at the end of each leg."""
    table = Table("x y m, °", box=box.SIMPLE_HEAD, pad_edge=False)
    for title in ("commanded", "odometric", "true"):
        table.add_column(title, justify="right")
    for mark in walk.marks:
        table.add_row(mark.name, *map(_brief, (mark.commanded, mark.odometric, mark.true)))
    return table


def _brief(pose: Pose2D | None) -> str:
    """Each number as wide as any of its kind, so that they stand below each other."""
    if pose is None:
        return "-"
    return f"{pose.x_m:+7.3f} {pose.y_m:+7.3f} {math.degrees(pose.heading_rad):+6.1f}"


def closing_words(walk: Walk) -> str:
    """How far odometry was in the end from where it was sent, and from the truth."""
    end = walk.marks[-1]
    words = f"{walk.seconds:.1f} s; closed within {deviation(end.commanded, end.odometric)}"
    return words if end.true is None else f"{words}, truth within {deviation(end.true, end.odometric)}"


def latencies(seen: Latencies) -> Table:
    """Percentiles in milliseconds."""
    table = Table("latency, ms", box=box.SIMPLE_HEAD, pad_edge=False)
    for title in (*(f"p{percent}" for percent in PERCENTS), "of"):
        table.add_column(title, justify="right")
    for kind, of in KINDS.items():
        values = of(seen)
        table.add_row(kind, *(f"{1000 * percentile(values, p):.2f}" for p in PERCENTS), str(len(values)))
    return table
