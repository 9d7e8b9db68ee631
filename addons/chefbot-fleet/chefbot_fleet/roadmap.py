"""A roadmap: nodes, straight edges between them, and which of these two robots may not use at the same time.

Two robots exclude each other where their discs could come nearer than the clearance: this is computed from the
geometry of nodes and edges, never from names. Points are metres in the map's frame.
"""

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TypeAlias

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Point: TypeAlias = tuple[float, float]
Edge: TypeAlias = tuple[int, int]


class Roadmap(Struct, frozen=True, dict=True):
    """Nodes (x, y) and undirected edges between them (numbers of nodes); robots are discs of ``separation_m`` diameter.

    ``separation_m`` is the least distance between two robots' middles: twice the radius, and the clearance.
    ``names`` are the nodes at which robots are sent to work.

    Raises:
        ValueError: an edge names a node that is missing, joins a node with itself, or appears twice.
    """

    points_m: tuple[Point, ...]
    edges: tuple[Edge, ...]
    separation_m: float
    names: dict[str, int] = {}

    def __post_init__(self) -> None:
        """Refuse edges that are none."""
        count = len(self.points_m)
        for a, b in self.edges:
            if not (0 <= a < count and 0 <= b < count) or a == b:
                raise ValueError(f"edge ({a}, {b}): expected two different nodes below {count}")
        if len({frozenset(edge) for edge in self.edges}) < len(self.edges):
            raise ValueError("an edge appears twice")

    @cached_property
    def length_m(self) -> tuple[float, ...]:
        """The length of each edge."""
        return tuple(math.dist(self.points_m[a], self.points_m[b]) for a, b in self.edges)

    @cached_property
    def exits(self) -> tuple[tuple[tuple[int, int], ...], ...]:
        """For each node the edges that meet there, each with the node at its other end."""
        exits: list[list[tuple[int, int]]] = [[] for _ in self.points_m]
        for number, (a, b) in enumerate(self.edges):
            exits[a].append((number, b))
            exits[b].append((number, a))
        return tuple(map(tuple, exits))

    @cached_property
    def _segments(self) -> Floats:
        """The nodes as segments without length, then the edges: (nodes + edges, 4)."""
        points = [(*point, *point) for point in self.points_m]
        edges = [(*self.points_m[a], *self.points_m[b]) for a, b in self.edges]
        return np.array([*points, *edges], np.float64)

    @cached_property
    def _excluded(self) -> Flags:
        close: Flags = segment_distances_m(self._segments, self._segments) < self.separation_m - 1e-9
        return close

    @cached_property
    def edges_at_edge(self) -> tuple[frozenset[int], ...]:
        """For each edge the edges that no other robot may use meanwhile, itself among them."""
        nodes = len(self.points_m)
        return _sets(self._excluded[nodes:, nodes:])

    @cached_property
    def nodes_at_edge(self) -> tuple[frozenset[int], ...]:
        """For each edge the nodes at which no other robot may stand meanwhile."""
        nodes = len(self.points_m)
        return _sets(self._excluded[nodes:, :nodes])

    @cached_property
    def edges_at_node(self) -> tuple[frozenset[int], ...]:
        """For each node the edges that no other robot may use while one stands there."""
        nodes = len(self.points_m)
        return _sets(self._excluded[:nodes, nodes:])

    @cached_property
    def nodes_at_node(self) -> tuple[frozenset[int], ...]:
        """For each node the nodes at which no other robot may stand, itself among them."""
        nodes = len(self.points_m)
        return _sets(self._excluded[:nodes, :nodes])

    def excluded_by(self, path: Sequence[Point]) -> tuple[frozenset[int], frozenset[int]]:
        """The nodes and edges that nobody else may use while a robot is anywhere on this path, or at its one point."""
        ends = [*path[1:], path[-1]]
        segments = np.array([(*a, *b) for a, b in zip(path, ends, strict=True)], np.float64)
        nearest_m = segment_distances_m(self._segments, segments).min(axis=1)
        close: Flags = nearest_m < self.separation_m - 1e-9
        nodes = len(self.points_m)
        (at_nodes,), (at_edges,) = _sets(close[None, :nodes]), _sets(close[None, nodes:])
        return at_nodes, at_edges

    @cached_property
    def distance_m(self) -> Floats:
        """The shortest distance along edges between any two nodes; infinite where there is no route."""
        return np.asarray(dijkstra(self._matrix(range(len(self.edges))), directed=False))

    def _matrix(self, edges: Iterable[int]) -> csr_matrix:
        chosen, count = list(edges), len(self.points_m)
        ends = np.array([self.edges[k] for k in chosen], np.int64).reshape(-1, 2)
        return csr_matrix(([self.length_m[k] for k in chosen], (ends[:, 0], ends[:, 1])), (count, count))

    def remains_connected(self, occupied: Sequence[int]) -> bool:
        """Whether robots that stand at these nodes cut nobody off.

        Then the rest of the map hangs together, and from each of these nodes an edge leads into it that none of the
        other robots excludes.
        """
        blocked_nodes = frozenset[int]().union(*[self.nodes_at_node[node] for node in occupied])
        blocked_edges = frozenset[int]().union(*[self.edges_at_node[node] for node in occupied])
        edges = [k for k in range(len(self.edges)) if k not in blocked_edges]
        _, parts = connected_components(self._matrix(edges), directed=False)
        rest = [node for node in range(len(self.points_m)) if node not in blocked_nodes]
        if not rest:
            return False
        largest = np.bincount(parts[rest]).argmax()
        if any(parts[node] != largest for node in rest if self.exits[node]):
            return False
        for node in occupied:
            others = [other for other in occupied if other != node]
            excluded = frozenset[int]().union(*[self.edges_at_node[other] for other in others])
            if not any(
                edge not in excluded and end not in blocked_nodes and parts[end] == largest
                for edge, end in self.exits[node]
            ):
                return False
        return True

    @cached_property
    def passing_places(self) -> tuple[int, ...]:
        """The nodes at which a robot cuts nobody off from anything."""
        return tuple(node for node in range(len(self.points_m)) if self.exits[node] and self._is_aside(node))

    def homes(self, count: int, forbidden: Iterable[int] = ()) -> tuple[int, ...]:
        """Choose so many nodes that robots which stand at all of them cut nobody off; spread over the map.

        Raises:
            ValueError: the map has fewer such nodes.
        """
        chosen: list[int] = []
        refused = set(forbidden) | set(self.names.values())
        candidates = [node for node in self.passing_places if not refused & self.nodes_at_node[node]]
        while len(chosen) < count:
            if not candidates:
                raise ValueError(f"{count} robots: the map has {len(chosen)} places where one blocks nobody")
            spread = [
                min((self.distance_m[node, home] for home in chosen), default=0.0) for node in candidates
            ]
            node = candidates.pop(int(np.argmax(spread)))
            if self.remains_connected([*chosen, node]):
                chosen.append(node)
        return tuple(chosen)

    def _is_aside(self, node: int) -> bool:
        return self.remains_connected([node])

    def with_edge(self, a: int, b: int) -> "Roadmap":
        """The same with one more edge."""
        return Roadmap(self.points_m, (*self.edges, (a, b)), self.separation_m, self.names)

    def without_edge(self, a: int, b: int) -> "Roadmap":
        """The same without the edge between these nodes. Raises ``ValueError`` if it has none."""
        edges = tuple(edge for edge in self.edges if set(edge) != {a, b})
        if len(edges) == len(self.edges):
            raise ValueError(f"there is no edge between {a} and {b}")
        return Roadmap(self.points_m, edges, self.separation_m, self.names)

    def with_node(self, point: Point, neighbour: int, name: str | None = None) -> "Roadmap":
        """The same with a passing place (or, with a name, a place to work) beside a node."""
        number = len(self.points_m)
        names = self.names if name is None else {**self.names, name: number}
        return Roadmap((*self.points_m, point), (*self.edges, (neighbour, number)), self.separation_m, names)


def distance_to_segment_m(point: Point, start: Point, end: Point) -> float:
    """How far a point is from a segment."""
    return float(to_segment_m(np.array(point), np.array(start), np.array(end)))


def segment_distances_m(first: Floats, second: Floats) -> Floats:
    """The least distance between segments (n, 4) and (m, 4): (n, m); a point is a segment without length."""
    a, b = first[:, None, :2], first[:, None, 2:]
    c, d = second[None, :, :2], second[None, :, 2:]
    ends = np.minimum(
        np.minimum(to_segment_m(a, c, d), to_segment_m(b, c, d)),
        np.minimum(to_segment_m(c, a, b), to_segment_m(d, a, b)),
    )
    across = _side(a, b, c) * _side(a, b, d) < 0
    along = _side(c, d, a) * _side(c, d, b) < 0
    return np.where(across & along, 0.0, ends)


def to_segment_m(point: Floats, start: Floats, end: Floats) -> Floats:
    """How far points are from a segment; the last axis of each array is x, y."""
    step = end - start
    squared = np.maximum((step**2).sum(-1), 1e-12)
    share = np.clip(((point - start) * step).sum(-1) / squared, 0.0, 1.0)
    gap = point - start - share[..., None] * step
    return np.asarray(np.hypot(gap[..., 0], gap[..., 1]))


def _side(start: Floats, end: Floats, point: Floats) -> Floats:
    step, gap = end - start, point - start
    return np.asarray(step[..., 0] * gap[..., 1] - step[..., 1] * gap[..., 0])


def _sets(flags: Flags) -> tuple[frozenset[int], ...]:
    return tuple(frozenset(np.flatnonzero(row).tolist()) for row in flags)
