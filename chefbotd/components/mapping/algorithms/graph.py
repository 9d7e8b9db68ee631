"""The pose graph: what is known about pairs of kept scans, and the poses that fit all of it best.

Gauss-Newton on a sparse system (Grisetti et al., "A Tutorial on Graph-Based SLAM", 2010). Loops are robust by
dynamic covariance scaling (Agarwal et al., ICRA 2013). With its scale a loop that corrects metres of drift would be
switched off before it can pull; so the scale begins as wide as the worst new loop and narrows from step to step
(graduated, as in Yang et al., "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020).
"""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.poses import Floats, invert, wrap
from chefbotd.core.record import Record

Indices: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.bool_]

SCALE = 10.0
"""The squared, normalised error up to which a loop counts in full: one right loop in 50 has more (chi-squared, 3)."""

NARROWING = 4.0
ITERATIONS = 20
STILL_M, STILL_RAD = 1e-3, 1e-3
FIXED = 1e8
REJECTED_BELOW = 0.25
"""A loop whose weight is smaller is not believed."""


class Edges(Record, frozen=True):
    """What is known between nodes, a row each: ``second`` lies at ``pose`` as seen from ``first``.

    ``spread`` holds the variances of place (m2) and heading (rad2), for telling how far apart two nodes may have
    drifted. ``loop`` tells those that need not be believed.
    """

    first: Indices
    second: Indices
    pose: Floats
    information: Floats
    spread: Floats
    loop: Flags

    def __len__(self) -> int:
        return len(self.first)

    def joined(self, other: "Edges") -> "Edges":
        """These and the other ones."""
        pairs = zip(self._columns, other._columns, strict=True)
        return Edges(*[np.concatenate(pair) for pair in pairs])

    def only(self, which: Flags | Indices) -> "Edges":
        """Some of them."""
        return Edges(*[column[which] for column in self._columns])

    @property
    def _columns(self) -> tuple[NDArray[Any], ...]:
        return self.first, self.second, self.pose, self.information, self.spread, self.loop


NO_EDGES = Edges(
    np.zeros(0, np.int64),
    np.zeros(0, np.int64),
    np.zeros((0, 3)),
    np.zeros((0, 3, 3)),
    np.zeros((0, 2)),
    np.zeros(0, np.bool_),
)


def edge(first: int, second: int, pose: Floats, covariance: Floats, *, loop: bool) -> Edges:
    """One edge, with the covariance of ``pose`` (over x, y and heading, in the frame of ``first``)."""
    spread = [(covariance[0, 0] + covariance[1, 1]) / 2, covariance[2, 2]]
    return Edges(
        np.array([first]),
        np.array([second]),
        pose[None].copy(),
        invert(covariance)[None],
        np.array([spread]),
        np.array([loop]),
    )


def residuals(poses: Floats, edges: Edges) -> Floats:
    """By how much the poses disagree with each edge: x, y and heading, in the frame of its first node."""
    return _residuals(poses, edges)[0]


def squared_errors(poses: Floats, edges: Edges) -> Floats:
    """The same, normalised by what the edge is known to: 3 on average where all is well."""
    off = residuals(poses, edges)
    squared: Floats = np.einsum("ni,nij,nj->n", off, edges.information, off)
    return squared


def weights(squared: Floats, loop: Flags, scale: float) -> Floats:
    """How much each edge counts: those of the robot's own course in full, a loop the less the worse it fits."""
    scaled: Floats = np.where(loop, np.minimum(1.0, 2 * scale / (scale + squared)) ** 2, 1.0)
    return scaled


def optimise_graph(poses: Floats, edges: Edges, fixed: Indices, scale: float = SCALE) -> Floats:
    """The poses that fit the edges best; those of the nodes ``fixed`` stay (one at least in each connected part).

    ``scale`` is where the loops' kernel begins; it narrows to ``SCALE``.
    """
    now = poses.copy()
    for _ in range(ITERATIONS):
        step = _step(now, edges, fixed, scale)
        now += step
        now[:, 2] = wrap(now[:, 2])
        still = np.abs(step[:, :2]).max() < STILL_M and np.abs(step[:, 2]).max() < STILL_RAD
        if still and scale <= SCALE:
            break
        scale = max(scale / NARROWING, SCALE)
    return now


def _step(poses: Floats, edges: Edges, fixed: Indices, scale: float) -> Floats:
    off, of_first, of_second = _residuals(poses, edges)
    squared = np.einsum("ni,nij,nj->n", off, edges.information, off)
    weighted = edges.information * weights(squared, edges.loop, scale)[:, None, None]
    first, second = of_first.transpose(0, 2, 1) @ weighted, of_second.transpose(0, 2, 1) @ weighted
    gradient = np.zeros_like(poses)
    np.add.at(gradient, edges.first, np.einsum("nij,nj->ni", first, off))
    np.add.at(gradient, edges.second, np.einsum("nij,nj->ni", second, off))
    anchors = np.tile(np.eye(3) * FIXED, (len(fixed), 1, 1))
    blocks = [first @ of_first, first @ of_second, second @ of_first, second @ of_second, anchors]
    rows = np.concatenate([edges.first, edges.first, edges.second, edges.second, fixed])
    columns = np.concatenate([edges.first, edges.second, edges.first, edges.second, fixed])
    from scipy.sparse.linalg import splu  # 6 MB that a worker which makes no map does without

    system = _assemble_matrix(len(poses), rows, columns, np.concatenate(blocks))
    factors = splu(system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    step: Floats = -factors.solve(gradient.ravel()).reshape(-1, 3)
    return step


def _assemble_matrix(nodes: int, rows: Indices, columns: Indices, blocks: Floats) -> Any:
    """The sparse matrix of these 3 by 3 blocks; those at the same place add up."""
    from scipy.sparse import csc_matrix

    three = np.arange(3)
    at_row = np.broadcast_to(3 * rows[:, None, None] + three[None, :, None], blocks.shape)
    at_column = np.broadcast_to(3 * columns[:, None, None] + three[None, None, :], blocks.shape)
    return csc_matrix((blocks.ravel(), (at_row.ravel(), at_column.ravel())), shape=(3 * nodes, 3 * nodes))


def _residuals(poses: Floats, edges: Edges) -> tuple[Floats, Floats, Floats]:
    """The residuals (n, 3), and how they answer to the poses of the first and the second node (n, 3, 3)."""
    a, b = poses[edges.first], poses[edges.second]
    cos, sin = np.cos(a[:, 2]), np.sin(a[:, 2])
    dx, dy = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
    x, y = cos * dx + sin * dy, cos * dy - sin * dx
    off = np.stack(
        [x - edges.pose[:, 0], y - edges.pose[:, 1], wrap(b[:, 2] - a[:, 2] - edges.pose[:, 2])], axis=1
    )
    of_second = np.zeros((len(edges), 3, 3))
    of_second[:, 0, 0], of_second[:, 0, 1] = cos, sin
    of_second[:, 1, 0], of_second[:, 1, 1], of_second[:, 2, 2] = -sin, cos, 1.0
    of_first = -of_second
    of_first[:, 0, 2], of_first[:, 1, 2] = y, -x
    return off, of_first, of_second


def drift_m(nodes: int, edges: Edges, source: int, lever_m: float) -> Floats:
    """How far each node may have drifted from ``source`` (one sigma), by the surest way through the graph.

    An error of heading counts with ``lever_m``. Further ways only make it surer, so this is an upper bound
    (Olson, "Robust and Efficient Robotic Mapping", 2008, calls it the Dijkstra projection). Unreachable: inf.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import dijkstra

    variance = edges.spread[:, 0] + lever_m**2 * edges.spread[:, 1]
    low, high = np.minimum(edges.first, edges.second), np.maximum(edges.first, edges.second)
    order = np.lexsort((variance, high, low))
    low, high, variance = low[order], high[order], variance[order]
    best = np.ones(len(order), np.bool_)
    best[1:] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    ways = csr_matrix((variance[best], (low[best], high[best])), shape=(nodes, nodes))
    sigma: Floats = np.sqrt(dijkstra(ways, directed=False, indices=source))
    return sigma
