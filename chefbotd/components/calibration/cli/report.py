"""Prints the results of a calibration, and draws their plots."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from chefbotd.cli.common import output
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError, extra, require
from chefbotd.components.calibration.events import Estimate, Plot, Status, StepResult
from chefbotd.core.printable import plain

WIDTHS = (10, 12, 9, 12, 6)
INCHES, DOTS_PER_INCH = (9.0, 5.0), 110


def show_result(result: StepResult) -> None:
    """Print a step's outcome, its parameters and what its model leaves unexplained."""
    echo(
        plain(
            f"\n{result.step}: {result.status.replace('_', ' ')}"
            + (f". {result.reason}" if result.reason else "")
        )
    )
    if result.estimates:
        show_estimates(result.estimates)
    for left in result.residuals:
        echo(
            f"{left.name}: {left.before:.3g} before, {left.after:.3g} after, {left.unit} ({left.count} measurements)"
        )


def show_estimates(estimates: Iterable[Estimate], true: Mapping[str, float] | None = None) -> None:
    """Print parameters in groups by their section; with the ``true`` values how many sigmas each is off."""
    heads = ("true", "off") if true else ()
    echo(_line("", "before", "after", "sigma", *heads))
    section = ""
    for estimate in estimates:
        *path, name = estimate.key.split(".")
        if section != (section := ".".join(path)):
            echo(f"[{section}]")
        cells = (f"{estimate.before:.5g}", f"{estimate.after:.5g}", f"{estimate.sigma:.2g}")
        against = _against(true.get(estimate.key), estimate) if true else ()
        echo(f"{_line('  ' + name, *cells, *against)}  {estimate.unit}".rstrip())


def _line(name: str, *cells: str) -> str:
    return f"{name:<25}" + "".join(f"{cell:>{width}}" for cell, width in zip(cells, WIDTHS, strict=False))


def _against(true: float | None, estimate: Estimate) -> tuple[str, ...]:
    if true is None:
        return "", ""
    return f"{true:.5g}", f"{(estimate.after - true) / estimate.sigma:+.1f}" if estimate.sigma else ""


def finish(
    context: CommandContext,
    results: Sequence[StepResult],
    applied: object = None,
    refused: Exception | None = None,
) -> None:
    """Print everything as JSON where that is wanted. ``refused`` is what ended it before all steps were done.

    Raises:
        ProgramError: a step has not passed.
    """
    if context.as_json:
        output.say(True, {"results": list(results), "applied": applied}, "")
    if refused is not None:
        raise refused
    if failed := [
        f"{result.step}: {result.status.replace('_', ' ')}" for result in results if not _has_passed(result)
    ]:
        raise ProgramError(Exit.NOT_DONE, ", ".join(failed))


def _has_passed(result: StepResult) -> bool:
    return result.status == Status.PASSED


def require_plots(out: Path | None) -> None:
    """Raise ``ProgramError`` before anything moves, if the plots cannot be drawn."""
    if out is not None:
        require("plot", "matplotlib")


def draw_plots(results: Iterable[StepResult], out: Path | None) -> list[Path]:
    """Draw every plot as ``STEP-TITLE.png`` into the folder; without a folder nothing is drawn.

    Raises:
        ProgramError: matplotlib is missing, or the folder cannot be written.
    """
    if out is None:
        return []
    pictures = []
    try:
        out.mkdir(parents=True, exist_ok=True)
        for result in results:
            for plot in result.plots:
                name = re.sub(r"[^a-z0-9]+", "-", plot.title.lower()).strip("-")
                pictures.append(out / f"{result.step}-{name}.png")
                _draw(plot, pictures[-1])
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"cannot write {error.filename}: {error.strerror}") from error
    return pictures


def _draw(plot: Plot, path: Path) -> None:
    with extra("plot", "matplotlib"):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    figure = Figure(figsize=INCHES, dpi=DOTS_PER_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    axis: Any = figure.subplots()
    for series in plot.series:
        style = {"linestyle": "none", "marker": ".", "markersize": 4} if series.points else {"linewidth": 1.2}
        axis.plot(series.x, series.y, label=series.name, **style)
    axis.set_title(plot.title, loc="left")
    axis.set_xlabel(plot.x_label)
    axis.set_ylabel(plot.y_label)
    axis.grid(alpha=0.3)
    if plot.equal:
        axis.set_aspect("equal", adjustable="datalim")
    if len(plot.series) > 1:
        axis.legend(fontsize=8)
    figure.savefig(path)
