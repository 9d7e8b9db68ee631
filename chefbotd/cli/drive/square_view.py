"""Shows the progress of ``chefbotctl square``, and a table of its result."""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from msgspec import to_builtins
from rich import box
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Table

from chefbotd.cli.common import state_text
from chefbotd.cli.common.console import Printer
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo, writing
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.course import deviation, square
from chefbotd.cli.drive.course_driver import (
    CourseDriver,
    CourseProgress,
    CourseResult,
    Latencies,
    Report,
    percentile,
    problems,
)
from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import Client
from chefbotd.core.geometry import Pose2D

PERCENTS = (50, 95, 99)
KINDS: dict[str, Callable[[Latencies], list[float]]] = {
    "ping round trip": Latencies.round_trips_s,
    "odometry's age on arrival": Latencies.ages_s,
}


class SquareView:
    """Shows a drive: live on a terminal, line by line in a file, and only the result as JSON."""

    def __init__(self, as_json: bool, console: Console | None = None) -> None:
        self._as_json = as_json
        self._console = console or Printer(quiet=as_json, highlight=False)

    def say(self, text: str) -> None:
        """Print a line."""
        with writing():
            self._console.print(text)

    @contextmanager
    def progress(self) -> Iterator[Report]:
        """Yield the function that shows progress."""
        if not self._console.is_terminal:
            yield self._line_by_leg()
            return
        pose_column = TextColumn("{task.fields[pose]}")
        columns = (TextColumn("{task.description}"), BarColumn(20), TimeElapsedColumn(), pose_column)
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

        def report(now: CourseProgress) -> None:
            if now.leg not in begun:
                begun.add(now.leg)
                self.say(f"{now.name} of {now.legs // 2}: from {state_text.pose(now.odometric)}")

        return report

    def show(self, result: CourseResult, problems: Sequence[str]) -> None:
        """Show the result."""
        if self._as_json:
            echo(json.dumps(as_json(result, problems)))
            return
        with writing():
            self._console.print()
            self._console.print(poses(result), latencies(result.latencies), sep="")
        self.say(f"[{'red' if problems else 'green'}]{closing_words(result)}[/]")


def as_json(result: CourseResult, problems: Sequence[str]) -> dict[str, Any]:
    """The result for a script; latencies in milliseconds."""
    late = {
        kind: {f"p{p}_ms": 1000 * percentile(of(result.latencies), p) for p in PERCENTS}
        for kind, of in KINDS.items()
    }
    marks = [to_builtins(mark) for mark in result.marks]
    return {"marks": marks, "seconds": result.seconds, "latencies": late, "problems": list(problems)}


def poses(result: CourseResult) -> Table:
    """Commanded, odometric and true pose at the end of each leg: 80 columns, as a terminal has them."""
    table = Table("x y m, °", box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, padding=(0, 1, 0, 0))
    for title in ("commanded", "odometric", "true"):
        table.add_column(title, justify="right")
    for mark in result.marks:
        table.add_row(mark.name, *map(_brief, (mark.commanded, mark.odometric, mark.true)))
    return table


def _brief(pose: Pose2D | None) -> str:
    """A pose in columns of fixed width."""
    if pose is None:
        return "-"
    return f"{pose.x_m:+7.3f} {pose.y_m:+7.3f} {math.degrees(pose.heading_rad):+6.1f}"


def closing_words(result: CourseResult) -> str:
    """The final distance of odometry from the goal, and from the true pose."""
    end = result.marks[-1]
    words = f"{result.seconds:.1f} s; closed within {deviation(end.commanded, end.odometric)}"
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


def drive_square(
    context: CommandContext,
    side_m: float,
    *,
    simulated: bool,
    robot: Path | None = None,
    physics: str | None = None,
) -> None:
    """Drive the square on the daemon of ``context``, or on a new simulation of ``robot``; show and judge the result.

    Raises:
        ProgramError: the robot did not reach the goal.
    """
    view = SquareView(context.as_json)

    async def drive_course(client: Client) -> CourseResult:
        with view.progress() as report:
            return await CourseDriver(client, report).drive_course(square(side_m))

    async def drive_simulation() -> CourseResult:
        environment = {} if physics is None else {"CHEFBOTD_SIM__PHYSICS": physics}
        view.say("starting chefbotd on a simulated robot ...")
        async with simulated_daemon(robot or "chefbot", environment) as (address, _):
            view.say(f"driving a {side_m:g} m square through {address}")
            return await CommandContext(address).with_client(drive_course)

    result = context.run(drive_simulation() if simulated else context.with_client(drive_course))
    deviations = problems(result)
    view.show(result, deviations)
    if deviations:
        raise ProgramError(Exit.NOT_DONE, "; ".join(deviations))
