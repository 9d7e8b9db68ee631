"""What the SLAM knows: values only, that can be saved and gone on with.

A map may have parts that are not connected: after a kidnapping, or when a saved map is gone on with from anywhere.
"""

import math
from enum import StrEnum

import numpy as np

from chefbotd.components.mapping.algorithms.correlate import ScoredPose, Window, WindowSearch
from chefbotd.components.mapping.algorithms.graph import NO_EDGES, Edges, Indices
from chefbotd.components.mapping.algorithms.local_map import LocalMap, empty, insert_scan
from chefbotd.components.mapping.algorithms.surfaces import Singles
from chefbotd.core.poses import Floats, compose
from chefbotd.core.record import Record, replace


class Scan(Record, frozen=True):
    """Points (n, 2) in beam order and their normals, in the robot's frame, seen from ``sensor_m`` in it.

    ``sensor_m`` is one place (2,), or one for each point (n, 2), in single precision: several lidars' points follow each
    other.
    """

    points: Singles
    facing: Singles
    sensor_m: Floats | Singles


class SlamMode(StrEnum):
    """How it stands: mapping as it should, the odometry was wrong just now, fits badly for a moment, or lost.

    ``searching`` is reported of a robot that is lost while it looks for a known place.
    """

    MAPPING = "mapping"
    WHEEL_SLIP = "wheel_slip"
    UNCERTAIN = "uncertain"
    LOST = "lost"
    SEARCHING = "searching"


class Nodes(Record, frozen=True):
    """The kept scans, a row each.

    ``local`` is where the front end put it, in a frame that never jumps; ``map`` is where the graph puts it.
    ``path_m`` is the way driven until then. Nodes of different ``part`` are not connected (yet). ``number`` never
    changes, while rows move up when others are forgotten.
    """

    number: Indices
    stamp_s: Floats
    local: Floats
    map: Floats
    path_m: Floats
    part: Indices
    scans: tuple[Scan, ...]

    def __len__(self) -> int:
        return len(self.scans)

    def only(self, which: Indices) -> "Nodes":
        """Some of them."""
        scans = tuple([self.scans[row] for row in which])
        number, stamp_s, part = self.number[which], self.stamp_s[which], self.part[which]
        return Nodes(number, stamp_s, self.local[which], self.map[which], self.path_m[which], part, scans)


PART_OF_TARGET = 50_000_000
"""What a target takes that has nothing alike is less: for telling how far a search is."""

NO_NODES = Nodes(
    np.zeros(0, np.int64),
    np.zeros(0),
    np.zeros((0, 3)),
    np.zeros((0, 3)),
    np.zeros(0),
    np.zeros(0, np.int64),
    (),
)


class Submap(Record, frozen=True):
    """Nodes from ``first`` to ``last``, inclusive; ``first`` is the anchor, in whose frame the submap is."""

    first: int
    last: int


class Active(Record, frozen=True):
    """A submap that is growing: its first node, the travel since, and its grids in the local frame."""

    first: int
    travel_m: float
    grids: LocalMap


class Candidate(Record, frozen=True):
    """A place that was recognised but is not believed yet: ``node`` lies at ``pose`` in the frame of ``anchor``.

    ``correction`` is what the map's frame would have to be moved by at the node.
    """

    node: int
    anchor: int
    pose: Floats
    covariance: Floats
    correction: Floats
    drift_m: float


class Target(Record, frozen=True):
    """A submap to search in: where the scan is expected in its frame, how far around, and what drift allows.

    ``drift_m`` is infinite for a robot that is lost: it is searched along the submap's whole path.
    """

    submap: int
    guess: Floats
    window: Window
    drift_m: float


class PlaceSearch(Record, frozen=True):
    """A search of a node's scan in old submaps, under way: so many of the targets are ``done``.

    The first ``again`` of them are those where something was found before.

    Of the next target ``work`` is done; ``search`` is how far that came, made again when missing. ``best`` is what was
    found there, while a second place that fits nearly as well is looked for.
    """

    node: int
    targets: tuple[Target, ...]
    again: int = 0
    done: int = 0
    work: int = 0
    search: WindowSearch | None = None
    best: ScoredPose | None = None

    @property
    def share_done(self) -> float:
        """About how much of it is done, from 0 to 1."""
        part = self.work / max(self.work, PART_OF_TARGET)
        return min((self.done + 0.5 * part) / max(len(self.targets), 1), 1.0)


class SlamState(Record, frozen=True):
    """All that the next step needs.

    ``local_pose`` and ``odometry`` are of the last scan. ``active`` are the one or two submaps that grow; the
    grids in it are used up by the next step. ``usual_fit`` is how well scans fitted lately. ``built`` holds grids
    of finished submaps, made again when missing. ``searching`` is a search for a known place that goes on.
    """

    nodes: Nodes
    edges: Edges
    submaps: tuple[Submap, ...]
    active: tuple[Active, ...]
    local_pose: Floats
    odometry: Floats
    path_m: float
    mode: SlamMode
    misfits: int
    part: int
    tried_at_m: float
    tried: int
    candidates: tuple[Candidate, ...]
    unsolved: int
    next_number: int
    usual_fit: float = 1.0
    built: tuple[tuple[int, LocalMap], ...] = ()
    searching: PlaceSearch | None = None


def start() -> SlamState:
    """Nothing seen yet; the first scan will be at the map's origin."""
    return SlamState(
        nodes=NO_NODES,
        edges=NO_EDGES,
        submaps=(),
        active=(),
        local_pose=np.zeros(3),
        odometry=np.zeros(3),
        path_m=0.0,
        mode=SlamMode.MAPPING,
        misfits=0,
        part=0,
        tried_at_m=-np.inf,
        tried=0,
        candidates=(),
        unsolved=0,
        next_number=0,
    )


def rebuilt(nodes: Nodes, first: int, last: int, frame: Floats) -> LocalMap:
    """The grids of nodes ``first`` to ``last``, which lie at the poses ``frame`` (n, 3)."""
    grids = empty()
    for node in range(first, last + 1):
        scan = nodes.scans[node]
        grids = insert_scan(grids, frame[node], scan.sensor_m, scan.points, scan.facing)
    return grids


def start_new_part(state: SlamState) -> SlamState:
    """Begin a part of its own: the robot may be anywhere, as after a kidnapping or when going on with a saved map.

    A part that was never joined is forgotten.
    """
    last = len(state.nodes) - 1
    ended = tuple(Submap(a.first, last) for a in state.active[:1] if a.first <= last)
    state = replace(state, submaps=state.submaps + ended, active=(), candidates=())
    if state.part:
        state = _without_part(state, state.part)
    return replace(
        state,
        part=state.part + 1,
        active=(Active(len(state.nodes), 0.0, empty()),),
        mode=SlamMode.LOST,
        misfits=0,
        tried_at_m=-math.inf,
        built=(),
        searching=None,
    )


def _without_part(state: SlamState, part: int) -> SlamState:
    """Forget the nodes of a part; they are the last ones."""
    count = int(np.searchsorted(state.nodes.part, part))
    kept = state.edges.only((state.edges.first < count) & (state.edges.second < count))
    submaps = tuple(s for s in state.submaps if s.last < count)
    return replace(state, nodes=state.nodes.only(np.arange(count)), edges=kept, submaps=submaps)


def join_part(state: SlamState, correction: Floats) -> SlamState:
    """Move the part that was apart to where it belongs; its nodes are the map's now."""
    nodes, moved = state.nodes, state.nodes.part == state.part
    poses = np.where(moved[:, None], compose(correction, nodes.map), nodes.map)
    joined = replace(nodes, map=poses, part=np.zeros_like(nodes.part))
    return replace(
        state, nodes=joined, part=0, mode=SlamMode.MAPPING, candidates=(), built=(), searching=None
    )
