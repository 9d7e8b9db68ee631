"""The registry of the daemon's figures. Each part adds its own.

A part keeps its counters as plain attributes and registers a function that reads them. Counting then costs nothing but
the addition, and whoever collects the figures (the topic ``stats``, a metrics page) knows no part by name.
"""

import re
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import StrEnum
from typing import Any, TypeAlias

from msgspec import Struct


class Histogram:
    """How often a value was at most each of ``bounds``, which rise, or above the last; and the ``total`` of all values.

    ``counts`` is not cumulative, and has one more member than ``bounds``.
    """

    __slots__ = ("bounds", "counts", "total")

    def __init__(self, bounds: Sequence[float]) -> None:
        if list(bounds) != sorted(set(bounds)) or not bounds:
            raise ValueError(f"the bounds of a histogram rise, got {list(bounds)}")
        self.bounds, self.counts, self.total = tuple(bounds), [0] * (len(bounds) + 1), 0.0

    def observe(self, value: float) -> None:
        """Count one value."""
        self.counts[bisect_left(self.bounds, value)] += 1
        self.total += value

    def by_bound(self) -> dict[str, int]:
        """The counts by their upper bound in decimal figures, the last of which is ``inf``; not cumulative."""
        return dict(zip([*map(str, self.bounds), "inf"], self.counts, strict=True))


Figure: TypeAlias = int | float | Mapping[str, int] | None
"""A figure as it is collected."""
Value: TypeAlias = Figure | Histogram
"""What a part lets be read."""

NAME = re.compile(r"[a-z][a-z0-9_]*")


class Kind(StrEnum):
    """A counter only grows while the daemon runs; a gauge goes up and down; a histogram counts values by their size."""

    COUNTER = "counter"
    GAUGE = "gauge"
    HISTOGRAM = "histogram"


class Metric(Struct, frozen=True):
    """One figure: ``name`` in snake case with its unit, ``help`` in a sentence, ``read`` gives its value now.

    ``label`` names what the keys of a figure with several values are (``reason``); None for a figure with one value.
    ``annotation`` is the type of the value, for whoever makes a schema of it.
    """

    name: str
    help: str
    kind: Kind
    annotation: Any
    read: Callable[[], Value]
    label: str | None = None


class Metrics:
    """The registry, in the order in which the figures were added."""

    def __init__(self) -> None:
        self._metrics: dict[str, Metric] = {}

    def __iter__(self) -> Iterator[Metric]:
        return iter(self._metrics.values())

    def counter(self, name: str, help: str, read: Callable[[], int]) -> None:
        """Add a number that only grows.

        Raises:
            ValueError: the name is taken, or is not in snake case; as for the others.
        """
        self._add_metric(Metric(name, help, Kind.COUNTER, int, read))

    def counters(self, name: str, help: str, label: str, read: Callable[[], Mapping[str, int]]) -> None:
        """Add numbers that only grow, by what ``label`` says."""
        self._add_metric(Metric(name, help, Kind.COUNTER, dict[str, int], read, label))

    def gauge(self, name: str, help: str, read: Callable[[], float]) -> None:
        """Add a number that goes up and down."""
        self._add_metric(Metric(name, help, Kind.GAUGE, float, read))

    def optional_gauge(self, name: str, help: str, read: Callable[[], float | None]) -> None:
        """Add a number that goes up and down, and is None as long as it is not known."""
        self._add_metric(Metric(name, help, Kind.GAUGE, float | None, read))

    def histogram(self, name: str, help: str, histogram: Histogram) -> None:
        """Add a count of values by their size; collected as a mapping from each upper bound to its count."""
        self._add_metric(Metric(name, help, Kind.HISTOGRAM, dict[str, int], lambda: histogram, "at_most"))

    def collect(self) -> dict[str, Figure]:
        """Every figure by its name, as it is now; mappings are copies."""
        return {metric.name: _copy_value(metric.read()) for metric in self}

    def _add_metric(self, metric: Metric) -> None:
        if metric.name in self._metrics:
            raise ValueError(f"there is a metric named {metric.name!r} already")
        if not NAME.fullmatch(metric.name):
            raise ValueError(f"a metric's name is in snake case, got {metric.name!r}")
        self._metrics[metric.name] = metric


def _copy_value(value: Value) -> Figure:
    if isinstance(value, Histogram):
        return value.by_bound()
    return {str(key): count for key, count in value.items()} if isinstance(value, Mapping) else value
