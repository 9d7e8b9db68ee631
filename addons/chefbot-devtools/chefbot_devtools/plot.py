"""The outcomes of a sweep as a picture: how many ended how, and how long those that were done took."""

import io
from collections import Counter
from pathlib import Path

from chefbot_devtools.job import Outcome
from chefbotd.cli.common.exits import Exit, ProgramError, require
from chefbotd.components.maps.cli.asking import write_file

COLOURS = {
    "done": "tab:green",
    "failed": "tab:red",
    "timed_out": "tab:orange",
    "crashed": "black",
    "hung": "tab:purple",
    "cancelled": "0.6",
}


def check_picture(path: Path, *, force: bool) -> None:
    """See that it can be drawn there, before a sweep is begun that may take hours.

    Raises:
        ProgramError: it cannot.
    """
    if path.suffix.lower() != ".png":
        raise ProgramError(Exit.USAGE, f"--plot {path}: expected a name that ends in .png")
    if path.exists() and not force:
        raise ProgramError(Exit.NOT_DONE, f"{path} exists already: --force replaces it")
    if not path.absolute().parent.is_dir():
        raise ProgramError(Exit.NOT_DONE, f"cannot write {path}: there is no such folder")
    require("plot", "matplotlib")


def draw(outcomes: list[Outcome], path: Path, title: str) -> None:
    """Draw it into a PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    worlds = list(dict.fromkeys(outcome.world for outcome in outcomes))
    figure = Figure(figsize=(10.0, 1.6 + 1.2 * len(worlds)), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=11)
    bars, times = figure.subplots(1, 2, sharey=True)
    for row, world in enumerate(worlds):
        of_world = [outcome for outcome in outcomes if outcome.world == world]
        counts, left = Counter(outcome.end for outcome in of_world), 0
        for end in [end for end in COLOURS if counts[end]]:
            bars.barh(row, counts[end], left=left, color=COLOURS[end], label=end)
            left += counts[end]
        for number, outcome in enumerate(of_world):
            if outcome.simulated_s is not None:
                height = row - 0.3 + 0.6 * number / max(1, len(of_world) - 1)
                times.plot(outcome.simulated_s, height, ".", color=COLOURS[outcome.end])
    labels = dict(zip(*reversed(bars.get_legend_handles_labels()), strict=True))
    bars.legend(labels.values(), labels.keys(), fontsize=8)
    bars.set_yticks(range(len(worlds)), worlds)
    bars.set_xlabel("runs")
    times.set_xlabel("simulated time, s")
    times.grid(alpha=0.3)
    data = io.BytesIO()
    figure.savefig(data, format="png")
    write_file(path, data.getvalue(), force=True)
