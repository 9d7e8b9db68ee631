"""A measured figure beside its target and the classic chain's, and how they are shown."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rich.table import Table


@dataclass(frozen=True, slots=True)
class Figure:
    """A number with its unit; ``target`` is the most that it may be (None: it is only told).

    ``classic`` is what the classic ROS chain was measured at, as text, and ``noise`` how much of a core other
    programs used meanwhile, filled in by the runner.
    """

    name: str
    value: float
    unit: str
    target: float | None = None
    classic: str = ""
    noise: float = 0.0

    @property
    def reached(self) -> bool | None:
        """Whether the target is; None when there is none."""
        return None if self.target is None else self.value <= self.target


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a benchmark found: figures, remarks for the reader, and faults, which are wrong and not merely slow."""

    figures: tuple[Figure, ...]
    remarks: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


def percentile(values: Sequence[float], percent: float) -> float:
    """The smallest value that at least ``percent`` of the values do not exceed (nearest rank).

    Raises:
        ValueError: there are no values.
    """
    if not values:
        raise ValueError("no values, so no percentile")
    return sorted(values)[max(math.ceil(percent / 100 * len(values)), 1) - 1]


def latencies(
    name: str,
    seconds: Sequence[float],
    targets_ms: Mapping[float, float | None],
    classic: Mapping[float, str] | None = None,
) -> tuple[Figure, ...]:
    """The percentiles that have a target, and the worst, in milliseconds."""
    told = classic or {}
    ranked = (
        Figure(f"{name} p{p:g}", percentile(seconds, p) * 1e3, "ms", target, told.get(p, ""))
        for p, target in targets_ms.items()
    )
    return (*ranked, Figure(f"{name} worst of {len(seconds)}", max(seconds) * 1e3, "ms"))


VERDICTS = {True: "[green]yes", False: "[red]no", None: ""}
NOISY_CORES = 0.3


def table(outcomes: dict[str, Outcome]) -> Table:
    """All figures; ``~`` marks one that was taken while other programs kept the machine busy."""
    shown = Table(title="chefbotd, measured", title_style="bold")
    for heading in ("benchmark", "figure"):
        shown.add_column(heading)
    for heading in ("measured", "target", "reached", "classic chain"):
        shown.add_column(heading, justify="right")
    for benchmark, outcome in outcomes.items():
        for figure in outcome.figures:
            shown.add_row(benchmark, *_cells(figure))
            benchmark = ""
        shown.add_section()
    return shown


def _cells(figure: Figure) -> tuple[str, ...]:
    noisy = "~" if figure.noise > NOISY_CORES else ""
    target = "" if figure.target is None else f"<= {figure.target:g}"
    value = f"{noisy}{figure.value:.4g} {figure.unit}"
    return figure.name, value, target, VERDICTS[figure.reached], figure.classic
