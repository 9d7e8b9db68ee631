"""Saves SLAM's state as a dictionary of arrays, from which the same steps follow, bit for bit."""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.mapping.algorithms.correlate import Window
from chefbotd.components.mapping.algorithms.graph import Edges
from chefbotd.components.mapping.algorithms.local_map import empty, insert_scan
from chefbotd.components.mapping.algorithms.state import (
    Active,
    Candidate,
    Nodes,
    PlaceSearch,
    Scan,
    SlamMode,
    SlamState,
    Submap,
    Target,
)
from chefbotd.components.mapping.algorithms.surfaces import Singles, normals
from chefbotd.core.poses import Floats

Arrays: TypeAlias = dict[str, NDArray[Any]]

FORMAT = 1


class NotASavedState(ValueError):
    """The arrays are not what ``save_state`` makes: something is missing, of another format, or does not fit."""


def save_state(state: SlamState) -> Arrays:
    """All of a state but what can be made again: the grids, and the normals of the scans."""
    nodes, edges, candidates = state.nodes, state.edges, state.candidates
    sizes = [len(scan.points) for scan in nodes.scans]
    empty_points, no_places, no_poses = np.zeros((0, 2), np.float32), np.zeros((0, 2)), np.zeros((0, 3))
    arrays: Arrays = {
        "format": np.array(FORMAT),
        "scan_sizes": np.array(sizes, np.int64),
        "scan_points": np.concatenate([empty_points, *(scan.points for scan in nodes.scans)]),
        "scan_sensors": np.concatenate([no_places, *(np.atleast_2d(scan.sensor_m) for scan in nodes.scans)]),
        "sensor_sizes": np.array([len(np.atleast_2d(scan.sensor_m)) for scan in nodes.scans], np.int64),
        "submaps": np.array([[s.first, s.last] for s in state.submaps], np.int64).reshape(-1, 2),
        "active": np.array([[a.first, a.travel_m] for a in state.active]).reshape(-1, 2),
        "candidates": np.array([[c.node, c.anchor, c.drift_m] for c in candidates]).reshape(-1, 3),
        "candidate_poses": np.stack([*(c.pose for c in candidates)]) if candidates else no_poses,
        "candidate_corrections": np.stack([*(c.correction for c in candidates)]) if candidates else no_poses,
        "candidate_covariances": np.array([c.covariance for c in candidates]).reshape(-1, 3, 3),
        "local_pose": state.local_pose,
        "odometry": state.odometry,
        "path_m": np.array([state.path_m, state.tried_at_m]),
        "usual_fit": np.array(state.usual_fit),
        "mode": np.array(str(state.mode)),
        "counts": np.array([state.misfits, state.part, state.tried, state.unsolved, state.next_number]),
    }
    if state.searching is not None:
        arrays |= _saved_search(state.searching)
    arrays |= {f"node_{name}": getattr(nodes, name) for name in NODE_FIELDS}
    arrays |= {f"edge_{name}": getattr(edges, name) for name in EDGE_FIELDS}
    return arrays


def _saved_search(search: PlaceSearch) -> Arrays:
    """What is left of a search, and how far it came."""
    left = [[t.submap, *t.guess, *t.window, t.drift_m] for t in search.targets]
    return {
        "search": np.array([search.node, search.again, search.done, search.work], np.int64),
        "search_targets": np.array(left).reshape(-1, 9),
    }


def _search(arrays: Mapping[str, NDArray[Any]]) -> PlaceSearch | None:
    if "search" not in arrays:
        return None
    node, again, done, work = (int(number) for number in arrays["search"])
    targets = tuple(
        Target(int(submap), np.array(rest[:3]), Window(*(float(size) for size in rest[3:7])), float(rest[7]))
        for submap, *rest in arrays["search_targets"]
    )
    return PlaceSearch(node, targets, again, done, work)


NODE_FIELDS = ("number", "stamp_s", "local", "map", "path_m", "part")
EDGE_FIELDS = ("first", "second", "pose", "information", "spread", "loop")
RENAMED_MODES = {"slipped": "wheel_slip", "doubtful": "uncertain"}
"""Modes in files of earlier versions, and their names today."""


def restore_state(arrays: Mapping[str, NDArray[Any]]) -> SlamState:
    """The state that was saved.

    Raises:
        NotASavedState: with what is wrong.
    """
    try:
        if int(arrays["format"]) != FORMAT:
            raise NotASavedState(f"a saved state has format {FORMAT}, got {int(arrays['format'])}")
        return _restore_arrays(arrays)
    except KeyError as missing:
        raise NotASavedState(f"a saved state has an array {missing}, which is missing") from missing
    except (IndexError, TypeError) as error:
        raise NotASavedState(f"the arrays of the saved state do not fit together: {error}") from error


def _restore_arrays(arrays: Mapping[str, NDArray[Any]]) -> SlamState:
    nodes = _nodes(arrays)
    misfits, part, tried, unsolved, next_number = (int(count) for count in arrays["counts"])
    path_m, tried_at_m = (float(length_m) for length_m in arrays["path_m"])
    return SlamState(
        nodes=nodes,
        edges=Edges(*(arrays[f"edge_{name}"] for name in EDGE_FIELDS)),
        submaps=tuple(Submap(int(first), int(last)) for first, last in arrays["submaps"]),
        active=tuple(_active(nodes, int(first), float(travel_m)) for first, travel_m in arrays["active"]),
        local_pose=arrays["local_pose"],
        odometry=arrays["odometry"],
        path_m=path_m,
        mode=SlamMode(RENAMED_MODES.get(mode := str(arrays["mode"]), mode)),
        misfits=misfits,
        part=part,
        tried_at_m=tried_at_m,
        tried=tried,
        candidates=_candidates(arrays),
        unsolved=unsolved,
        next_number=next_number,
        usual_fit=float(arrays["usual_fit"]),
        searching=_search(arrays),
    )


def _nodes(arrays: Mapping[str, NDArray[Any]]) -> Nodes:
    ends = np.cumsum(arrays["scan_sizes"])
    if len(ends) and ends[-1] != len(arrays["scan_points"]):
        raise NotASavedState(f"the scans have {ends[-1]} points, but {len(arrays['scan_points'])} are saved")
    scans = [
        Scan(points, normals(points, sensor_m), sensor_m)
        for points, sensor_m in zip(
            np.split(arrays["scan_points"], ends[:-1]), _sensors(arrays), strict=False
        )
    ]
    fields = [arrays[f"node_{name}"] for name in NODE_FIELDS]
    if any(len(field) != len(scans) for field in fields):
        raise NotASavedState(
            f"each node has a scan: {[len(field) for field in fields]} nodes, {len(scans)} scans"
        )
    number, stamp_s, local, placed, path_m, part = fields
    return Nodes(number, stamp_s, local, placed, path_m, part, tuple(scans))


def _sensors(arrays: Mapping[str, NDArray[Any]]) -> list[Floats | Singles]:
    """Where each scan was seen from: one place, or one for each point."""
    places = arrays["scan_sensors"]
    sizes = arrays.get("sensor_sizes", np.ones(len(places), np.int64))  # an older file has one for each scan
    split = np.split(places, np.cumsum(sizes)[:-1]) if len(sizes) else []
    for sensor_m, points in zip(split, arrays["scan_sizes"], strict=False):
        if len(sensor_m) not in (1, points):
            raise NotASavedState(f"a scan of {points} points was seen from {len(sensor_m)} places")
    return [sensor_m[0] if len(sensor_m) == 1 else sensor_m.astype(np.float32) for sensor_m in split]


def _active(nodes: Nodes, first: int, travel_m: float) -> Active:
    """A growing submap, with its grids filled again, scan by scan as at the first time."""
    grids = empty()
    for node in range(first, len(nodes)):
        scan = nodes.scans[node]
        grids = insert_scan(grids, nodes.local[node], scan.sensor_m, scan.points, scan.facing)
    return Active(first, travel_m, grids)


def _candidates(arrays: Mapping[str, NDArray[Any]]) -> tuple[Candidate, ...]:
    rows = zip(
        arrays["candidates"],
        arrays["candidate_poses"],
        arrays["candidate_covariances"],
        arrays["candidate_corrections"],
        strict=True,
    )
    return tuple(
        Candidate(int(node), int(anchor), pose, covariance, correction, float(drift_m))
        for (node, anchor, drift_m), pose, covariance, correction in rows
    )
