"""Simultaneous localization and mapping, a pure step per scan: the same input gives the same map, bit for bit.

A scan is matched against a submap of the last metres' travel (``tracking``). If the robot moved since the last
kept scan, it becomes a node of the graph, bound to the node before and to its submap's anchor. Now and then the
last node is searched in older submaps (``loops``); what is believed becomes a loop, and the graph is solved.
Where scans cease to fit, nothing is added: what follows is kept apart, and joined once its place is recognised.
"""

import math

import numpy as np

from chefbotd.components.mapping.algorithms.forget import Forgotten, thin_scans
from chefbotd.components.mapping.algorithms.graph import (
    NO_EDGES,
    REJECTED_BELOW,
    SCALE,
    Edges,
    edge,
    optimise_graph,
    squared_errors,
    weights,
)
from chefbotd.components.mapping.algorithms.local_map import empty, insert_scan
from chefbotd.components.mapping.algorithms.loops import (
    accept_candidates,
    advance_place_search,
    is_due,
    start_place_search,
)
from chefbotd.components.mapping.algorithms.parameters import SlamParameters, SubmapParameters
from chefbotd.components.mapping.algorithms.state import (
    Active,
    Candidate,
    Nodes,
    Scan,
    SlamMode,
    SlamState,
    Submap,
    join_part,
    start_new_part,
)
from chefbotd.components.mapping.algorithms.tracking import ScanMatch, track_scan
from chefbotd.core.poses import Floats, between, compose, turn_covariance
from chefbotd.core.record import Record, replace

TURN_M_PER_RAD = 0.5
"""What a turn counts for as travel."""

USUAL_RATE = 0.05
"""How fast the fit of the last scans becomes the usual one."""

STEP_SIGMA_M, STEP_SIGMA_RAD = 0.005, 0.002
"""How well a step is known at best, whatever the match says: its errors are not all independent."""

NEEDS_SOLVING = 6.0
"""A loop that is off by more (squared, normalised) has the graph solved at once; else it waits for others."""

UNSOLVED_AT_MOST = 20

FARTHEST_M = 100.0
"""No lidar that we know sees further, and the grids grow with what is inserted."""


class SlamReport(Record, frozen=True):
    """What a step found: where the robot is in the map, how surely, and how well the scan fits (0 to 1).

    ``overlap`` is how much of the scan lay on known ground. ``node`` is the number of the last kept scan, and
    ``node_from_base`` the pose as seen from it: to place this scan again once the graph has been solved.
    ``forgotten`` are nodes that are no more. ``searched`` is the share that is done of a search for a known place.
    """

    mode: SlamMode
    map_pose: Floats
    covariance: Floats
    fit: float
    overlap: float
    node: int
    node_from_base: Floats
    kept: bool
    loops: int
    solved: bool
    forgotten: tuple[Forgotten, ...] = ()
    searched: float = 0.0


class _Kept(Record, frozen=True):
    state: SlamState
    loops: int = 0
    solved: bool = False
    forgotten: tuple[Forgotten, ...] = ()


def step(
    params: SlamParameters,
    state: SlamState,
    stamp_s: float,
    odometry: Floats,
    scan: Scan,
    noise: Floats | None = None,
) -> tuple[SlamState, SlamReport]:
    """Take in a scan; ``odometry`` is the pose of the robot in any frame that does not jump. Uses up ``state``.

    ``noise`` (3, 3) is what odometry thinks of the motion since the scan before; it makes the search wider, never
    narrower.

    Raises:
        ValueError: a pose or a point is not finite or further away than any lidar sees, or the arrays do not fit.
    """
    _check(odometry, scan)
    if not len(state.nodes):
        state = replace(state, odometry=odometry.copy(), active=(Active(0, 0.0, empty()),))
        first = _with_node(params.submaps, state, stamp_s, scan, None)
        return first, _report(first, None, _Kept(first), kept=True)
    moved = between(state.odometry, odometry)
    track = track_scan(
        params.matching, state.active[0].grids, state.local_pose, moved, scan, state.usual_fit, noise
    )
    if not track.fits or (state.misfits and track.fit.overlap < params.matching.min_overlap):
        return _misfit(params, state, stamp_s, odometry, scan, track)
    travel_m = _travel_m(between(state.local_pose, track.fit.pose))
    mode = SlamMode.WHEEL_SLIP if track.slipped else SlamMode.LOST if state.part else SlamMode.MAPPING
    state = replace(
        state,
        local_pose=track.fit.pose,
        odometry=odometry.copy(),
        path_m=state.path_m + travel_m,
        active=tuple(replace(a, travel_m=a.travel_m + travel_m) for a in state.active),
        mode=mode,
        misfits=0,
        usual_fit=state.usual_fit + USUAL_RATE * (track.fit.share - state.usual_fit),
    )
    kept = _is_keyframe(params.submaps, state)
    forgotten: tuple[Forgotten, ...] = ()
    if kept:
        state = _with_node(params.submaps, state, stamp_s, scan, track)
        state, forgotten = _roll_submaps(params.submaps, state)
    result = replace(_looked_around(params, state, kept=kept), forgotten=forgotten)
    return result.state, _report(result.state, track, result, kept=kept)


def _check(odometry: Floats, scan: Scan) -> None:
    if odometry.shape != (3,) or not np.isfinite(odometry).all():
        raise ValueError(f"odometry is three finite numbers (x, y, heading), got {odometry.tolist()}")
    if scan.points.dtype != np.float32 or scan.points.shape != scan.facing.shape:
        got = f"{scan.points.dtype} {scan.points.shape} and {scan.facing.shape}"
        raise ValueError(f"points and normals are float32 arrays of one shape, got {got}")
    if not (np.abs(scan.points) <= FARTHEST_M).all():
        worst = scan.points[~(np.abs(scan.points) <= FARTHEST_M)][0]
        raise ValueError(f"points are within {FARTHEST_M:g} m of the robot, got {worst:g}")


def map_from_local(state: SlamState, local_pose: Floats) -> Floats:
    """A pose of the front end's frame in the map, by the last node."""
    return compose(state.nodes.map[-1], between(state.nodes.local[-1], local_pose))


def _travel_m(motion: Floats) -> float:
    return math.hypot(motion[0], motion[1]) + TURN_M_PER_RAD * abs(float(motion[2]))


def _is_keyframe(params: SubmapParameters, state: SlamState) -> bool:
    since = between(state.nodes.local[-1], state.local_pose)
    far = math.hypot(since[0], since[1]) >= params.keyframe_m
    return far or abs(float(since[2])) >= params.keyframe_rad


def _misfit(
    params: SlamParameters, state: SlamState, stamp_s: float, odometry: Floats, scan: Scan, track: ScanMatch
) -> tuple[SlamState, SlamReport]:
    """The scan contradicts the map: go by odometry and add nothing; after some of these, begin a part of its own."""
    moved = between(state.odometry, odometry)
    mode = SlamMode.LOST if state.part else SlamMode.UNCERTAIN
    state = replace(
        state,
        local_pose=compose(state.local_pose, moved),
        odometry=odometry.copy(),
        path_m=state.path_m + _travel_m(moved),
        misfits=state.misfits + 1,
        mode=mode,
    )
    if state.misfits < params.matching.lost_after_scans:
        return state, _report(state, track, _Kept(state), kept=False)
    state = start_new_part(state)
    state = _with_node(params.submaps, state, stamp_s, scan, None)
    result = _looked_around(params, state)
    return result.state, _report(result.state, track, result, kept=True)


def _with_node(
    params: SubmapParameters, state: SlamState, stamp_s: float, scan: Scan, track: ScanMatch | None
) -> SlamState:
    """Keep the scan: a node, edges to the node before and to the submap's anchor, and its place in the grids."""
    nodes, node = state.nodes, len(state.nodes)
    placed = map_from_local(state, state.local_pose) if node else state.local_pose
    grown = Nodes(
        np.append(nodes.number, state.next_number),
        np.append(nodes.stamp_s, stamp_s),
        np.vstack([nodes.local, state.local_pose]),
        np.vstack([nodes.map, placed]),
        np.append(nodes.path_m, state.path_m),
        np.append(nodes.part, state.part),
        (*nodes.scans, scan),
    )
    edges = state.edges
    if track is not None:
        course = _course(params, grown, node - 1, track.covariance)
        if state.active[0].first < node - 1:
            course = course.joined(_course(params, grown, state.active[0].first, track.covariance))
        edges = edges.joined(course)
    active = tuple(
        replace(a, grids=insert_scan(a.grids, state.local_pose, scan.sensor_m, scan.points, scan.facing))
        for a in state.active
    )
    return replace(state, nodes=grown, edges=edges, active=active, next_number=state.next_number + 1)


def _course(params: SubmapParameters, nodes: Nodes, first: int, covariance: Floats) -> Edges:
    """The edge from an earlier node to the last one: as surely as it matched, and less the longer the way."""
    way_m = nodes.path_m[-1] - nodes.path_m[first]
    place = STEP_SIGMA_M**2 + params.drift_m_per_root_m**2 * way_m
    heading = STEP_SIGMA_RAD**2 + params.drift_rad_per_root_m**2 * way_m
    seen = turn_covariance(covariance, -float(nodes.local[first, 2]))
    grown = seen + np.diag([place, place, heading])
    return edge(first, len(nodes) - 1, between(nodes.local[first], nodes.local[-1]), grown, loop=False)


def _roll_submaps(params: SubmapParameters, state: SlamState) -> tuple[SlamState, tuple[Forgotten, ...]]:
    """Begin the next submap when the growing one is half done, and end it when it is; then forget what is too much."""
    active, submaps = state.active, state.submaps
    last = len(state.nodes) - 1
    if len(active) == 1 and active[0].travel_m >= params.length_m / 2:
        scan = state.nodes.scans[last]
        grids = insert_scan(empty(), state.local_pose, scan.sensor_m, scan.points, scan.facing)
        active = (*active, Active(last, 0.0, grids))
    if active[0].travel_m < params.length_m:
        return replace(state, active=active), ()
    ended = (*submaps, Submap(active[0].first, last))
    return thin_scans(replace(state, active=active[1:], submaps=ended), params.max_scans_per_place)


def _looked_around(params: SlamParameters, state: SlamState, *, kept: bool = True) -> _Kept:
    """Search older submaps if it is time, close the loops that are believed, and solve the graph if that pays."""
    if kept and state.searching is None and is_due(params.loops, state):
        state = start_place_search(params.loops, state)
    if state.searching is None:
        return _Kept(state)
    state, candidates = advance_place_search(params, state, state.searching)
    if not candidates:
        return _Kept(state)
    accepted, waiting = accept_candidates(params.loops, state, candidates)
    state = replace(state, candidates=waiting)
    if not accepted:
        return _Kept(state)
    if state.part:
        state = join_part(state, accepted[-1].correction)
    return close_loops(state, accepted)


def close_loops(state: SlamState, accepted: tuple[Candidate, ...]) -> _Kept:
    """The state with these loops in its graph, which is solved if they are off by much or if there are many."""
    new = NO_EDGES
    for c in accepted:
        new = new.joined(edge(c.anchor, c.node, c.pose, c.covariance, loop=True))
    squared = squared_errors(state.nodes.map, new)
    count = len(new)
    state = replace(state, edges=state.edges.joined(new), unsolved=state.unsolved + count)
    if squared.max() < NEEDS_SOLVING and state.unsolved < UNSOLVED_AT_MOST:
        return _Kept(state, loops=count)
    return _Kept(solve_graph(state, max(SCALE, float(squared.max()))), loops=count, solved=True)


def solve_graph(state: SlamState, scale: float = SCALE) -> SlamState:
    """The state with the graph's poses made to fit; loops that do not are taken out, and it is solved without them."""
    fixed = np.unique(state.nodes.part, return_index=True)[1]
    poses, edges = optimise_graph(state.nodes.map, state.edges, fixed, scale), state.edges
    good = ~edges.loop | (weights(squared_errors(poses, edges), edges.loop, SCALE) >= REJECTED_BELOW)
    if not good.all():
        edges = edges.only(good)
        poses = optimise_graph(poses, edges, fixed)
    nodes = replace(state.nodes, map=poses)
    return replace(state, nodes=nodes, edges=edges, candidates=(), unsolved=0, built=(), searching=None)


def _report(state: SlamState, track: ScanMatch | None, result: _Kept, *, kept: bool) -> SlamReport:
    from_node = between(state.nodes.local[-1], state.local_pose)
    map_pose = compose(state.nodes.map[-1], from_node)
    turn_rad = float(map_pose[2] - state.local_pose[2])
    return SlamReport(
        mode=SlamMode.SEARCHING if state.mode is SlamMode.LOST and state.searching else state.mode,
        map_pose=map_pose,
        covariance=turn_covariance(track.covariance, turn_rad) if track else np.zeros((3, 3)),
        fit=track.fit.share if track else 1.0,
        overlap=track.fit.overlap if track else 0.0,
        node=int(state.nodes.number[-1]),
        node_from_base=from_node,
        kept=kept,
        loops=result.loops,
        solved=result.solved,
        forgotten=result.forgotten,
        searched=state.searching.share_done if state.searching else 0.0,
    )
