"""At which node a robot is, whose that is, and whether the robot can be taken into the fleet there."""

import math
from collections.abc import Iterable
from itertools import pairwise

from chefbot_vda5050.messages import ENDED, State

from chefbot_fleet.roadmap import Point, Roadmap, distance_to_segment_m
from chefbot_fleet.store import Vehicle

AT_NODE_M = 1.0
"""A robot that is new, or has lost its order, must be so near a node."""

DEVIATION_M = 0.1
"""So near a node a robot has passed it."""


def nearest_node(state: State, nodes: Iterable[int], roadmap: Roadmap) -> int | None:
    """The node at which a robot is; None: it does not say where it is, or is at none of these."""
    place = _point(state)
    if place is None:
        return None
    node = min(nodes, key=lambda node: math.dist(roadmap.points_m[node], place))
    return node if math.dist(roadmap.points_m[node], place) <= AT_NODE_M else None


def _point(state: State) -> Point | None:
    position = state.agv_position
    return None if position is None or not position.position_initialized else (position.x, position.y)


def place_on_path(state: State, nodes: list[int], roadmap: Roadmap) -> tuple[int, int] | None:
    """How many nodes of a path a robot has passed, and how many it needs ahead: 1 on an edge, 0 at a node.

    None: it does not say where it is, or is beside the path.
    """
    point, path = _point(state), [roadmap.points_m[node] for node in nodes]
    if point is None:
        return None
    nearest = min(range(len(path)), key=lambda k: math.dist(path[k], point))
    if math.dist(path[nearest], point) <= (DEVIATION_M if len(path) > 1 else AT_NODE_M):
        return nearest, 0
    away_m = [distance_to_segment_m(point, *ends) for ends in pairwise(path)]
    if not away_m or min(away_m) > AT_NODE_M:
        return None
    return away_m.index(min(away_m)), 1


def reserved_for(node: int, others: Iterable[Vehicle], roadmap: Roadmap) -> str | None:
    """That a place is another robot's now."""
    for other in others:
        nodes = [other.node, *other.base]
        edges = {edge for a, b in pairwise(nodes) for edge, end in roadmap.exits[a] if end == b}
        if roadmap.nodes_at_node[node] & set(nodes) or roadmap.edges_at_node[node] & edges:
            return f"its place is reserved for {other.name}"
    return None


def why_not_taken(
    state: State,
    node: int | None,
    homes: list[int],
    vehicles: Iterable[Vehicle],
    roadmap: Roadmap,
    map_id: str,
) -> str | None:
    """Why a robot cannot be taken into the fleet; it must stand idle where nobody else is or will be."""
    reported = None if state.agv_position is None else state.agv_position.map_id
    if not homes:
        return "every home is taken"
    if reported is not None and reported != map_id:
        return f"its map is {reported!a}, not {map_id!a}"
    if node is None:
        return f"it is not within {AT_NODE_M} m of a node"
    if state.driving or state.node_states:
        return "it is on its way by an order that is not ours"
    if any(action.action_status not in ENDED for action in state.action_states):
        return "it is at work by an order that is not ours"
    return reserved_for(node, vehicles, roadmap)
