"""What is sent to robots, and when: one update at a time, again where it was lost, and seldom where it is refused."""

from chefbot_fleet.orders import Outgoing, order_message, refusal
from chefbot_fleet.records import Contact, FleetRecords
from chefbot_fleet.schedule import Move
from chefbot_fleet.store import Vehicle

MOST_REFUSALS = 10
"""After so many refusals another robot gets the order, unless the load may be on this one."""

REFUSED_RESEND_S = 30.0
"""Then it is asked again so seldom; it gets no other work until it has accepted."""


class Sending:
    """Gives robots what traffic releases to them."""

    def __init__(self, fleet: FleetRecords) -> None:
        self._fleet = fleet

    def extend(self, vehicle: Vehicle, move: Move) -> None:
        """One more node in the base: of the order that the robot drives by, or of a new one."""
        if not vehicle.order_id or vehicle.order_id.endswith("work"):
            new_order(vehicle, "drive")
        else:
            vehicle.update_id += 1
        vehicle.base.append(move.target)
        self._fleet.store.save(vehicle)

    def begin_work(self, vehicle: Vehicle) -> None:
        """The order of one node for the work that is due, once the robot has ended the one before it."""
        state = self._fleet.contacts[vehicle.name].state
        if state is None or (vehicle.order_id and (state.order_id != vehicle.order_id or state.node_states)):
            return
        new_order(vehicle, "work")
        vehicle.action_id = f"{vehicle.task}-{vehicle.stops_done}-{vehicle.series}.{vehicle.trips}"
        vehicle.has_work = False
        self._fleet.store.save(vehicle)

    def due(self, vehicle: Vehicle, now_s: float) -> Outgoing | None:
        """The robot's order if it lacks something: at once if it knows what came before, else again after a while."""
        contact, state = self._fleet.contacts[vehicle.name], self._fleet.contacts[vehicle.name].state
        if (
            not vehicle.order_id
            or state is None
            or self._fleet.traffic.robots[vehicle.name].lost_s is not None
        ):
            return None
        current = (vehicle.order_id, vehicle.update_id)
        reported = (state.order_id, state.order_update_id)
        if reported == current:
            self._accepted(vehicle, contact)
            return None
        is_first = contact.sent != current and (contact.sent == reported or not contact.sent[0])
        pause_s = self._fleet.parameters.resend_s if contact.refusals < MOST_REFUSALS else REFUSED_RESEND_S
        if not is_first and now_s < contact.sent_s + pause_s:
            return None
        why = refusal(state, current) if contact.seen_s > contact.sent_s else None
        if why is not None:
            self._refused(vehicle, contact, f"{vehicle.name} refuses it: {why}", now_s)
        contact.sent, contact.sent_s = current, now_s
        return order_message(vehicle, state, self._fleet.roadmap, self._fleet.parameters.map_id)

    def _accepted(self, vehicle: Vehicle, contact: Contact) -> None:
        order = self._fleet.orders.get(vehicle.task) if vehicle.task is not None else None
        if order is not None and order.why is not None:
            order.why = None
            self._fleet.store.save(order)
        contact.refusals = 0

    def _refused(self, vehicle: Vehicle, contact: Contact, why: str, now_s: float) -> None:
        """Once more; too often, and the work is another robot's. No other can bring what this one may have loaded."""
        contact.refusals += 1
        order = self._fleet.orders.get(vehicle.task) if vehicle.task is not None else None
        if order is None:
            return
        order.why = why
        may_have_load = vehicle.stops_done > 0 or (vehicle.action_id is not None and vehicle.has_work)
        if contact.refusals < MOST_REFUSALS or may_have_load:
            self._fleet.store.save(order)
            return
        vehicle.action_id = None
        self._fleet.give_back(vehicle, order, why)
        vehicle.task = None
        self._fleet.store.save(order, vehicle)
        self._fleet.traffic.withdraw(vehicle.name, now_s)


def new_order(vehicle: Vehicle, what: str) -> None:
    """The robot gets another order from here on, to drive or to work."""
    vehicle.trips += 1
    vehicle.order_id, vehicle.update_id = f"{vehicle.name}-{vehicle.series}-{vehicle.trips}-{what}", 0
    vehicle.sequence += (
        2  # a robot that compares node and sequenceId alone would take the node for one it has passed
    )
