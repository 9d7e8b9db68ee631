"""The manager's decisions: states of robots in, orders of VDA 5050 out. Time is an argument; the store is the memory.

A robot drives by one order, whose base grows node by node as traffic releases moves: there is no horizon, and nothing is
taken back but by ``cancelOrder``. Its work (pick, drop) is an order of one node with one action. So a robot needs no
more of the standard than orders, updates, actions and ``cancelOrder``.

Messages get lost. The robot's state says what it knows; what it lacks is sent again from there, under the same numbers,
so that nothing is done twice. Only one update is on its way at a time.
"""

from collections.abc import Iterable
from itertools import pairwise

from chefbot_vda5050.messages import ConnectionState, State

from chefbot_fleet.assignment import Order as Errand
from chefbot_fleet.assignment import assign
from chefbot_fleet.cancellation import Cancellation
from chefbot_fleet.corrections import check_way, corrected
from chefbot_fleet.lanes import Space
from chefbot_fleet.orders import CancelOrder, Outgoing
from chefbot_fleet.records import FleetParameters, FleetRecords
from chefbot_fleet.reports import Reports
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace
from chefbot_fleet.sending import MOST_REFUSALS, Sending
from chefbot_fleet.store import Correction, FleetOrder, Stage, Store
from chefbot_fleet.strangers import Strangers


class Fleet(FleetRecords):
    """Decides for all robots and orders. Raises ``ValueError`` for what cannot be done, with a sentence."""

    def __init__(
        self,
        roadmap: Roadmap,
        homes: Iterable[int],
        store: Store,
        pace: Pace,
        parameters: FleetParameters,
        now_s: float,
        space: Space | None = None,
    ) -> None:
        """``space`` is where corrections by hand may lead; None: anywhere."""
        super().__init__(roadmap, homes, store, pace, parameters, now_s)
        self._space, self._is_connected = space, True
        self.strangers = Strangers(self)
        self._cancellation, self._sending = Cancellation(self), Sending(self)
        self._reports = Reports(self, self.strangers, self._cancellation)

    # What people want

    def add_order(self, identifier: str, pick: str, drop: str, now_s: float) -> FleetOrder:
        """A new order; the same one again changes nothing."""
        known = self.orders.get(identifier)
        if known is not None:
            if (known.pick, known.drop) != (pick, drop):
                raise ValueError(
                    f"order {identifier!a} is there already, from {known.pick!a} to {known.drop!a}"
                )
            return known
        for place in (pick, drop):
            if place not in self.roadmap.names:
                names = ", ".join(sorted(self.roadmap.names))
                raise ValueError(f"there is no place {place!a}; there are: {names}")
        if not identifier or pick == drop:
            raise ValueError("an order needs an identifier and two different places")
        order = FleetOrder(identifier, pick, drop, now_s)
        self.store.save(order)
        self.orders[identifier] = order
        return order

    def cancel_order(self, identifier: str) -> FleetOrder:
        """Nobody wants an order any more; a robot that has begun is stopped. Again, it changes nothing."""
        return self._cancellation.cancel(identifier)

    def remove_robot(self, name: str, now_s: float) -> None:
        """A vanished robot is gone: free its place, and give its order to another, unless it may have the load."""
        vehicle = self.vehicles.get(name)
        if vehicle is None and name not in self.strangers.robots:
            raise ValueError(f"there is no robot {name!a}")
        if not self.has_vanished(name, now_s):
            raise ValueError(f"{name} is there: switch it off first")
        self.strangers.forget(name)
        self.ignored.pop(name, None)
        if vehicle is None:
            return
        order = self.orders.get(vehicle.task) if vehicle.task is not None else None
        if order is not None:
            self.give_back(vehicle, order, f"{name} was removed")
        self.store.forget(vehicle, *([order] if order is not None else []))
        self.traffic.remove(name)
        del self.vehicles[name], self.contacts[name]

    def has_vanished(self, name: str, now_s: float) -> bool:
        """Whether nothing is heard of a robot."""
        if name not in self.vehicles:
            return self.strangers.is_silent(name, now_s)
        return self.traffic.robots[name].lost_s is not None and self.contacts[name].foreign is None

    def correct(self, correction: Correction, now_s: float) -> None:
        """Change the roadmap by hand; robots get new plans on it."""
        check_way(correction, self.roadmap, self._space)
        changed = corrected(self.roadmap, [correction])
        for vehicle in self.vehicles.values():
            nodes = [vehicle.node, *vehicle.base]
            for a, b in pairwise(nodes):
                if not any(end == b for _, end in changed.exits[a]):
                    raise ValueError(f"{vehicle.name} is on its way from {a} to {b}")
        self.store.correct(correction)
        self.make_traffic_again(now_s)

    # What robots say

    def disconnected(self) -> None:
        """No robot can be heard: none is taken for vanished, and no lease runs, until ``connected``."""
        self._is_connected = False

    def connected(self, now_s: float) -> None:
        """Robots can be heard again; each has all of its time from now on."""
        self._is_connected = True
        self.strangers.connected(now_s)
        for name, contact in self.contacts.items():
            contact.seen_s = now_s
            robot = self.traffic.robots[name]
            if robot.lost_s is not None:
                robot.lost_s = now_s

    def on_connection(self, name: str, connection: ConnectionState, now_s: float) -> None:
        """A robot's topic ``connection``."""
        contact = self.contacts.get(name)
        if contact is not None:
            contact.connection = connection
            if connection is not ConnectionState.ONLINE:
                contact.foreign = None
                self.traffic.lose(name, now_s)

    def on_state(self, name: str, state: State, now_s: float) -> None:
        """A robot's topic ``state``; the first one of a new robot takes it into the fleet."""
        self.follow_disk(now_s)
        self._reports.take(name, state, now_s)

    def on_order(self, name: str, order_id: str, now_s: float) -> None:
        """A robot's topic ``order``: what this manager or another one sends."""
        self.strangers.hear_order(name, order_id, now_s)

    # What follows

    def tick(self, now_s: float) -> list[Outgoing | CancelOrder]:
        """What is to be sent now; call it a few times a second."""
        self.follow_disk(now_s)
        self._watch(now_s)
        self._assign(now_s)
        for vehicle in self.vehicles.values():  # who is at work ends it, though a new plan leads away first
            is_busy = vehicle.action_id is not None or vehicle.cancel_id is not None
            self.traffic.robots[vehicle.name].held = is_busy
        for name, move in self.traffic.release(now_s):
            self._sending.extend(self.vehicles[name], move)
        for vehicle in self.vehicles.values():
            robot = self.traffic.robots[vehicle.name]
            is_free = vehicle.action_id is None and robot.lost_s is None and not robot.held
            if robot.work is not None and is_free:
                self._sending.begin_work(vehicle)
        outgoing = [
            self._sending.due(vehicle, now_s)
            if vehicle.cancel_id is None
            else self._cancellation.due(vehicle, now_s)
            for vehicle in self.vehicles.values()
        ]
        return [message for message in outgoing if message is not None]

    def _watch(self, now_s: float) -> None:
        if not self._is_connected:
            return
        self.strangers.watch(now_s)
        for name, contact in list(self.contacts.items()):
            robot = self.traffic.robots[name]
            if now_s > contact.seen_s + self.parameters.lost_after_s:
                contact.foreign = None
                self.traffic.lose(name, now_s)
            if robot.lost_s is not None and now_s > robot.lost_s + self.parameters.lease_s:
                self.remove_robot(name, now_s)

    def _assign(self, now_s: float) -> None:
        waiting = [
            Errand(
                order.identifier,
                self.roadmap.names[order.pick],
                self.roadmap.names[order.drop],
                order.since_s,
            )
            for order in self.orders.values()
            if order.stage is Stage.WAITING
        ]
        free = {
            robot.name: robot.last_released_node
            for robot in self.traffic.robots.values()
            if robot.is_idle
            and robot.lost_s is None
            and not robot.held
            and self.contacts[robot.name].refusals < MOST_REFUSALS
        }
        for name, errand in assign(self.roadmap, free, waiting, now_s):
            order, vehicle = self.orders[errand.identifier], self.vehicles[name]
            if self.traffic.assign(name, self.stops(order), now_s):
                order.stage, order.robot, order.why = Stage.ASSIGNED, name, None
                vehicle.task, vehicle.stops_done = order.identifier, 0
                self.store.save(order, vehicle)
