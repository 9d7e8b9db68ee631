"""Bounded memory: where a place has been scanned often enough, the oldest scans there are forgotten.

What the graph knows by a forgotten node is not lost: each of its edges is handed to the node after it, which lies a
step further, with the uncertainty of that step added. So the map keeps its shape, and follows furniture that moved.
"""

import math

import numpy as np

from chefbotd.components.mapping.algorithms.graph import Edges, Indices
from chefbotd.components.mapping.algorithms.state import SlamState, Submap
from chefbotd.core.poses import Floats, between, compose, inverse
from chefbotd.core.record import Record, replace

PLACE_M = 1.0
QUARTER_RAD = math.pi / 2
LEAST_NODES = 3
"""A submap of fewer is no use for recognising anything; it is dissolved, and its anchor may be forgotten too."""


class Forgotten(Record, frozen=True):
    """The node ``number`` is no more; it was at ``pose`` as seen from the node ``kept``."""

    number: int
    kept: int
    pose: Floats


def thin_scans(state: SlamState, most_per_place: int) -> tuple[SlamState, tuple[Forgotten, ...]]:
    """The state with so many scans at most for each square metre and quarter turn, but for those still in use."""
    submaps = tuple(s for s in state.submaps if s.last - s.first + 1 >= LEAST_NODES)
    if len(submaps) < len(state.submaps):
        state = replace(state, submaps=submaps, searching=None)  # it knows submaps by their place in the list
    gone = np.flatnonzero(_is_superfluous(state, most_per_place))
    if not len(gone):
        return state, ()
    successors = _successors(len(state.nodes), gone)
    numbers, poses = state.nodes.number, state.nodes.map
    forgotten = tuple(
        Forgotten(int(numbers[k]), int(numbers[successors[k]]), between(poses[successors[k]], poses[k]))
        for k in gone
    )
    edges = state.edges
    for node in gone:
        edges = _handed_on(edges, poses, int(node))
    return _renumber_nodes(state, edges, gone), forgotten


def _is_superfluous(state: SlamState, most_per_place: int) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """The oldest nodes of each place with too many; not anchors, nor what still grows, nor a part's last node."""
    nodes, count = state.nodes, len(state.nodes)
    place = np.floor(nodes.map[:, :2] / PLACE_M).astype(np.int64)
    quarter = np.floor((nodes.map[:, 2] + math.pi) / QUARTER_RAD).astype(np.int64)
    _, which = np.unique(np.column_stack([place, quarter]), axis=0, return_inverse=True)
    which = which.ravel()
    order = np.argsort(which[::-1], kind="stable")
    rank = np.empty(count, np.int64)
    begins = np.searchsorted(which[::-1][order], which[::-1][order])
    rank[count - 1 - order] = np.arange(count) - begins
    kept = np.zeros(count, np.bool_)
    kept[[0, *(s.first for s in state.submaps)]] = True
    if state.active:
        kept[state.active[0].first :] = True
    kept[np.flatnonzero(np.diff(nodes.part, append=-1))] = True
    kept[np.unique(nodes.part, return_index=True)[1]] = True
    return (rank >= most_per_place) & ~kept


def _successors(count: int, gone: Indices) -> Indices:
    """For each node the next one that is kept."""
    stays = np.ones(count, np.bool_)
    stays[gone] = False
    kept = np.flatnonzero(stays)
    successors: Indices = kept[np.searchsorted(kept, np.arange(count))]
    return successors


def _handed_on(edges: Edges, poses: Floats, node: int) -> Edges:
    """The edges with those of a node handed to the one after it; of two between the same nodes the surer stays."""
    after = int(edges.second[(edges.first == node) & ~edges.loop].min())
    step = between(poses[node], poses[after])
    chain = np.flatnonzero((edges.first == node) & (edges.second == after))
    of_step = np.linalg.inv(edges.information[chain[0]])
    rest = edges.only(np.setdiff1d(np.arange(len(edges)), chain))
    first, second, loop = rest.first.copy(), rest.second.copy(), rest.loop
    pose, information, spread = rest.pose.copy(), rest.information.copy(), rest.spread.copy()
    for k in np.flatnonzero((first == node) | (second == node)):
        covariance = np.linalg.inv(information[k])
        if second[k] == node:
            pose[k], covariance = _then(pose[k], covariance, step, of_step)
            second[k] = after
        else:
            pose[k], covariance = _from_after(pose[k], covariance, step, of_step)
            first[k] = after
        information[k] = np.linalg.inv(covariance)
        spread[k] += [(of_step[0, 0] + of_step[1, 1]) / 2, of_step[2, 2]]
    handed = Edges(first, second, pose, information, spread, loop)
    return _surest(handed.only(first != second))


def _then(pose: Floats, covariance: Floats, step: Floats, of_step: Floats) -> tuple[Floats, Floats]:
    """An edge and the step after it as one."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    by_edge = np.eye(3)
    by_edge[:2, 2] = [-sin * step[0] - cos * step[1], cos * step[0] - sin * step[1]]
    by_step = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return compose(pose, step), by_edge @ covariance @ by_edge.T + by_step @ of_step @ by_step.T


def _from_after(pose: Floats, covariance: Floats, step: Floats, of_step: Floats) -> tuple[Floats, Floats]:
    """An edge as seen from where the step ends."""
    moved = compose(inverse(step), pose)
    cos, sin = math.cos(step[2]), math.sin(step[2])
    by_edge = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    by_step = -by_edge
    by_step[:2, 2] = [moved[1], -moved[0]]
    return moved, by_edge @ covariance @ by_edge.T + by_step @ of_step @ by_step.T


def _surest(edges: Edges) -> Edges:
    """One edge for each pair of nodes and kind: the one of the least spread."""
    order = np.lexsort((edges.spread.sum(axis=1), edges.loop, edges.second, edges.first))
    keys = np.column_stack([edges.first, edges.second, edges.loop])[order]
    again = np.zeros(len(order), np.bool_)
    again[1:] = (keys[1:] == keys[:-1]).all(axis=1)
    return edges.only(np.sort(order[~again]))


def _renumber_nodes(state: SlamState, edges: Edges, gone: Indices) -> SlamState:
    """The state without these nodes; those after them move up."""
    stays = np.ones(len(state.nodes), np.bool_)
    stays[gone] = False
    row = np.cumsum(stays) - 1
    moved = Edges(
        row[edges.first], row[edges.second], edges.pose, edges.information, edges.spread, edges.loop
    )
    return replace(
        state,
        nodes=state.nodes.only(np.flatnonzero(stays)),
        edges=moved,
        submaps=tuple(Submap(int(row[s.first]), int(row[s.last])) for s in state.submaps),
        active=tuple(replace(a, first=int(row[a.first])) for a in state.active),
        candidates=tuple(
            replace(c, node=int(row[c.node]), anchor=int(row[c.anchor]))
            for c in state.candidates
            if stays[c.node] and stays[c.anchor]
        ),
        built=(),
        searching=None,
    )
