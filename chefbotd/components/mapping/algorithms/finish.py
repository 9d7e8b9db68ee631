"""Finishes a map: matches every kept scan against the submaps around it, and solves the graph again."""

from collections.abc import Generator

import numpy as np

from chefbotd.components.mapping.algorithms.graph import NO_EDGES, Edges, edge
from chefbotd.components.mapping.algorithms.loops import is_sound, loop_covariance
from chefbotd.components.mapping.algorithms.parameters import SlamParameters
from chefbotd.components.mapping.algorithms.refine import Prior, polish
from chefbotd.components.mapping.algorithms.slam import solve_graph
from chefbotd.components.mapping.algorithms.state import SlamState, Submap, rebuilt
from chefbotd.core.poses import between
from chefbotd.core.record import replace

NEAR_M = 3.0
SUBMAPS_PER_NODE = 4
EXPECTED = np.diag([0.2**-2, 0.2**-2, 0.05**-2])
"""The graph's poses are this good once its loops are closed (an information matrix)."""


def refine_graph(params: SlamParameters, state: SlamState) -> SlamState:
    """The state with more loops, between all that overlaps, and the poses that fit them."""
    work = refining(params, state)
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: SlamState = end.value
            return result


def refining(params: SlamParameters, state: SlamState) -> Generator[tuple[int, int], None, SlamState]:
    """The same in steps: yields how many submaps are done, and of how many, and returns the state."""
    loops = NO_EDGES
    submaps = [*state.submaps, *(Submap(a.first, len(state.nodes) - 1) for a in state.active)]
    for k, (submap, members) in enumerate(zip(submaps, _members(state, submaps), strict=True)):
        yield k, len(submaps)
        if members:
            loops = loops.joined(_match_members(params, state, submap, members))
    yield len(submaps), len(submaps)
    return solve_graph(replace(state, edges=_without(state.edges, loops).joined(loops)))


def _members(state: SlamState, submaps: list[Submap]) -> list[list[int]]:
    """For each submap the nodes that are near it and not in it; each node is in a few at most."""
    poses, members = state.nodes.map[:, :2], [list[int]() for _ in submaps]
    away = np.empty((len(submaps), len(poses)))
    for k, submap in enumerate(submaps):
        first, last = submap.first, submap.last
        steps = poses[None, first : last + 1] - poses[:, None]
        away[k] = np.hypot(steps[..., 0], steps[..., 1]).min(axis=1)
        away[k, first : last + 1] = np.inf
        away[k, state.nodes.part != state.nodes.part[first]] = np.inf
    for node in range(len(poses)):
        for k in np.argsort(away[:, node], kind="stable")[:SUBMAPS_PER_NODE]:
            if away[k, node] < NEAR_M:
                members[k].append(node)
    return members


def _match_members(params: SlamParameters, state: SlamState, submap: Submap, members: list[int]) -> Edges:
    """The loops from a submap's anchor to these nodes, where they fit."""
    poses, loops = between(state.nodes.map[submap.first], state.nodes.map), NO_EDGES
    grids = rebuilt(state.nodes, submap.first, submap.last, poses)
    for node in members:
        scan, expected = state.nodes.scans[node], poses[node]
        prior = Prior(expected, EXPECTED)
        fit = polish(grids, scan.points, scan.facing, expected, prior, params.matching.laser_noise_m)
        if is_sound(params.loops, fit, expected):
            loops = loops.joined(edge(submap.first, node, fit.pose, loop_covariance(fit), loop=True))
    return loops


def _without(edges: Edges, newer: Edges) -> Edges:
    """The edges but for the loops that newer ones stand for: those of the same two nodes."""
    again = set(zip(newer.first.tolist(), newer.second.tolist(), strict=True))
    pairs = zip(edges.first.tolist(), edges.second.tolist(), edges.loop.tolist(), strict=True)
    return edges.only(np.array([not (loop and (a, b) in again) for a, b, loop in pairs], np.bool_))
