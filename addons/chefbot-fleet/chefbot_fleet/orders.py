"""What a robot is sent: its order from where it has it, and what it says of an order that it refuses."""

from itertools import pairwise

from chefbot_vda5050.messages import Action, ActionParameter, BlockingType, Edge, Node, NodePosition, State

from chefbot_fleet.places import AT_NODE_M
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.store import Vehicle
from chefbotd.core.record import Record

DEVIATION_M = 0.1
"""So near a node a robot has passed it."""


class Outgoing(Record, frozen=True):
    """An order to be sent to a robot, still without a header."""

    robot: str
    order_id: str
    update_id: int
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]


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
    parts = tuple(
        _node(vehicle, node, sequence + 2 * k, DEVIATION_M if k or is_known else AT_NODE_M, roadmap, map_id)
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


def refusal(state: State, order_id: str) -> str | None:
    """Why a robot does not take an order, if it says so (6.6.5: the error refers to ``orderId``)."""
    for error in state.errors:
        references = error.error_references or ()
        if any((one.reference_key, one.reference_value) == ("orderId", order_id) for one in references):
            return " - ".join(filter(None, (error.error_type, error.error_description)))
    return None
