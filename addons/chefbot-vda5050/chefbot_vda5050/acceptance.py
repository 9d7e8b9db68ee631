"""Whether a robot accepts an order: the decisions of 6.6.2 (figure 8), as a function of values.

Optional fields that this robot cannot obey are refused, as 6.1.1 asks for: it drives freely between nodes, so it follows
no trajectory and keeps to no corridor.
"""

from collections import Counter
from collections.abc import Iterable
from enum import StrEnum

from chefbot_vda5050 import actions
from chefbot_vda5050.messages import Action, Edge, Node, Order
from chefbot_vda5050.problems import Problem, Reason
from chefbot_vda5050.vehicle import FOR_ORDERS, LEAST_SPEED_M_S, Facts, Limits, Phase, Vehicle


class Accepted(StrEnum):
    """As what an order is accepted; ``REPEATED``: it is known already, and nothing changes."""

    NEW = "new"
    UPDATE = "update"
    REPEATED = "repeated"


MOST_NODES = MOST_ACTIONS = 1000
"""Of an order: what is decided about it takes time, and a stop must not wait for that."""


def judge(vehicle: Vehicle, order: Order, facts: Facts, limits: Limits) -> Accepted | Problem:
    """What becomes of an order that has arrived in time."""
    about = (("orderId", order.order_id), ("orderUpdateId", str(order.order_update_id)))
    judged = _kind(vehicle, order) if vehicle.order_id == order.order_id else Accepted.NEW
    if (malformed := structure_problem(order)) is not None:
        judged = Problem(Reason.MALFORMED, malformed)
    elif judged is Accepted.NEW:
        judged = _new(vehicle, order, facts, limits)
    if not isinstance(judged, Problem) and judged is not Accepted.REPEATED:
        judged = _able(order, facts, limits, judged) or judged
    if isinstance(judged, Problem):
        return Problem(judged.reason, judged.text, (("topic", "order"), *about, *judged.references))
    return judged


def _kind(vehicle: Vehicle, order: Order) -> Accepted | Problem:
    """An order of the known id: an update, the same once more, or neither."""
    known = vehicle.order
    assert known is not None  # noqa: S101 - there is an order with this id
    if order.order_update_id < known.order_update_id:
        text = f"update {order.order_update_id} is older than {known.order_update_id}, which the robot has"
        return Problem(Reason.OUTDATED_UPDATE, text)
    if order.order_update_id == known.order_update_id:
        if content(order) == content(known):
            return Accepted.REPEATED
        return Problem(
            Reason.SAME_UPDATE, f"update {order.order_update_id} came already with another content"
        )
    if vehicle.phase in (Phase.CANCELLING, Phase.CANCELLED):
        return Problem(Reason.CANCELLED_ORDER, f"order {order.order_id!a} was cancelled")
    return _continues(vehicle, order)


def _continues(vehicle: Vehicle, order: Order) -> Accepted | Problem:
    decision, first = vehicle.decision, order.nodes[0] if order.nodes else None
    if decision is None or first is None:
        return Accepted.UPDATE  # its structure is refused
    if (first.node_id, first.sequence_id) != (decision.node_id, decision.sequence_id):
        text = (
            f"it begins at {first.node_id!a} ({first.sequence_id}), "
            f"and the base ends at {decision.node_id!a} ({decision.sequence_id})"
        )
        return Problem(Reason.NO_CONTINUATION, text, (("nodeId", first.node_id),))
    known = {action.action_id for action in decision.actions}
    added = [action.action_id for action in first.actions if action.action_id not in known]
    if added:
        text = f"it adds actions to node {first.node_id!a}, which is released and cannot change"
        return Problem(Reason.NO_CONTINUATION, text, tuple(("actionId", one) for one in added))
    return Accepted.UPDATE


def _new(vehicle: Vehicle, order: Order, facts: Facts, limits: Limits) -> Accepted | Problem:
    if vehicle.phase in (Phase.ACTIVE, Phase.CANCELLING):
        return Problem(Reason.OTHER_ORDER, f"order {vehicle.order_id!a} is not finished")
    if facts.mode not in FOR_ORDERS:
        return Problem(Reason.NOT_AVAILABLE, f"the operating mode is {facts.mode}")
    if not facts.connected:
        return Problem(Reason.NOT_AVAILABLE, facts.missing or "the robot cannot be reached")
    first = order.nodes[0]
    position = first.node_position
    if position is None:
        return Accepted.NEW  # refused with the other nodes
    if not facts.localized:
        return Problem(Reason.START_OUT_OF_RANGE, "the robot does not know where it is")
    if position.map_id != facts.map_id:
        return _unknown_map(first.node_id, position.map_id, facts)
    allowed_m = max(position.allowed_deviation_xy or 0.0, limits.start_tolerance_m)
    distance_m = facts.distance_m(position)
    if distance_m > allowed_m:
        text = f"the robot is {distance_m:.2f} m from node {first.node_id!a}, more than {allowed_m:.2f} m"
        return Problem(Reason.START_OUT_OF_RANGE, text, (("nodeId", first.node_id),))
    return Accepted.NEW


def content(order: Order) -> tuple[object, ...]:
    """An order without its header: what makes it the same as another."""
    return (order.order_id, order.order_update_id, order.zone_set_id, order.nodes, order.edges)


def structure_problem(order: Order) -> str | None:
    """What is wrong with the order's form (6.6.1); None: nothing is."""
    nodes, edges = order.nodes, order.edges
    if not nodes:
        return "there is no node"
    if len(nodes) > MOST_NODES:
        return f"there are {len(nodes)} nodes, expected at most {MOST_NODES}"
    if len(edges) != len(nodes) - 1:
        return f"{len(nodes)} nodes need {len(nodes) - 1} edges, and there are {len(edges)}"
    if not nodes[0].released:
        return f"the first node {nodes[0].node_id!a} is not released"
    first = nodes[0].sequence_id
    for index, node in enumerate(nodes):
        if node.sequence_id != first + 2 * index:
            return f"node {node.node_id!a} has sequenceId {node.sequence_id}, not {first + 2 * index}"
    for index, edge in enumerate(edges):
        if (problem := _edge_problem(edge, nodes[index], nodes[index + 1])) is not None:
            return problem
    ids = [action.action_id for action in _actions(nodes, edges)]
    if len(ids) > MOST_ACTIONS:
        return f"there are {len(ids)} actions, expected at most {MOST_ACTIONS}"
    repeated = sorted(one for one, count in Counter(ids).items() if count > 1)
    return f"the actionId {repeated[0]!a} is there twice" if repeated else _released_problem(nodes, edges)


def _edge_problem(edge: Edge, start: Node, end: Node) -> str | None:
    if edge.sequence_id != start.sequence_id + 1:
        return f"edge {edge.edge_id!a} has sequenceId {edge.sequence_id}, not {start.sequence_id + 1}"
    if (edge.start_node_id, edge.end_node_id) != (start.node_id, end.node_id):
        return f"edge {edge.edge_id!a} does not lead from {start.node_id!a} to {end.node_id!a}"
    return None


def _released_problem(nodes: tuple[Node, ...], edges: tuple[Edge, ...]) -> str | None:
    """The base comes first, and an edge of it lies between nodes of it."""
    of_parts = [(one.sequence_id, one.released) for one in nodes]
    of_parts += [(one.sequence_id, one.released) for one in edges]
    released = [flag for _, flag in sorted(of_parts)]
    if released != sorted(released, reverse=True):
        return "a released node or edge comes after one that is not released"
    if released.count(True) % 2 == 0:
        return "the base ends with an edge, and not with a node"
    return None


def _actions(nodes: Iterable[Node], edges: Iterable[Edge]) -> Iterable[Action]:
    for node in nodes:
        yield from node.actions
    for edge in edges:
        yield from edge.actions


def _able(order: Order, facts: Facts, limits: Limits, accepted: Accepted) -> Problem | None:
    """What of the order this robot cannot do; the first node of an update is known already."""
    fields = [] if order.zone_set_id is None else ["order.zoneSetId: it knows no zones"]
    fields += [text for edge in order.edges for text in unsupported_fields(edge, limits)]
    fields += [
        f"node.nodePosition: it is needed for {node.node_id!a}"
        for node in order.nodes
        if node.node_position is None
    ]
    if fields:
        references = tuple(("field", text.partition(":")[0]) for text in fields)
        return Problem(Reason.UNSUPPORTED_FIELD, f"this robot cannot use {'; '.join(fields)}", references)
    fresh = order.nodes[1:] if accepted is Accepted.UPDATE else order.nodes
    for node in order.nodes:
        position = node.node_position
        if position is not None and position.map_id != facts.map_id:
            return _unknown_map(node.node_id, position.map_id, facts)
    for edge in order.edges:
        if edge.actions:
            text = "this robot has no actions on edges"
            return _bad_action(edge.actions[0], text, ("edgeId", edge.edge_id))
    for node in fresh:
        for action in node.actions:
            if text := actions.problem(action, actions.Scope.NODE):
                return _bad_action(action, text, ("nodeId", node.node_id))
    return None


def _bad_action(action: Action, text: str, where: tuple[str, str]) -> Problem:
    references = (("actionId", action.action_id), ("actionType", action.action_type), where)
    return Problem(Reason.UNSUPPORTED_ACTION, text, references)


def _unknown_map(node_id: str, map_id: str, facts: Facts) -> Problem:
    text = f"node {node_id!a} is on map {map_id!a}, and the robot uses {facts.map_id or 'none'!a}"
    return Problem(Reason.UNKNOWN_MAP, text, (("nodeId", node_id), ("mapId", map_id)))


def unsupported_fields(edge: Edge, limits: Limits) -> list[str]:
    """The optional fields of an edge that this robot would not obey. A limit above its own is obeyed anyway."""
    problems = []
    if edge.trajectory is not None:
        problems.append("edge.trajectory: it plans its own path")
    if edge.corridor is not None:
        problems.append("edge.corridor: it plans its own path")
    if edge.direction is not None:
        problems.append("edge.direction: it follows no line")
    if edge.orientation or edge.orientation_type == "GLOBAL":
        problems.append("edge.orientation: it drives forwards")
    if edge.rotation_allowed is False:
        problems.append("edge.rotationAllowed: it turns on its way")
    if edge.reach_orientation_before_entering and edge.orientation is not None:
        problems.append("edge.reachOrientationBeforeEntering: it turns on its way")
    if edge.max_speed is not None and edge.max_speed < LEAST_SPEED_M_S:
        problems.append(f"edge.maxSpeed: it drives no slower than {LEAST_SPEED_M_S:g}")
    if edge.min_height:
        problems.append("edge.minHeight: it has no lift")
    for name, limit, own in (
        ("maxRotationSpeed", edge.max_rotation_speed, limits.turn_max_rad_s),
        ("maxHeight", edge.max_height, limits.height_m),
    ):
        if limit is not None and (own is None or limit < own):
            has = "is not known" if own is None else f"is {own:g}"
            problems.append(f"edge.{name}: the robot's {has}, more than {limit:g}")
    return problems
