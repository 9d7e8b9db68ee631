"""What the SLAM knows: values only, that can be saved and gone on with."""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from chefbotd.mapping.graph import NO_EDGES, Edges, Indices
from chefbotd.mapping.local_map import LocalMap, empty, inserted
from chefbotd.mapping.poses import Floats
from chefbotd.mapping.surfaces import Singles


class Scan(NamedTuple):
    """Points (n, 2) in beam order and their normals, in the robot's frame, seen from ``sensor_m`` in it.

    ``sensor_m`` is one place (2,), or one for each point (n, 2), in single precision: several lidars' points follow each
    other.
    """

    points: Singles
    facing: Singles
    sensor_m: Floats | Singles


class SlamMode(StrEnum):
    """How it stands: mapping as it should, the odometry was wrong just now, fits badly for a moment, or lost."""

    MAPPING = "mapping"
    WHEEL_SLIP = "wheel_slip"
    UNCERTAIN = "uncertain"
    LOST = "lost"


@dataclass(frozen=True, slots=True)
class Nodes:
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


NO_NODES = Nodes(
    np.zeros(0, np.int64),
    np.zeros(0),
    np.zeros((0, 3)),
    np.zeros((0, 3)),
    np.zeros(0),
    np.zeros(0, np.int64),
    (),
)


class Submap(NamedTuple):
    """Nodes from ``first`` to ``last``, inclusive; ``first`` is the anchor, in whose frame the submap is."""

    first: int
    last: int


class Active(NamedTuple):
    """A submap that is growing: its first node, the travel since, and its grids in the local frame."""

    first: int
    travel_m: float
    grids: LocalMap


class Candidate(NamedTuple):
    """A place that was recognised but is not believed yet: ``node`` lies at ``pose`` in the frame of ``anchor``.

    ``correction`` is what the map's frame would have to be moved by at the node.
    """

    node: int
    anchor: int
    pose: Floats
    covariance: Floats
    correction: Floats
    drift_m: float


@dataclass(frozen=True, slots=True)
class SlamState:
    """All that the next step needs.

    ``local_pose`` and ``odometry`` are of the last scan. ``active`` are the one or two submaps that grow; the
    grids in it are used up by the next step. ``usual_fit`` is how well scans fitted lately. ``built`` holds grids
    of finished submaps, made again when missing.
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
        grids = inserted(grids, frame[node], scan.sensor_m, scan.points, scan.facing)
    return grids
