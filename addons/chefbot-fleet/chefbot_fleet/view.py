"""What the page and Prometheus show of a fleet."""

from typing import Any

from chefbot_fleet.fleet import Fleet
from chefbot_fleet.store import Stage
from chefbot_fleet.walls import Walls

LATEST = 50
"""So many orders that are done are shown."""


def roadmap_view(fleet: Fleet, walls: Walls | None = None) -> dict[str, Any]:
    """Nodes, edges, places to work and homes, and where the picture of the walls lies."""
    roadmap = fleet.roadmap
    return {
        "points": roadmap.points_m,
        "edges": roadmap.edges,
        "names": roadmap.names,
        "walls": walls and [walls.left_m, walls.bottom_m, walls.width_m, walls.height_m],
        "homes": [vehicle.home for vehicle in fleet.vehicles.values()],
    }


def fleet_view(fleet: Fleet, now_s: float) -> dict[str, Any]:
    """All robots, what they have reserved and wait for, and all orders that are not done, with the latest that are."""
    names = {node: name for name, node in fleet.roadmap.names.items()}
    orders = list(fleet.orders.values())
    ended = [order for order in orders if order.stage in (Stage.DONE, Stage.CANCELLED)]
    open_orders = [order for order in orders if order.stage not in (Stage.DONE, Stage.CANCELLED)]
    return {
        "robots": [_robot(fleet, name, names, now_s) for name in fleet.vehicles],
        "orders": [
            {
                "id": order.identifier,
                "pick": order.pick,
                "drop": order.drop,
                "stage": order.stage,
                "robot": order.robot,
                "why": order.why,
                "age_s": round(now_s - order.since_s),
            }
            for order in [*open_orders, *ended[-LATEST:]]
        ],
        "done": sum(order.stage is Stage.DONE for order in orders),
        "deadlocks": fleet.traffic.deadlocks,
        "ignored": fleet.ignored,
        "strangers": [_stranger(fleet, name, now_s) for name in fleet.strangers.robots],
        "managers": {
            name: f"another manager sends orders to it: {one.order_id!a}, {now_s - one.heard_s:.0f} s ago"
            for name, one in fleet.strangers.managers.items()
        },
    }


def _stranger(fleet: Fleet, name: str, now_s: float) -> dict[str, Any]:
    x_m, y_m = fleet.strangers.robots[name].point_m or (None, None)
    why = fleet.ignored.get(name, "")
    return {"name": name, "x": x_m, "y": y_m, "why": why, "lost": fleet.has_vanished(name, now_s)}


def _robot(fleet: Fleet, name: str, names: dict[int, str], now_s: float) -> dict[str, Any]:
    vehicle, robot, contact = fleet.vehicles[name], fleet.traffic.robots[name], fleet.contacts[name]
    state = contact.state
    position = None if state is None else state.agv_position
    place = fleet.roadmap.points_m[vehicle.node] if position is None else (position.x, position.y)
    waits = [wait for wait in fleet.traffic.waits() if wait.robot == name]
    return {
        "name": name,
        "x": place[0],
        "y": place[1],
        "node": vehicle.node,
        "reserved": [vehicle.node, *vehicle.base],
        "plan": [move.target for move in robot.moves[robot.released :]],
        "task": vehicle.task,
        "doing": _doing(fleet, name, names),
        "waits": [
            f"waits for {wait.waits_for}, which passes {names.get(wait.node, f'node {wait.node}')} first"
            for wait in waits
        ],
        "age_s": round(now_s - contact.seen_s, 1),
        "lost": fleet.has_vanished(name, now_s),
        "battery": None if state is None else state.battery_state.battery_charge,
        "errors": []
        if state is None
        else [
            " - ".join(filter(None, (error.error_type, error.error_description, error.error_hint)))
            for error in state.errors
        ],
    }


def _doing(fleet: Fleet, name: str, names: dict[int, str]) -> str:
    vehicle, robot = fleet.vehicles[name], fleet.traffic.robots[name]
    if fleet.contacts[name].foreign is not None:
        return "does another manager's order, and is left alone"
    if robot.lost_s is not None:
        return "vanished: its place stays reserved until it is back or removed"
    if vehicle.cancel_id is not None:
        return "is stopped by cancelOrder"
    if vehicle.action_id is not None:
        return f"{'picks' if vehicle.stops_done == 0 else 'drops'} at {names.get(vehicle.node, vehicle.node)}"
    if not robot.moves:
        return (
            "is free" if vehicle.node == robot.home and robot.is_idle else "has no way now, and tries again"
        )
    if robot.is_idle:
        return "drives home"
    stop = robot.stops[robot.stops_done].node
    return f"drives to {names.get(stop, stop)}"
