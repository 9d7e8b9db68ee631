"""Finds lanes and passing places in a map.

Lanes follow the skeleton of the space in which a robot has its clearance: they run in the middle of corridors and
through every door. Beside them, wherever a robot can stand without coming near a lane, there is a passing place.
In a corridor that is wide enough these join to a second lane.
"""

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from chefbot_fleet.roadmap import Edge, Flags, Floats, Point, Roadmap, to_segment_m
from chefbotd.components.navigation.algorithms.costmap import OCCUPIED_PERCENT
from chefbotd.components.navigation.algorithms.grid import GridFrame, distances_m
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.record import Record

Integers = NDArray[np.int64]
CELL_M = 0.05
"""The skeleton is thinned on cells of about this size, since its cost grows with their number."""


class LaneParameters(Record, frozen=True):
    """``clearance_m`` is kept to walls, ``separation_m`` between two robots' middles, ``spacing_m`` between nodes."""

    radius_m: float = 0.2
    clearance_m: float = 0.08
    separation_m: float = 0.6
    spacing_m: float = 0.75


class Space(Struct, frozen=True):
    """Where a robot's middle may be: cells (rows, columns) of ``cell_m`` in the grid's frame."""

    free: Flags
    cell_m: float
    frame: GridFrame

    def middle_m(self, cells: Integers) -> Floats:
        """The middles of cells (n, 2: row, column), x and y in the grid's frame."""
        return np.asarray((cells[:, ::-1] + 0.5) * self.cell_m, np.float64)

    def is_free(self, points_m: Floats) -> Flags:
        """For each point (n, 2) of the grid's frame whether a robot may be there."""
        cells = np.floor(points_m / self.cell_m).astype(np.int64)
        inside: Flags = np.logical_and.reduce(
            (cells >= 0) & (cells < np.array(self.free.shape)[::-1]), axis=1
        )
        cells = np.where(inside[:, None], cells, 0)
        return np.asarray(inside & self.free[cells[:, 1], cells[:, 0]])

    def sees(self, start: Floats, end: Floats) -> bool:
        """Whether the straight line between two points is free."""
        count = int(np.hypot(*(end - start)) / (self.cell_m / 2)) + 2
        return bool(self.is_free(start + np.linspace(0, 1, count)[:, None] * (end - start)).all())

    def has_way(self, start: Point, end: Point) -> bool:
        """Whether a robot can be at both points of the map, and drive straight from one to the other."""
        ends = self.frame.to_grid(np.array([start, end], np.float64))
        return bool(self.is_free(ends).all()) and self.sees(ends[0], ends[1])


def find_lanes(grid: OccupancyGrid, parameters: LaneParameters, places: dict[str, Point] = {}) -> Roadmap:  # noqa: B006
    """The roadmap of a map: lanes, passing places, and the named ``places``, to each of which an edge leads.

    Raises:
        ValueError: nothing is free, or a place lies where the robot cannot be or cannot go in a straight line.
    """
    space = free_space(grid, parameters)
    pixels = np.argwhere(thinned(space.free))
    points = space.middle_m(pixels)
    samples, edges = _sampled(space, pixels, points, parameters.spacing_m)
    nodes = [points[sample] for sample in samples]
    named = space.frame.to_grid(np.array(list(places.values()), np.float64).reshape(-1, 2))
    names: dict[str, int] = {}
    for name, point in zip(places, named, strict=True):
        edges.extend(_joined(space, name, point, nodes))
        names[name] = len(nodes)
        nodes.append(point)
    edges.extend(_passing_places(space, nodes, edges, parameters))
    in_map = space.frame.to_map(np.array(nodes))
    return Roadmap(
        tuple((float(x), float(y)) for x, y in in_map), tuple(edges), parameters.separation_m, names
    )


def free_space(grid: OccupancyGrid, parameters: LaneParameters) -> Space:
    """Where a robot has its clearance to everything that is occupied or unknown, and in one piece.

    Raises:
        ValueError: nowhere.
    """
    frame = GridFrame.of(grid)
    distance_m = distances_m((grid.percent >= OCCUPIED_PERCENT) | (grid.percent < 0), grid.resolution_m)
    step = max(1, round(CELL_M / grid.resolution_m))
    needed_m = parameters.radius_m + parameters.clearance_m
    free: Flags = np.asarray(distance_m[step // 2 :: step, step // 2 :: step] >= needed_m, np.bool_)
    free[[0, -1]], free[:, [0, -1]] = False, False
    cells = np.argwhere(free)
    if not len(cells):
        raise ValueError("the map has no free space for a robot")
    _, parts = connected_components(_neighbours(cells, free.shape), directed=False)
    largest = cells[parts == np.bincount(parts).argmax()]
    kept = np.zeros_like(free)
    kept[largest[:, 0], largest[:, 1]] = True
    return Space(kept, step * grid.resolution_m, frame)


def thinned(free: Flags) -> Flags:
    """The skeleton: lines one cell wide that hang together as the free cells do. The border must not be free.

    Method: Zhang and Suen, "A fast parallel algorithm for thinning digital patterns", CACM 27(3), 1984.
    """
    lines, changed = free.copy(), True
    while changed:
        changed = False
        for second in (False, True):
            p = [np.roll(lines, shift, (0, 1)) for shift in _AROUND]
            count = np.sum(p, axis=0)
            steps = np.sum([~p[k] & p[(k + 1) % 8] for k in range(8)], axis=0)
            north, east, south, west = p[0], p[2], p[4], p[6]
            if second:
                corners = ~(north & east & west) & ~(north & south & west)
            else:
                corners = ~(north & east & south) & ~(east & south & west)
            removed = lines & (count >= 2) & (count <= 6) & (steps == 1) & corners
            lines &= ~removed
            changed = changed or bool(removed.any())
    return lines


_AROUND = ((1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1))


def _neighbours(cells: Integers, shape: tuple[int, ...]) -> csr_matrix:
    """The distances in cells between those of ``cells`` that touch."""
    number = np.full(shape, -1, np.int64)
    number[cells[:, 0], cells[:, 1]] = np.arange(len(cells))
    rows, columns, lengths = [], [], []
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
        other = number[cells[:, 0] + down, cells[:, 1] + across]
        touching = np.flatnonzero(other >= 0)
        rows.append(touching)
        columns.append(other[touching])
        lengths.append(np.full(len(touching), np.hypot(down, across)))
    ends = (np.concatenate(rows), np.concatenate(columns))
    return csr_matrix((np.concatenate(lengths), ends), (len(cells), len(cells)))


def _sampled(
    space: Space, pixels: Integers, points: Floats, spacing_m: float
) -> tuple[list[int], list[Edge]]:
    """Pixels of the skeleton about ``spacing_m`` apart, and an edge between those that follow each other.

    Where the straight line between two is not free, the pixel where they meet becomes a node too.
    """
    graph = _neighbours(pixels, space.free.shape)
    samples, refused = [0], set[Edge]()
    while True:
        reach, _, nearest = dijkstra(
            graph, directed=False, indices=samples, min_only=True, return_predecessors=True
        )
        farthest = int(reach.argmax())
        if reach[farthest] * space.cell_m > spacing_m:
            samples.append(farthest)
            continue
        position = {sample: k for k, sample in enumerate(samples)}
        edges, hidden = dict[Edge, None](), None
        for a, b in zip(*graph.nonzero(), strict=True):
            first, last = sorted((int(nearest[a]), int(nearest[b])))
            edge = (position[first], position[last])
            if first == last or edge in edges or edge in refused:
                continue
            if space.sees(points[first], points[last]):
                edges[edge] = None
            elif a in position:
                refused.add(edge)
            else:
                hidden = int(a)
                break
        if hidden is None:
            return samples, list(edges)
        samples.append(hidden)


def _joined(space: Space, name: str, point: Floats, nodes: list[Floats]) -> list[Edge]:
    """Edges from a new node at this point to the two nearest that it sees."""
    if not space.is_free(point[None])[0]:
        raise ValueError(f"{name}: the robot has not its clearance there")
    order = np.argsort(np.hypot(*(np.array(nodes) - point).T))
    edges = [(int(k), len(nodes)) for k in order[:12] if space.sees(nodes[k], point)][:2]
    if not edges:
        raise ValueError(f"{name}: no lane can be reached from there in a straight line")
    return edges


def _passing_places(
    space: Space, nodes: list[Floats], edges: list[Edge], parameters: LaneParameters
) -> list[Edge]:
    """Add nodes where a robot excludes nobody on a lane; return the edges to them and between them."""
    separation_m, reach_m = parameters.separation_m, 2 * parameters.spacing_m
    candidates = space.middle_m(np.argwhere(space.free))
    segments = np.array([(*nodes[a], *nodes[b]) for a, b in edges])
    gap_m = np.full(len(candidates), np.inf)
    for segment in segments:
        gap_m = np.minimum(gap_m, to_segment_m(candidates, segment[:2], segment[2:]))
    chosen = np.flatnonzero((gap_m >= separation_m) & (gap_m <= reach_m))
    added: list[Edge] = []
    lanes, first = len(nodes), len(nodes)
    for k in chosen[np.argsort(gap_m[chosen], kind="stable")]:
        point = candidates[k]
        others = np.array(nodes[first:]).reshape(-1, 2)
        if len(others) and np.hypot(*(others - point).T).min() < separation_m:
            continue
        distance_m = np.hypot(*(np.array(nodes) - point).T)
        near = [
            int(n) for n in np.argsort(distance_m) if distance_m[n] <= reach_m and space.sees(nodes[n], point)
        ]
        to_lane = [n for n in near if n < lanes][:1]
        beside = [n for n in near if n >= lanes and distance_m[n] <= 1.5 * separation_m][:3]
        if to_lane:
            added.extend((n, len(nodes)) for n in [*to_lane, *beside])
            nodes.append(point)
    return added
