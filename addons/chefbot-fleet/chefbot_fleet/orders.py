"""What a robot is sent: its order from where it has it, and what it says of an order that it refuses."""

import math
from itertools import pairwise

from chefbot_vda5050.messages import Action, ActionParameter, BlockingType, Edge, Node, NodePosition, State

from chefbot_fleet.places import AT_NODE_M, DEVIATION_M
from chefbot_fleet.roadmap import Roadmap, distance_to_segment_m
from chefbot_fleet.store import Vehicle
from chefbotd.core.record import Record


class Outgoing(Record, frozen=True):
    """An order to be sent to a robot, still without a header."""

    robot: str
    order_id: str
    update_id: int
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]


class CancelOrder(Record, frozen=True):
    """The instant action ``cancelOrder`` for a robot; the same ``action_id`` again changes nothing."""

    robot: str
    action_id: str


def order_message(vehicle: Vehicle, state: State, roadmap: Roadmap, map_id: str) -> Outgoing:
    """The base from the last node on that the robot has of it."""
    nodes = [vehicle.node, *vehicle.base]
    begin = 0
    if state.order_id == vehicle.order_id:
        released = [node.sequence_id for node in state.node_states if node.released]
        end = max([state.last_node_sequence_id, *released])
        begin = min(max((end - vehicle.sequence) // 2, 0), len(nodes) - 1)
    sequence = vehicle.sequence + 2 * begin
    nodes, is_known = nodes[begin:], state.order_id == vehicle.order_id
    begin_m = DEVIATION_M if is_known else _beginning_m(state, nodes, roadmap)
    parts = tuple(
        _node(vehicle, node, sequence + 2 * k, DEVIATION_M if k else begin_m, roadmap, map_id)
        for k, node in enumerate(nodes)
    )
    edges = tuple(
        Edge(
            edge_id=f"{a}-{b}", sequence_id=sequence + 2 * k + 1, released=True,
            start_node_id=str(a), end_node_id=str(b), actions=(),
        )
        for k, (a, b) in enumerate(pairwise(nodes))
    )  # fmt: skip
    return Outgoing(vehicle.name, vehicle.order_id, vehicle.update_id, parts, edges)


def _beginning_m(state: State, nodes: list[int], roadmap: Roadmap) -> float:
    """How far from its first node a robot may begin: as far as it is, where it stands on the first edge."""
    position = state.agv_position
    if position is None or len(nodes) < 2:
        return AT_NODE_M
    start, end = roadmap.points_m[nodes[0]], roadmap.points_m[nodes[1]]
    point = (position.x, position.y)
    if distance_to_segment_m(point, start, end) > AT_NODE_M:
        return AT_NODE_M
    return max(AT_NODE_M, math.dist(point, start) + DEVIATION_M)


def _node(
    vehicle: Vehicle, node: int, sequence: int, deviation_m: float, roadmap: Roadmap, map_id: str
) -> Node:
    x_m, y_m = roadmap.points_m[node]
    actions: tuple[Action, ...] = ()
    if vehicle.action_id is not None:
        actions = (
            Action(
                action_type="pick" if vehicle.stops_done == 0 else "drop",
                action_id=vehicle.action_id,
                blocking_type=BlockingType.HARD,
                action_parameters=(ActionParameter(key="loadId", value=vehicle.task),),
            ),
        )
    position = NodePosition(x=x_m, y=y_m, map_id=map_id, allowed_deviation_xy=deviation_m)
    return Node(
        node_id=str(node), sequence_id=sequence, released=True, actions=actions, node_position=position
    )


def refusal(state: State, sent: tuple[str, int]) -> str | None:
    """Why a robot does not take the order and update that it was sent, if it says so.

    The error refers to ``orderId`` (6.6.5); where it names an update too, it is about that one alone.
    """
    order_id, update_id = sent
    for error in state.errors:
        about = {one.reference_key: one.reference_value for one in error.error_references or ()}
        if about.get("orderId") == order_id and about.get("orderUpdateId", str(update_id)) == str(update_id):
            return " - ".join(filter(None, (error.error_type, error.error_description)))
    return None
