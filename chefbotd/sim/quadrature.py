"""The edges of the wheels' quadrature encoders, for a board that passes them on undecoded."""

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from chefbotd.sim.plant import Wheels

LEVELS = (0b00, 0b10, 0b11, 0b01)
"""The lines of an encoder that turns forward: A, worth 2, before B, worth 1."""


class Edge(NamedTuple):
    """The levels after an edge, and its time."""

    at_s: float
    levels: int


class Taken(NamedTuple):
    """A wheel's edges, and how many there have been up to the last of them since the board booted, told or not."""

    total: int
    edges: list[Edge]


class EdgeRecorder:
    """Finds the edges of turning wheels, a step at a time, and keeps them until they are taken.

    The board has room for ``buffer_edges`` of each wheel; it counts later ones and drops them.
    """

    def __init__(self, counts_per_rad: Sequence[float], buffer_edges: int) -> None:
        """``counts_per_rad`` has a number a wheel, negative where the encoder counts backwards."""
        self._counts_per_rad, self._buffer_edges = tuple(counts_per_rad), buffer_edges
        self._edges: tuple[deque[Edge], ...] = tuple(deque() for _ in counts_per_rad)
        self._totals = [0] * len(self._counts_per_rad)

    def watch(self, from_s: float, to_s: float, before_rad: Wheels, after_rad: Wheels) -> None:
        """The wheels turned so in this time, each evenly."""
        wheels = zip(before_rad, after_rad, self._counts_per_rad, self._edges, strict=True)
        for before, after, per_rad, edges in wheels:
            edges.extend(_edges(from_s, to_s, before * per_rad, after * per_rad))

    def boot(self, at_s: float) -> None:
        """The board's program begins: it has seen nothing of what was before."""
        self.take_edges(at_s)
        self._totals = [0] * len(self._totals)

    def take_edges(self, to_s: float) -> list[Taken]:
        """Each wheel's edges up to this time, once."""
        return [self._take(wheel, to_s) for wheel in range(len(self._edges))]

    def _take(self, wheel: int, to_s: float) -> Taken:
        edges = _take(self._edges[wheel], to_s)
        kept = edges[: self._buffer_edges]
        total = self._totals[wheel] + len(kept)
        self._totals[wheel] += len(edges)
        return Taken(total, kept)


def _edges(from_s: float, to_s: float, before: float, after: float) -> list[Edge]:
    """Where an angle in counts crosses whole numbers, in the order in which it does."""
    first, last = math.floor(before), math.floor(after)
    if first == last:
        return []
    per_count_s = (to_s - from_s) / (after - before)
    if last > first:
        crossed = [(n, n) for n in range(first + 1, last + 1)]
    else:
        crossed = [(n, n - 1) for n in range(first, last, -1)]
    return [Edge(from_s + (n - before) * per_count_s, LEVELS[now % 4]) for n, now in crossed]


def _take(edges: deque[Edge], to_s: float) -> list[Edge]:
    taken = []
    while edges and edges[0].at_s <= to_s:
        taken.append(edges.popleft())
    return taken
