"""What robots say: a state brings the robot into the fleet, its order on, and work to its end."""

import secrets

from chefbot_vda5050.messages import ActionStatus, ConnectionState, OperatingMode, State

from chefbot_fleet.cancellation import Cancellation
from chefbot_fleet.places import nearest_node, place_on_path, reserved_for, why_not_taken
from chefbot_fleet.records import Contact, FleetRecords
from chefbot_fleet.sending import new_order
from chefbot_fleet.store import Stage, Vehicle
from chefbot_fleet.strangers import Strangers


class Reports:
    """Takes states into the fleet's records."""

    def __init__(self, fleet: FleetRecords, strangers: Strangers, cancellation: Cancellation) -> None:
        self._fleet, self._strangers, self._cancellation = fleet, strangers, cancellation

    def take(self, name: str, state: State, now_s: float) -> None:
        """A state; the first one of a new robot takes it into the fleet."""
        vehicle = self._fleet.vehicles.get(name) or self._adopt(name, state, now_s)
        if vehicle is None:
            self._strangers.hear(name, state, now_s)
            self._cancellation.clear_way(name, now_s)
            return
        contact = self._fleet.contacts[name]
        contact.seen_s, contact.state, contact.connection = now_s, state, ConnectionState.ONLINE
        if self._strangers.leave_alone(vehicle, state, now_s):
            self._cancellation.clear_way(name, now_s)
            return
        if state.order_id == vehicle.order_id:
            self._progress(vehicle, state, now_s)
        if vehicle.cancel_id is not None:
            self._cancellation.on_state(vehicle, state, now_s)
        else:
            self._put_right(vehicle, state, now_s)
        if self._fleet.traffic.robots[name].lost_s is not None:
            self._fleet.traffic.find(name, now_s)

    def _put_right(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        """What the robot has lost, or is not where it was."""
        if state.order_id == vehicle.order_id:
            self._replace_deleted(vehicle, state, now_s)
        elif vehicle.order_id:
            self._find_again(vehicle, state, now_s)
        self._follow(vehicle, state, now_s)

    def _follow(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        """A robot that stands without an order of ours, and far from where it stood: carried, or it was wrong before.

        Whatever was released to it is not in its hands, and it takes no order that begins so far away.
        """
        is_at_work = bool(vehicle.base) or vehicle.action_id is not None
        if (is_at_work and state.order_id == vehicle.order_id) or state.driving or state.node_states:
            return
        if nearest_node(state, [vehicle.node, *vehicle.base], self._fleet.roadmap) is not None:
            return
        node = nearest_node(state, range(len(self._fleet.roadmap.points_m)), self._fleet.roadmap)
        if node is None:
            return
        others = [other for other in self._fleet.vehicles.values() if other is not vehicle]
        why = reserved_for(node, others, self._fleet.roadmap)
        if why is not None:
            self._fleet.ignored[vehicle.name] = f"it has been moved, and {why}"
            return
        self._fleet.ignored.pop(vehicle.name, None)
        self._fleet.traffic.remove(vehicle.name)
        vehicle.node, vehicle.base, vehicle.order_id, vehicle.update_id = node, [], "", 0
        vehicle.action_id = None
        self._fleet.store.save(vehicle)
        self._fleet.place(vehicle, now_s)
        self._fleet.plan_around(now_s)

    def _adopt(self, name: str, state: State, now_s: float) -> Vehicle | None:
        used = {vehicle.home for vehicle in self._fleet.vehicles.values()}
        homes = [home for home in self._fleet.homes if home not in used]
        node = nearest_node(state, range(len(self._fleet.roadmap.points_m)), self._fleet.roadmap)
        why = why_not_taken(
            state,
            node,
            homes,
            self._fleet.vehicles.values(),
            self._fleet.roadmap,
            self._fleet.parameters.map_id,
        )
        if why is not None or node is None:
            self._fleet.ignored[name] = why or ""
            return None
        self._fleet.ignored.pop(name, None)
        self._strangers.forget(name)
        home = min(homes, key=lambda home: self._fleet.roadmap.distance_m[node, home])
        vehicle = Vehicle(name, home, node, series=secrets.token_hex(4))
        self._fleet.store.save(vehicle)
        self._fleet.vehicles[name], self._fleet.contacts[name] = vehicle, Contact(now_s)
        self._fleet.traffic.add(name, node, home)
        self._fleet.plan_around(now_s)
        return vehicle

    def _progress(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        passed = (state.last_node_sequence_id - vehicle.sequence) // 2
        self._fleet.advance(vehicle, min(max(passed, 0), len(vehicle.base)), now_s)
        if vehicle.action_id is not None and not vehicle.has_work:
            vehicle.has_work = True
            self._fleet.store.save(vehicle)
        for action in state.action_states:
            if vehicle.action_id is not None and action.action_id == vehicle.action_id:
                if action.action_status is ActionStatus.FINISHED:
                    self._worked(vehicle)
                elif action.action_status is ActionStatus.FAILED and vehicle.cancel_id is None:
                    self._failed(vehicle, action.result_description or "its action failed", now_s)

    def _worked(self, vehicle: Vehicle) -> None:
        order = self._fleet.orders[vehicle.task or ""]
        self._fleet.traffic.worked(vehicle.name)
        vehicle.stops_done, vehicle.action_id, order.why = vehicle.stops_done + 1, None, None
        if vehicle.stops_done == 2:
            order.stage, vehicle.task = Stage.DONE, None
        elif order.stage is not Stage.CANCELLING:
            order.stage = Stage.PICKED
        self._fleet.store.save(order, vehicle)

    def _failed(self, vehicle: Vehicle, why: str, now_s: float) -> None:
        order = self._fleet.orders[vehicle.task or ""]
        order.stage, order.why = Stage.FAILED, why
        vehicle.task, vehicle.action_id = None, None
        self._fleet.store.save(order, vehicle)
        self._fleet.traffic.withdraw(vehicle.name, now_s)

    def _replace_deleted(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        """A robot that was driven by hand has deleted its order (6.10.6): when it may drive, it gets another.

        So too where it was sent an update meanwhile, and refuses it.
        """
        taken = state.order_update_id == vehicle.update_id
        refused = self._fleet.contacts[vehicle.name].refusals > 0
        if not (taken or refused) or not vehicle.base or state.node_states or state.driving:
            return
        if state.operating_mode is OperatingMode.AUTOMATIC:
            self._find_again(vehicle, state, now_s)
            if vehicle.base:
                new_order(vehicle, "drive")
                self._fleet.store.save(vehicle)

    def _find_again(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        """A robot that stands idle without our order has restarted, or not got it yet: see how far along it stands.

        It is sent the same order again, from there on: so what it may still get of the first one changes nothing.
        """
        if state.driving or state.node_states or not vehicle.base:
            return
        passed, _ = place_on_path(state, [vehicle.node, *vehicle.base], self._fleet.roadmap) or (0, 0)
        self._fleet.advance(vehicle, passed, now_s)
