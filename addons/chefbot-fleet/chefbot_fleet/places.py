"""At which node a robot is, whose that is, and whether the robot can be taken into the fleet there."""

import math
from collections.abc import Iterable
from itertools import pairwise

from chefbot_vda5050.messages import ENDED, State

from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.store import Vehicle

AT_NODE_M = 1.0
"""A robot that is new, or has lost its order, must be so near a node."""


def nearest_node(state: State, nodes: Iterable[int], roadmap: Roadmap) -> int | None:
    """The node at which a robot is; None: it does not say where it is, or is at none of these."""
    position = state.agv_position
    if position is None or not position.position_initialized:
        return None
    place = (position.x, position.y)
    node = min(nodes, key=lambda node: math.dist(roadmap.points_m[node], place))
    return node if math.dist(roadmap.points_m[node], place) <= AT_NODE_M else None


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
