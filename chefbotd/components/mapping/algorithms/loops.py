"""Recognizes places: searches a scan in older submaps, and verifies the match before it counts.

What keeps wrong loops out, in this order: the search reaches three sigmas of the drift and no further; the scan
must fit the submap's surfaces where both know something; no second place in the window may fit nearly as well;
where the drift is large, matches from different places must ask for the same correction, and more of them than
ask for another one (after Olson, "Recognizing places using spectrally clustered local matches", 2009).
"""

import math

import numpy as np

from chefbotd.components.mapping.algorithms import correlate
from chefbotd.components.mapping.algorithms.correlate import (
    Excluded,
    ScoredPose,
    Window,
    WindowSearch,
    advance_window_search,
    for_another,
)
from chefbotd.components.mapping.algorithms.graph import drift_m
from chefbotd.components.mapping.algorithms.local_map import CELL_M, LocalMap
from chefbotd.components.mapping.algorithms.parameters import LoopParameters, SlamParameters
from chefbotd.components.mapping.algorithms.refine import Fit, Prior, polish
from chefbotd.components.mapping.algorithms.state import (
    Candidate,
    PlaceSearch,
    SlamMode,
    SlamState,
    Target,
    rebuilt,
)
from chefbotd.core.poses import Floats, between, compose, inverse, invert, wrap
from chefbotd.core.record import replace

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
AT_ONCE_WHEN_LOST, MORE_WHEN_FOUND = 8, 4
"""So many submaps are searched with each scan, and so many more than those in which something was found before."""

POINTS, POINTS_WHEN_LOST = 90, 45

NEAR_PATH_M = 3.0
"""A robot that is lost is looked for so far from where it was before."""

LOOKUPS_A_METRE = 150
"""What it takes to draw a metre of a beam into a submap's grids."""


def is_due(params: LoopParameters, state: SlamState) -> bool:
    """Whether the robot has gone far enough to look again."""
    return state.path_m - state.tried_at_m >= params.every_m and len(state.submaps) > 0


def start_place_search(params: LoopParameters, state: SlamState) -> SlamState:
    """Search the last node's scan in older submaps, from now on; nothing is computed yet."""
    targets, again = _lost_targets(state) if state.part else (_targets(params, state), 0)
    search = PlaceSearch(len(state.nodes) - 1, tuple(targets), again)
    return replace(state, tried_at_m=state.path_m, searching=search)


def advance_place_search(
    params: SlamParameters, state: SlamState, search: PlaceSearch
) -> tuple[SlamState, tuple[Candidate, ...]]:
    """The search a bounded bit further, and the verified matches of that; once it is over, the state is without it.

    The state has the grids that were built for it.
    """
    left, candidates, again = params.loops.lookups_a_step, list[Candidate](), search.again
    while left > 0 and search.done < len(search.targets):
        state, search, used, candidate = _advance_in_submap(params, state, search, left)
        candidates += [] if candidate is None else [candidate]
        left -= used
    if search.done < len(search.targets):
        return replace(state, searching=search), tuple(candidates)
    tried = state.tried + len(search.targets) - again
    return replace(state, tried=tried, searching=None), tuple(candidates)


def _targets(params: LoopParameters, state: SlamState) -> list[Target]:
    """The submaps nearest to the last node that it may lie in, and that it did not just come from."""
    nodes, last = state.nodes, len(state.nodes) - 1
    here = nodes.map[last]
    lever_m = max(float(np.hypot(*np.ptp(nodes.map[:, :2], axis=0))) / 2, LEAST_LEVER_M)
    sigma = drift_m(len(nodes), state.edges, last, lever_m)
    away = np.hypot(nodes.map[:, 0] - here[0], nodes.map[:, 1] - here[1])
    ranked = []
    for k, submap in enumerate(state.submaps):
        first, end = submap.first, submap.last
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


def _lost_targets(state: SlamState) -> tuple[list[Target], int]:
    """Everywhere along the known paths: where something was found before, then some more each time, in a circle.

    How many are to be searched again comes with them.
    """
    joined_submaps = [k for k, submap in enumerate(state.submaps) if state.nodes.part[submap.first] == 0]
    if not joined_submaps:
        return [], 0
    by_anchor = {state.submaps[k].first: k for k in joined_submaps}
    again = dict.fromkeys(by_anchor[c.anchor] for c in state.candidates if c.anchor in by_anchor)
    more = MORE_WHEN_FOUND if again else AT_ONCE_WHEN_LOST
    turn = [
        joined_submaps[(state.tried + k) % len(joined_submaps)] for k in range(min(more, len(joined_submaps)))
    ]
    targets = []
    for k in [*again, *(k for k in turn if k not in again)]:
        path = _path(state, k)
        low, high = path.min(axis=0), path.max(axis=0)
        guess = np.array([*(low + high) / 2, 0.0])
        half_m = float((high - low).max()) / 2 + NEAR_PATH_M
        targets.append(Target(k, guess, Window(half_m, math.pi), math.inf))
    return targets, len(targets) - len(turn)


def _path(state: SlamState, submap: int) -> Floats:
    """The places (n, 2) of a submap's nodes, in the frame of its anchor."""
    first, last = state.submaps[submap].first, state.submaps[submap].last
    path: Floats = between(state.nodes.map[first], state.nodes.map[first : last + 1])[:, :2]
    return path


def _grids(state: SlamState, submap: int) -> tuple[SlamState, LocalMap]:
    """The grids of a submap in the frame of its anchor, built from its scans at the graph's poses."""
    for k, grids in state.built:
        if k == submap:
            return state, grids
    first, last = state.submaps[submap].first, state.submaps[submap].last
    grids = rebuilt(state.nodes, first, last, between(state.nodes.map[first], state.nodes.map))
    return replace(state, built=(*state.built[-BUILT_AT_MOST + 1 :], (submap, grids))), grids


def _advance_in_submap(
    params: SlamParameters, state: SlamState, search: PlaceSearch, lookups: int
) -> tuple[SlamState, PlaceSearch, int, Candidate | None]:
    """The search in one submap further by about so much work; also how much it was, and the match that it ends with.

    First the best pose is found there, then another that fits nearly as well: that would make the match ambiguous.
    """
    target, best, until = search.targets[search.done], search.best, search.work + lookups
    within = search.search
    if within is None:  # it begins, or goes on after a restart: then what was done is done again
        state, within = _in_submap(params.loops, state, search.node, target)
        best = None
    candidate = None
    while True:
        within = advance_window_search(within, until - within.work)
        if not within.is_done:
            used = within.work - search.work
            return state, replace(search, work=within.work, search=within, best=best), used, None
        match = within.best_pose
        if best is None and match is not None:
            candidate = _verify_match(params, state, search.node, target, within.within.grids, match)
            if candidate is not None and target.drift_m > params.loops.sure_within_m:
                best, within = match, for_another(within, *_rival(params.loops, match))
                continue
        elif best is not None:
            candidate = None
            if match is None:
                candidate = _verify_match(params, state, search.node, target, within.within.grids, best)
        done = replace(search, done=search.done + 1, work=0, search=None, best=None)
        return state, done, within.work - search.work, candidate


def _in_submap(
    params: LoopParameters, state: SlamState, node: int, target: Target
) -> tuple[SlamState, WindowSearch]:
    """The search for a node's scan in a submap; building its grids counts as work."""
    state, grids = _grids(state, target.submap)
    is_lost = math.isinf(target.drift_m)
    search = correlate.start_window_search(
        grids,
        state.nodes.scans[node].points,
        target.guess,
        target.window,
        above=params.min_score_when_lost if is_lost else params.min_score,
        near=_path(state, target.submap) if is_lost else None,
        near_m=NEAR_PATH_M,
        points_at_most=POINTS_WHEN_LOST if is_lost else POINTS,
        turn_m=(2 if is_lost else 1) * CELL_M,
    )
    submap = state.submaps[target.submap]
    scans = state.nodes.scans[submap.first : submap.last + 1]
    beams_m = sum(float(np.hypot(*scan.points.T).sum()) for scan in scans)
    search.at[2] += int(beams_m * LOOKUPS_A_METRE)
    return state, search


def _verify_match(
    params: SlamParameters, state: SlamState, node: int, target: Target, grids: LocalMap, match: ScoredPose
) -> Candidate | None:
    """The match, if the scan fits there and tells where it is."""
    scan, start = state.nodes.scans[node], Prior(match.pose, FREE)
    fit = polish(grids, scan.points, scan.facing, match.pose, start, params.matching.laser_noise_m)
    covariance = loop_covariance(fit)
    if not is_sound(params.loops, fit, match.pose) or covariance[0, 0] + covariance[1, 1] > VAGUE_M**2:
        return None
    anchor = state.submaps[target.submap].first
    seen_at = compose(state.nodes.map[anchor], fit.pose)
    correction = compose(seen_at, inverse(state.nodes.map[node]))
    return Candidate(node, anchor, fit.pose, covariance, correction, target.drift_m)


def _rival(params: LoopParameters, match: ScoredPose) -> tuple[float, Excluded]:
    """What another place must score to make a match ambiguous, and what is not another place."""
    x, y, heading = match.pose
    return params.rival_score * match.score, Excluded(float(x), float(y), float(heading), RIVAL_M, RIVAL_RAD)


def loop_covariance(fit: Fit) -> Floats:
    """How surely the match is known: by its information, and by how straight a submap is."""
    covariance = invert(fit.information + 1e-3 * np.eye(3))
    return covariance + np.diag([LOOP_SIGMA_M**2, LOOP_SIGMA_M**2, LOOP_SIGMA_RAD**2])


def is_sound(params: LoopParameters, fit: Fit, start: Floats) -> bool:
    """Whether enough of the scan lies where the submap knows something, fits there, and polishing kept it near."""
    moved_m = math.hypot(fit.pose[0] - start[0], fit.pose[1] - start[1])
    return (
        fit.overlap >= params.min_overlap and fit.share >= params.min_share and moved_m <= MOVED_BY_POLISH_M
    )


def accept_candidates(
    params: LoopParameters, state: SlamState, new: tuple[Candidate, ...]
) -> tuple[tuple[Candidate, ...], tuple[Candidate, ...]]:
    """Which candidates, old and new, may close their loops now, and which still wait for others that agree."""
    oldest_m = state.path_m - params.remembered_m
    waiting = [c for c in state.candidates if state.nodes.path_m[c.node] >= oldest_m]
    accepted: dict[int, Candidate] = {}
    for candidate in new:
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
