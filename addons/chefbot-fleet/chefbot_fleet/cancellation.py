"""``cancelOrder`` (VDA 5050, 6.9): an order that people cancel, and ways that are taken back as somebody is in them.

The robot is asked under one ``actionId`` until it has answered, so it is stopped once, and gets nothing else meanwhile.
Everything that was released to it stays reserved until it says that it stands: then that is but the edge where it is.
"""

from chefbot_vda5050.messages import ENDED, State

from chefbot_fleet.orders import CancelOrder
from chefbot_fleet.places import place_on_path
from chefbot_fleet.records import FleetRecords
from chefbot_fleet.sending import new_order
from chefbot_fleet.store import FleetOrder, Stage, Vehicle

MOST_ASKED = 10
"""So often a robot is asked to give up its way; an order that people do not want is asked for without end."""

RECALL_EVERY_S = 30.0
"""A robot is not stopped more often than this for others that are in its way."""


class Cancellation:
    """Asks robots to give up what they were sent, and takes it back when they have."""

    def __init__(self, fleet: FleetRecords) -> None:
        self._fleet = fleet

    def cancel(self, identifier: str) -> FleetOrder:
        """People do not want an order any more; again, it changes nothing. Raises ``ValueError`` if it has ended."""
        order = self._fleet.orders.get(identifier)
        if order is None:
            raise ValueError(f"there is no order {identifier!a}")
        if order.stage in (Stage.DONE, Stage.FAILED):
            raise ValueError(f"order {identifier!a} is {order.stage} already")
        if order.stage is Stage.WAITING:
            order.stage, order.why = Stage.CANCELLED, None
            self._fleet.store.save(order)
        elif order.stage is not Stage.CANCELLED:
            order.stage = Stage.CANCELLING
            self._ask(self._fleet.vehicles[order.robot or ""], order)
        return order

    def clear_way(self, name: str, now_s: float) -> None:
        """Stop those who were sent to where a robot is now that has no plan here; they get another way."""
        for blocked in self._fleet.traffic.released_into(name):
            contact = self._fleet.contacts[blocked]
            if now_s >= contact.recalled_s + RECALL_EVERY_S:
                contact.recalled_s = now_s
                self._fleet.notices.append(
                    f"{blocked} is stopped: {name} is in the way that was released to it"
                )
                self._ask(self._fleet.vehicles[blocked])

    def _ask(self, vehicle: Vehicle, order: FleetOrder | None = None) -> None:
        if vehicle.cancel_id is None:
            vehicle.cancel_id = f"cancel-{vehicle.series}.{vehicle.trips}"
            self._fleet.contacts[vehicle.name].cancels_sent = 0
        self._fleet.store.save(*([vehicle] if order is None else [order, vehicle]))

    def due(self, vehicle: Vehicle, now_s: float) -> CancelOrder | None:
        """What is to be sent to a robot that has not answered; again after a while."""
        contact, robot = self._fleet.contacts[vehicle.name], self._fleet.traffic.robots[vehicle.name]
        again_s = contact.cancel_sent_s + self._fleet.parameters.resend_s
        if vehicle.cancel_id is None or contact.state is None or robot.lost_s is not None or now_s < again_s:
            return None
        if contact.cancels_sent >= MOST_ASKED and not self._is_cancelling(vehicle):
            self._fleet.notices.append(f"{vehicle.name} does not answer cancelOrder, and keeps its way")
            vehicle.cancel_id = None
            self._fleet.store.save(vehicle)
            return None
        contact.cancel_sent_s, contact.cancels_sent = now_s, contact.cancels_sent + 1
        return CancelOrder(vehicle.name, vehicle.cancel_id)

    def on_state(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        """A state of a robot that was asked: it has ended its order, or had none."""
        answers = [one for one in state.action_states if one.action_id == vehicle.cancel_id]
        if not any(one.action_status in ENDED for one in answers):
            return
        is_cancelling = self._is_cancelling(vehicle)
        was_at_work = vehicle.action_id is not None
        vehicle.action_id, vehicle.cancel_id = None, None
        self._stand_still(vehicle, state, now_s)
        if not is_cancelling:
            self._fleet.store.save(vehicle)
            self._fleet.traffic.resolve({vehicle.name}, now_s)
            return
        order = self._fleet.orders[vehicle.task or ""]
        order.stage, order.why = Stage.CANCELLED, None
        if vehicle.stops_done or was_at_work:
            order.why = f"{vehicle.name} {'has' if vehicle.stops_done else 'may have'} its load"
        vehicle.task = None
        self._fleet.store.save(order, vehicle)
        self._fleet.traffic.withdraw(vehicle.name, now_s)

    def _is_cancelling(self, vehicle: Vehicle) -> bool:
        order = self._fleet.orders.get(vehicle.task or "")
        return order is not None and order.stage is Stage.CANCELLING

    def _stand_still(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        """Of what was released the robot keeps the edge on which it stands, and gets an order to drive to its end."""
        found = place_on_path(state, [vehicle.node, *vehicle.base], self._fleet.roadmap)
        begin, keep = found or (0, min(len(vehicle.base), 1))
        self._fleet.move_on(vehicle, begin, now_s)
        vehicle.base, vehicle.order_id = vehicle.base[:keep], ""
        if vehicle.base:
            new_order(vehicle, "drive")
        self._fleet.traffic.take_back(vehicle.name, keep)
