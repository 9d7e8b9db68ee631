"""Orders and steps for the tests: nodes on a line along x, one metre apart, on the map 'flat'."""

from typing import Any

from chefbot_vda5050 import acceptance, order
from chefbot_vda5050.instant import instant_action
from chefbot_vda5050.messages import (
    Action,
    ActionParameter,
    BlockingType,
    Edge,
    Header,
    Node,
    NodePosition,
    Order,
)
from chefbot_vda5050.problems import Problem
from chefbot_vda5050.vehicle import Facts, Limits, Vehicle

HEADER: dict[str, Any] = {
    "header_id": 0,
    "timestamp": "2026-01-02T03:04:05.000Z",
    "version": "2.1.0",
    "manufacturer": "chefbot",
    "serial_number": "r1",
}
assert set(HEADER) == set(Header.__struct_fields__)

AT_START = Facts(connected=True, localized=True, map_id="flat")
LIMITS = Limits(speed_max_m_s=0.34, turn_max_rad_s=2.0, height_m=0.2)


def action(kind: str = "pick", number: str = "a1", blocking: str = "HARD", **parameters: Any) -> Action:
    """An action with these parameters."""
    given = tuple(ActionParameter(key=key, value=value) for key, value in parameters.items())
    return Action(
        action_type=kind, action_id=number, blocking_type=BlockingType(blocking), action_parameters=given
    )


def node(index: int, *, released: bool = True, actions: tuple[Action, ...] = (), **position: Any) -> Node:
    """Node n0, n1, ... at x = 0, 1, ... metres."""
    where: dict[str, Any] = {"x": float(index), "y": 0.0, "map_id": "flat"} | position
    return Node(
        node_id=f"n{index}",
        sequence_id=2 * index,
        released=released,
        actions=actions,
        node_position=NodePosition(**where),
    )


def edge(index: int, *, released: bool = True, **fields: Any) -> Edge:
    """The edge from node ``index`` to the next."""
    return Edge(
        edge_id=f"e{index}",
        sequence_id=2 * index + 1,
        released=released,
        start_node_id=f"n{index}",
        end_node_id=f"n{index + 1}",
        **({"actions": ()} | fields),
    )


def line(
    first: int,
    last: int,
    *,
    base: int | None = None,
    update: int = 0,
    order_id: str = "o1",
    actions: dict[int, tuple[Action, ...]] | None = None,
    **position: Any,
) -> Order:
    """An order from node ``first`` to ``last``; ``base`` is its last released node (default: the last)."""
    base = last if base is None else base
    return Order(
        **HEADER,
        order_id=order_id,
        order_update_id=update,
        nodes=tuple(
            node(index, released=index <= base, actions=(actions or {}).get(index, ()), **position)
            for index in range(first, last + 1)
        ),
        edges=tuple(edge(index, released=index < base) for index in range(first, last)),
    )


def receive(vehicle: Vehicle, message: Order, facts: Facts = AT_START, limits: Limits = LIMITS) -> order.Step:
    """Judge an order, and take it over or report why not."""
    judged = acceptance.judge(vehicle, message, facts, limits)
    if isinstance(judged, Problem):
        return order.reject(vehicle, judged)
    return order.accept(vehicle, message, judged, facts, limits)


def instant(vehicle: Vehicle, kind: str, number: str, **parameters: Any) -> order.Step:
    """Ask for an instant action."""
    return instant_action(vehicle, action(kind, number, "NONE", **parameters))


def reached(vehicle: Vehicle, *indices: int) -> Vehicle:
    """The vehicle after it has reached these nodes."""
    for index in indices:
        vehicle, _ = order.node_reached(vehicle, 2 * index)
    return vehicle


def statuses(vehicle: Vehicle) -> dict[str, str]:
    """The status of each action by its id."""
    return {one.action.action_id: str(one.status) for one in vehicle.actions}
