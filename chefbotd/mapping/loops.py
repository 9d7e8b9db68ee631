"""Recognizes places: searches a scan in older submaps, and verifies the match before it counts.

What keeps wrong loops out, in this order: the search reaches three sigmas of the drift and no further; the scan
must fit the submap's surfaces where both know something; no second place in the window may fit nearly as well;
where the drift is large, matches from different places must ask for the same correction, and more of them than
ask for another one (after Olson, "Recognizing places using spectrally clustered local matches", 2009).
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from chefbotd.mapping.correlate import Excluded, Found, Window, search
from chefbotd.mapping.graph import drift_m
from chefbotd.mapping.local_map import LocalMap
from chefbotd.mapping.parameters import LoopParameters, SlamParameters
from chefbotd.mapping.poses import Floats, between, compose, inverse, inverted, wrap
from chefbotd.mapping.refine import Fit, Prior, polish
from chefbotd.mapping.state import Candidate, SlamMode, SlamState, rebuilt

LOOP_SIGMA_M, LOOP_SIGMA_RAD = 0.01, 0.003
"""What a submap is bent within itself, beyond the noise of the match."""

VAGUE_M = 1.0
"""A match that leaves the place open by more, as along a bare corridor, recognises nothing."""

PENALTY = 0.005
FREE = np.zeros((3, 3))
RIVAL_M, RIVAL_RAD = 0.6, 0.3
"""What is this near to the best pose is the same peak."""

MOVED_BY_POLISH_M = 0.2
LEAST_LEVER_M = 5.0
BUILT_AT_MOST = 4
AT_ONCE_WHEN_LOST = 8


class Target(NamedTuple):
    """A submap to search in: where the scan is expected in its frame, how far around, and what drift allows."""

    submap: int
    guess: Floats
    window: Window
    drift_m: float


def is_due(params: LoopParameters, state: SlamState) -> bool:
    """Whether the robot has gone far enough to look again."""
    return state.path_m - state.tried_at_m >= params.every_m and len(state.submaps) > 0


def recognised(params: SlamParameters, state: SlamState) -> tuple[SlamState, tuple[Candidate, ...]]:
    """Search the last node's scan in submaps; the state has the grids built for it, and the matches are verified."""
    targets = _lost_targets(state) if state.part else _targets(params.loops, state)
    found: list[Candidate] = []
    for target in targets:
        state, grids = _grids(state, target.submap)
        candidate = _verified(params, state, target, grids)
        if candidate is not None:
            found.append(candidate)
    tried = state.tried + len(targets)
    return replace(state, tried_at_m=state.path_m, tried=tried), tuple(found)


def _targets(params: LoopParameters, state: SlamState) -> list[Target]:
    """The submaps nearest to the last node that it may lie in, and that it did not just come from."""
    nodes, last = state.nodes, len(state.nodes) - 1
    here = nodes.map[last]
    lever_m = max(float(np.hypot(*np.ptp(nodes.map[:, :2], axis=0))) / 2, LEAST_LEVER_M)
    sigma = drift_m(len(nodes), state.edges, last, lever_m)
    away = np.hypot(nodes.map[:, 0] - here[0], nodes.map[:, 1] - here[1])
    ranked = []
    for k, (first, end) in enumerate(state.submaps):
        recent = nodes.path_m[last] - nodes.path_m[end] < params.not_within_m
        if recent or nodes.part[first] != state.part:
            continue
        nearest = float(away[first : end + 1].min())
        if nearest < params.near_m + min(3 * sigma[first], params.max_window_m):
            ranked.append((nearest, k, float(sigma[first])))
    targets = []
    for _, k, sigma_m in sorted(ranked)[: params.submaps_at_once]:
        window = Window(
            min(3 * sigma_m + 0.2, params.max_window_m),
            min(3 * sigma_m / lever_m + 0.05, math.pi),
            PENALTY / sigma_m**2,
            PENALTY * (lever_m / sigma_m) ** 2,
        )
        targets.append(Target(k, between(nodes.map[state.submaps[k].first], here), window, sigma_m))
    return targets


def _lost_targets(state: SlamState) -> list[Target]:
    """Everywhere along the known paths: where something was found before, then some more each time, in a circle."""
    known = [k for k, submap in enumerate(state.submaps) if state.nodes.part[submap.first] == 0]
    if not known:
        return []
    by_anchor = {state.submaps[k].first: k for k in known}
    again = [by_anchor[c.anchor] for c in state.candidates if c.anchor in by_anchor]
    turn = [known[(state.tried + k) % len(known)] for k in range(AT_ONCE_WHEN_LOST)]
    targets = []
    for k in dict.fromkeys(again + turn):
        first, last = state.submaps[k]
        path = between(state.nodes.map[first], state.nodes.map[first : last + 1])[:, :2]
        low, high = path.min(axis=0), path.max(axis=0)
        guess = np.array([*(low + high) / 2, 0.0])
        targets.append(Target(k, guess, Window(float((high - low).max()) / 2 + 2.0, math.pi), math.inf))
    return targets


def _grids(state: SlamState, submap: int) -> tuple[SlamState, LocalMap]:
    """The grids of a submap in the frame of its anchor, built from its scans at the graph's poses."""
    for k, grids in state.built:
        if k == submap:
            return state, grids
    first, last = state.submaps[submap]
    grids = rebuilt(state.nodes, first, last, between(state.nodes.map[first], state.nodes.map))
    return replace(state, built=(*state.built[-BUILT_AT_MOST + 1 :], (submap, grids))), grids


def _verified(params: SlamParameters, state: SlamState, target: Target, grids: LocalMap) -> Candidate | None:
    loops, node = params.loops, len(state.nodes) - 1
    scan = state.nodes.scans[node]
    found = search(grids, scan.points, target.guess, target.window, above=loops.min_score)
    if found is None:
        return None
    start = Prior(found.pose, FREE)
    fit = polish(grids, scan.points, scan.facing, found.pose, start, params.matching.laser_noise_m)
    covariance = loop_covariance(fit)
    if not is_sound(loops, fit, found.pose) or covariance[0, 0] + covariance[1, 1] > VAGUE_M**2:
        return None
    if target.drift_m > loops.sure_within_m and _has_rival(loops, state, target, grids, found):
        return None
    anchor = state.submaps[target.submap].first
    seen_at = compose(state.nodes.map[anchor], fit.pose)
    correction = compose(seen_at, inverse(state.nodes.map[node]))
    return Candidate(node, anchor, fit.pose, covariance, correction, target.drift_m)


def loop_covariance(fit: Fit) -> Floats:
    """How surely the match is known: by its information, and by how straight a submap is."""
    covariance = inverted(fit.information + 1e-3 * np.eye(3))
    return covariance + np.diag([LOOP_SIGMA_M**2, LOOP_SIGMA_M**2, LOOP_SIGMA_RAD**2])


def is_sound(params: LoopParameters, fit: Fit, start: Floats) -> bool:
    """Whether enough of the scan lies where the submap knows something, fits there, and polishing kept it near."""
    moved_m = math.hypot(fit.pose[0] - start[0], fit.pose[1] - start[1])
    return (
        fit.overlap >= params.min_overlap and fit.share >= params.min_share and moved_m <= MOVED_BY_POLISH_M
    )


def _has_rival(
    params: LoopParameters, state: SlamState, target: Target, grids: LocalMap, found: Found
) -> bool:
    x, y, heading = found.pose
    excluded = Excluded(float(x), float(y), float(heading), RIVAL_M, RIVAL_RAD)
    above = params.rival_score * found.score
    points = state.nodes.scans[-1].points
    return search(grids, points, target.guess, target.window, above=above, excluded=excluded) is not None


def believed(
    params: LoopParameters, state: SlamState, found: tuple[Candidate, ...]
) -> tuple[tuple[Candidate, ...], tuple[Candidate, ...]]:
    """Which candidates, old and new, may close their loops now, and which still wait for others that agree."""
    oldest_m = state.path_m - params.remembered_m
    waiting = [c for c in state.candidates if state.nodes.path_m[c.node] >= oldest_m]
    accepted: dict[int, Candidate] = {}
    for candidate in found:
        agreeing = [c for c in waiting if _agree(params, state, c, candidate)]
        together = [*agreeing, candidate]
        if candidate.drift_m <= params.sure_within_m:
            accepted[id(candidate)] = candidate
        elif _suffices(params, state, together, waiting):
            accepted |= {id(c): c for c in together}
        waiting.append(candidate)
    return tuple(accepted.values()), tuple(c for c in waiting if id(c) not in accepted)


def _suffices(
    params: LoopParameters, state: SlamState, together: list[Candidate], waiting: list[Candidate]
) -> bool:
    """Whether they are from enough places, and from more than twice as many as ask for something else."""
    places = {c.node for c in together}
    least = params.agreeing_when_lost if state.mode is SlamMode.LOST else params.agreeing
    agreeing = {id(c) for c in together}
    rivals = {c.node for c in waiting if id(c) not in agreeing} - places
    return len(places) >= max(least, 2 * len(rivals) + 1 if rivals else least)


def _agree(params: LoopParameters, state: SlamState, a: Candidate, b: Candidate) -> bool:
    """Whether two ask for the same correction, judged at the robot's place."""
    here = state.nodes.map[-1]
    one, other = compose(a.correction, here), compose(b.correction, here)
    turn = abs(wrap(one[2:3] - other[2:3])[0])
    near_m = math.hypot(one[0] - other[0], one[1] - other[1])
    return near_m <= params.agree_m and float(turn) <= params.agree_rad
