"""Robots that the manager hears of and does not drive, and other managers that drive robots: told, and left alone.

Where such a robot is, and what it says that it drives to, is taken as long as it is there: its place is not planned
through. Who was sent there before is stopped (``cancellation``).
"""

from typing import Final

from chefbot_vda5050.messages import ENDED, State
from msgspec import Struct

from chefbot_fleet.records import FleetRecords
from chefbot_fleet.roadmap import Point
from chefbot_fleet.store import Stage, Vehicle

HEARD_FOR_S: Final = 60.0
"""So long after its last order another manager is said to be there."""
MOST_STRANGERS: Final = 256
"""Names come from the broker, where anybody may invent them."""

MOST_AHEAD: Final = 64
"""So many of the nodes that another manager has released to a robot are kept free: each costs a look at all lanes."""


class Stranger(Struct):
    """A robot that is not in the fleet: when it was heard, and where it said that it is."""

    seen_s: float
    point_m: Point | None = None


class OtherManager(Struct):
    """The latest order to a robot that somebody else sent."""

    order_id: str
    heard_s: float


class Strangers:
    """``robots`` are those that are not in the fleet; ``managers`` who else drives, by robot."""

    def __init__(self, fleet: FleetRecords) -> None:
        self._fleet = fleet
        self.robots: dict[str, Stranger] = {}
        self.managers: dict[str, OtherManager] = {}

    def hear(self, name: str, state: State, now_s: float) -> None:
        """A state of a robot that is not in the fleet: its place is taken."""
        if name not in self.robots and len(self.robots) >= MOST_STRANGERS:
            self._fleet.ignored[name] = f"{MOST_STRANGERS} robots that are not in the fleet are known already"
            return
        stranger = self.robots.setdefault(name, Stranger(now_s))
        stranger.seen_s = now_s
        if path := path_of(state, self._fleet.parameters.map_id):
            stranger.point_m = path[0]
            self._fleet.traffic.occupy(name, path, now_s)

    def forget(self, name: str) -> None:
        """It is in the fleet now, or it was taken away."""
        self.robots.pop(name, None)
        self._fleet.traffic.vacate(name)

    def hear_order(self, name: str, order_id: str, now_s: float) -> None:
        """An order for a robot, by whomever."""
        vehicle = self._fleet.vehicles.get(name)
        if vehicle is not None and is_ours(vehicle, order_id):
            return
        if name not in self.managers and len(self.managers) >= MOST_STRANGERS:
            return
        if name not in self.managers:
            self._fleet.notices.append(f"another manager sends orders to {name}: {order_id!a}")
        self.managers[name] = OtherManager(order_id, now_s)

    def watch(self, now_s: float) -> None:
        """Forget other managers that are silent, and robots whose lease is over."""
        gone = [name for name, one in self.managers.items() if now_s > one.heard_s + HEARD_FOR_S]
        for name in gone:
            del self.managers[name]
        parameters = self._fleet.parameters
        for name, stranger in list(self.robots.items()):
            if now_s > stranger.seen_s + parameters.lost_after_s + parameters.lease_s:
                self.forget(name)
                self._fleet.ignored.pop(name, None)

    def connected(self, now_s: float) -> None:
        """Each has all of its time from now on."""
        for stranger in self.robots.values():
            stranger.seen_s = now_s

    def is_silent(self, name: str, now_s: float) -> bool:
        """Whether a robot that is not in the fleet has vanished."""
        return now_s > self.robots[name].seen_s + self._fleet.parameters.lost_after_s

    def leave_alone(self, vehicle: Vehicle, state: State, now_s: float) -> bool:
        """Whether a robot of the fleet drives by another's order now; it gets nothing from us until it is idle.

        What it had not begun to load is another robot's order.
        """
        name, contact = vehicle.name, self._fleet.contacts[vehicle.name]
        foreign = foreign_order(vehicle, state)
        if foreign is None:
            if contact.foreign is not None:
                contact.foreign = None
                self._fleet.notices.append(f"{name} is idle, and gets orders from here again")
                self._fleet.ignored.pop(name, None)
            self._fleet.traffic.vacate(name)
            return False
        if contact.foreign != foreign:
            why = f"it does order {foreign!a} of another manager, and is left alone until it is idle"
            self._withdraw(vehicle, now_s)
            self._fleet.traffic.lose(name, now_s)
            if vehicle.action_id is None:  # a robot has one order, so what ours had released is void
                vehicle.base, vehicle.order_id = [], ""
                self._fleet.traffic.take_back(name)
                self._fleet.store.save(vehicle)
            contact.foreign = foreign  # only now: what the disk did not take is tried again
            self._fleet.notices.append(f"{name}: {why}")
            self._fleet.ignored[name] = why
        self._fleet.traffic.robots[name].lost_s = now_s  # no lease runs while it can be heard
        if path := path_of(state, self._fleet.parameters.map_id):
            self._fleet.traffic.occupy(name, path, now_s)
        return True

    def _withdraw(self, vehicle: Vehicle, now_s: float) -> None:
        order = self._fleet.orders.get(vehicle.task or "")
        if order is None or order.stage is not Stage.ASSIGNED or vehicle.action_id is not None:
            return
        self._fleet.give_back(vehicle, order, f"{vehicle.name} does another manager's")
        vehicle.task = None
        self._fleet.store.save(order, vehicle)
        self._fleet.traffic.withdraw(vehicle.name, now_s)


def path_of(state: State, map_id: str) -> tuple[Point, ...]:
    """Where a robot is and the nodes that were released to it, as far as it says so, on this map."""
    position = state.agv_position
    if position is None or not position.position_initialized or position.map_id != map_id:
        return ()
    ahead = [node.node_position for node in state.node_states[:MOST_AHEAD] if node.released]
    nodes = [(one.x, one.y) for one in ahead if one is not None and one.map_id == map_id]
    return ((position.x, position.y), *nodes)


def is_ours(vehicle: Vehicle, order_id: str) -> bool:
    """Whether an order is one that this manager has sent to the robot."""
    return order_id.startswith(f"{vehicle.name}-{vehicle.series}-")


def foreign_order(vehicle: Vehicle, state: State) -> str | None:
    """The order that is not ours and that a robot has not ended."""
    if not state.order_id or is_ours(vehicle, state.order_id):
        return None
    is_at_work = any(action.action_status not in ENDED for action in state.action_states)
    return state.order_id if state.node_states or is_at_work else None
