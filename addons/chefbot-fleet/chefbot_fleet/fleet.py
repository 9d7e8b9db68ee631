"""The manager's decisions: states of robots in, orders of VDA 5050 out. Time is an argument; the store is the memory.

A robot drives by one order, whose base grows node by node as traffic releases moves: there is no horizon, and nothing is
ever taken back. Its work (pick, drop) is an order of one node with one action. So a robot needs no more of the standard
than orders, updates and actions.

Messages get lost. The robot's state says what it knows; what it lacks is sent again from there, under the same numbers,
so that nothing is done twice. Only one update is on its way at a time.
"""

import math
import secrets
from collections.abc import Iterable
from itertools import pairwise

from chefbot_vda5050.messages import (
    Action,
    ActionParameter,
    ActionStatus,
    BlockingType,
    ConnectionState,
    Edge,
    Node,
    NodePosition,
    OperatingMode,
    State,
)
from msgspec import Struct

from chefbot_fleet.assignment import Order as Errand
from chefbot_fleet.assignment import assign
from chefbot_fleet.lanes import Space
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace, Stop
from chefbot_fleet.schedule import Move
from chefbot_fleet.store import Correction, FleetOrder, Stage, Store, Vehicle
from chefbot_fleet.traffic import Traffic
from chefbotd.core.record import Record

AT_NODE_M = 1.0
"""A robot that is new, or has lost its order, must be so near a node."""


DEVIATION_M = 0.1
"""So near a node a robot has passed it."""


MOST_REFUSALS = 10
"""So often a robot may refuse an order before somebody else's turn comes."""

REFUSED_RESEND_S = 30.0
"""Then it is asked again so seldom; it gets no other work until it has accepted."""

FARTHEST_M = 1e5
"""No place of a map is farther from its origin."""

ENDED = (ActionStatus.FINISHED, ActionStatus.FAILED)


class FleetParameters(Record, frozen=True):
    """``lost_after_s`` without a state a robot has vanished; a state comes at least every 30 s (VDA 5050, 6.10).

    What a vanished robot has reserved is freed ``lease_s`` after; infinite: only when somebody says so.
    """

    map_id: str
    lost_after_s: float = 45.0
    lease_s: float = math.inf
    resend_s: float = 3.0
    dwell_s: float = 10.0


class Outgoing(Record, frozen=True):
    """An order to be sent to a robot, still without a header."""

    robot: str
    order_id: str
    update_id: int
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]


class Contact(Struct):
    """What a robot said last, and when it was last sent something."""

    seen_s: float
    connection: ConnectionState = ConnectionState.ONLINE
    state: State | None = None
    sent_s: float = -math.inf
    sent: tuple[str, int] = ("", -1)
    refusals: int = 0


class Fleet:
    """All robots and orders. Raises ``ValueError`` for what cannot be done, with a sentence for whoever asked."""

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
        self._space = space
        self._plain, self._homes, self._store = roadmap, tuple(homes), store
        self._pace, self._parameters = pace, parameters
        self.orders = store.orders()
        self.vehicles = {vehicle.name: vehicle for vehicle in store.vehicles()}
        self.contacts: dict[str, Contact] = {}
        self.ignored: dict[str, str] = {}
        self._is_connected = True
        self._resume(now_s)

    def _resume(self, now_s: float) -> None:
        """Take up traffic where the store has it: each robot at its node, with what was released to it."""
        self.roadmap = _corrected(self._plain, self._store.corrections())
        self.traffic = Traffic(self.roadmap, self._pace)
        for vehicle in self.vehicles.values():
            self.contacts.setdefault(vehicle.name, Contact(now_s))
            self._place(vehicle, now_s)

    def _place(self, vehicle: Vehicle, now_s: float) -> None:
        robot = self.traffic.add(vehicle.name, vehicle.node, vehicle.home)
        for number, (a, b) in enumerate(pairwise([vehicle.node, *vehicle.base])):
            edge = next(k for k, end in self.roadmap.exits[a] if end == b)
            at_s = now_s + number * self._pace.duration_s(self.roadmap.length_m[edge])
            end_s = at_s + self._pace.duration_s(self.roadmap.length_m[edge])
            self.traffic.resume(robot, edge, a, b, at_s, end_s)
        task = self.orders.get(vehicle.task) if vehicle.task is not None else None
        if task is not None:
            robot.stops, robot.stops_done = self._stops(task), vehicle.stops_done
        if robot.work is None:
            vehicle.action_id = None

    def _stops(self, order: FleetOrder) -> tuple[Stop, ...]:
        dwell_s = self._parameters.dwell_s
        return Stop(self.roadmap.names[order.pick], dwell_s), Stop(self.roadmap.names[order.drop], dwell_s)

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
        self._store.save(order)
        self.orders[identifier] = order
        return order

    def remove_robot(self, name: str) -> None:
        """A vanished robot is gone: free its place, and give its order to another, unless it may have the load."""
        vehicle = self.vehicles.get(name)
        if vehicle is None:
            raise ValueError(f"there is no robot {name!a}")
        if self.traffic.robots[name].lost_s is None:
            raise ValueError(f"{name} is there: switch it off first")
        order = self.orders.get(vehicle.task) if vehicle.task is not None else None
        if order is not None:
            self._give_back(vehicle, order, f"{name} was removed")
        self._store.forget(vehicle)
        self.traffic.remove(name)
        del self.vehicles[name], self.contacts[name]

    def _give_back(self, vehicle: Vehicle, order: FleetOrder, why: str) -> None:
        """For another robot, as long as this one has not begun to load: nobody fetches what was fetched already."""
        if order.stage is Stage.PICKED or vehicle.action_id is not None:
            order.stage, order.why = Stage.FAILED, f"{why}, perhaps with its load"
        else:
            order.stage, order.robot = Stage.WAITING, None
        self._store.save(order)

    def correct(self, correction: Correction, now_s: float) -> None:
        """Change the roadmap by hand; robots get new plans on it."""
        self._check_way(correction)
        changed = _corrected(self.roadmap, [correction])
        for vehicle in self.vehicles.values():
            nodes = [vehicle.node, *vehicle.base]
            for a, b in pairwise(nodes):
                if not any(end == b for _, end in changed.exits[a]):
                    raise ValueError(f"{vehicle.name} is on its way from {a} to {b}")
        lost = {name: robot.lost_s for name, robot in self.traffic.robots.items()}
        self._store.correct(correction)
        self._resume(now_s)
        for name, lost_s in lost.items():
            if lost_s is not None:
                self.traffic.lose(name, lost_s)

    def _check_way(self, correction: Correction) -> None:
        """A new edge, or the one to a new place, leads where a robot has its clearance, by the map."""
        count = len(self.roadmap.points_m)
        if self._space is None or correction.kind == "remove edge" or not 0 <= correction.a < count:
            return
        start, end = self.roadmap.points_m[correction.a], (correction.x_m, correction.y_m)
        if correction.kind == "add edge":
            if not 0 <= correction.b < count:
                return
            end = self.roadmap.points_m[correction.b]
        if max(map(abs, end)) > FARTHEST_M or not self._space.has_way(start, end):
            from_to = f"from ({start[0]:.2f}, {start[1]:.2f}) to ({end[0]:.6g}, {end[1]:.6g})"
            raise ValueError(f"no robot can drive straight {from_to}: by the map something is in the way")

    # What robots say

    def disconnected(self) -> None:
        """No robot can be heard: none is taken for vanished, and no lease runs, until ``connected``."""
        self._is_connected = False

    def connected(self, now_s: float) -> None:
        """Robots can be heard again; each has all of its time from now on."""
        self._is_connected = True
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
                self.traffic.lose(name, now_s)

    def on_state(self, name: str, state: State, now_s: float) -> None:
        """A robot's topic ``state``; the first one of a new robot takes it into the fleet."""
        vehicle = self.vehicles.get(name) or self._adopt(name, state, now_s)
        if vehicle is None:
            return
        contact = self.contacts[name]
        contact.seen_s, contact.state, contact.connection = now_s, state, ConnectionState.ONLINE
        if state.order_id == vehicle.order_id:
            self._progress(vehicle, state, now_s)
            self._replace_deleted(vehicle, state, now_s)
        elif vehicle.order_id:
            self._find_again(vehicle, state, now_s)
        self._follow(vehicle, state, now_s)
        if self.traffic.robots[name].lost_s is not None:
            self.traffic.find(name, now_s)

    def _follow(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        """A robot that stands without an order of ours, and far from where it stood: carried, or it was wrong before.

        Whatever was released to it is not in its hands, and it takes no order that begins so far away.
        """
        has_order = bool(vehicle.base) and state.order_id == vehicle.order_id
        if has_order or vehicle.action_id is not None or state.driving or state.node_states:
            return
        if self._nearest(state, [vehicle.node, *vehicle.base]) is not None:
            return
        node = self._nearest(state, range(len(self.roadmap.points_m)))
        if node is None:
            return
        others = [other for other in self.vehicles.values() if other is not vehicle]
        why = self._reserved(node, others)
        if why is not None:
            self.ignored[vehicle.name] = f"it has been moved, and {why}"
            return
        self.ignored.pop(vehicle.name, None)
        self.traffic.remove(vehicle.name)
        vehicle.node, vehicle.base, vehicle.order_id, vehicle.update_id = node, [], "", 0
        self._store.save(vehicle)
        self._place(vehicle, now_s)
        self._plan_around(now_s)

    def _adopt(self, name: str, state: State, now_s: float) -> Vehicle | None:
        used = {vehicle.home for vehicle in self.vehicles.values()}
        homes = [home for home in self._homes if home not in used]
        node = self._nearest(state, range(len(self.roadmap.points_m)))
        why = self._obstacle(state, node, homes)
        if why is not None or node is None:
            self.ignored[name] = why or ""
            return None
        self.ignored.pop(name, None)
        home = min(homes, key=lambda home: self.roadmap.distance_m[node, home])
        vehicle = self.vehicles[name] = Vehicle(name, home, node, series=secrets.token_hex(4))
        self.contacts[name] = Contact(now_s)
        self._store.save(vehicle)
        self.traffic.add(name, node, home)
        self._plan_around(now_s)
        return vehicle

    def _plan_around(self, now_s: float) -> None:
        """New plans for all that have one: theirs know nothing of a robot that is in a new place."""
        planned = [robot.name for robot in self.traffic.robots.values() if robot.released < len(robot.moves)]
        if planned:
            self.traffic.resolve(planned, now_s)

    def _obstacle(self, state: State, node: int | None, homes: list[int]) -> str | None:
        """Why a robot cannot be taken into the fleet; it must stand idle where nobody else is or will be."""
        map_id = None if state.agv_position is None else state.agv_position.map_id
        if not homes:
            return "every home is taken"
        if map_id is not None and map_id != self._parameters.map_id:
            return f"its map is {map_id!a}, not {self._parameters.map_id!a}"
        if node is None:
            return f"it is not within {AT_NODE_M} m of a node"
        if state.driving or state.node_states:
            return "it is on its way by an order that is not ours"
        if any(action.action_status not in ENDED for action in state.action_states):
            return "it is at work by an order that is not ours"
        return self._reserved(node, self.vehicles.values())

    def _reserved(self, node: int, others: Iterable[Vehicle]) -> str | None:
        """Whose this place is now."""
        for other in others:
            nodes = [other.node, *other.base]
            edges = {edge for a, b in pairwise(nodes) for edge, end in self.roadmap.exits[a] if end == b}
            if self.roadmap.nodes_at_node[node] & set(nodes) or self.roadmap.edges_at_node[node] & edges:
                return f"its place is reserved for {other.name}"
        return None

    def _nearest(self, state: State, nodes: Iterable[int]) -> int | None:
        position = state.agv_position
        if position is None or not position.position_initialized:
            return None
        place = (position.x, position.y)
        node = min(nodes, key=lambda node: math.dist(self.roadmap.points_m[node], place))
        return node if math.dist(self.roadmap.points_m[node], place) <= AT_NODE_M else None

    def _progress(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        changed = False
        while vehicle.base and state.last_node_sequence_id >= vehicle.sequence + 2:
            vehicle.node, vehicle.sequence = vehicle.base.pop(0), vehicle.sequence + 2
            self.traffic.arrived(vehicle.name, now_s)
            changed = True
        if changed:
            self._store.save(vehicle)
        for action in state.action_states:
            if vehicle.action_id is not None and action.action_id == vehicle.action_id:
                if action.action_status is ActionStatus.FINISHED:
                    self._worked(vehicle)
                elif action.action_status is ActionStatus.FAILED:
                    self._failed(vehicle, action.result_description or "its action failed", now_s)

    def _worked(self, vehicle: Vehicle) -> None:
        order = self.orders[vehicle.task or ""]
        self.traffic.worked(vehicle.name)
        vehicle.stops_done, vehicle.action_id = vehicle.stops_done + 1, None
        order.stage = Stage.PICKED if vehicle.stops_done == 1 else Stage.DONE
        if order.stage is Stage.DONE:
            vehicle.task = None
        self._store.save(order, vehicle)

    def _failed(self, vehicle: Vehicle, why: str, now_s: float) -> None:
        order = self.orders[vehicle.task or ""]
        order.stage, order.why = Stage.FAILED, why
        vehicle.task, vehicle.action_id = None, None
        self._store.save(order, vehicle)
        self.traffic.withdraw(vehicle.name, now_s)

    def _replace_deleted(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        """A robot that was driven by hand has deleted its order (6.10.6): when it may drive, it gets another."""
        taken = (state.order_id, state.order_update_id) == (vehicle.order_id, vehicle.update_id)
        if not taken or not vehicle.base or state.node_states or state.driving:
            return
        if state.operating_mode is OperatingMode.AUTOMATIC:
            self._find_again(vehicle, state, now_s)
            if vehicle.base:
                self._new_order(vehicle, "drive")
                self._store.save(vehicle)

    def _find_again(self, vehicle: Vehicle, state: State, now_s: float) -> None:
        """A robot that stands idle without our order has restarted, or not got it yet: see how far along it stands.

        It is sent the same order again, from there on: so what it may still get of the first one changes nothing.
        """
        if state.driving or state.node_states or not vehicle.base:
            return
        nearest = self._nearest(state, [vehicle.node, *vehicle.base])
        while nearest is not None and vehicle.node != nearest:
            vehicle.node, vehicle.sequence = vehicle.base.pop(0), vehicle.sequence + 2
            self.traffic.arrived(vehicle.name, now_s)
            self._store.save(vehicle)

    # What follows

    def tick(self, now_s: float) -> list[Outgoing]:
        """What is to be sent now; call it a few times a second."""
        self._watch(now_s)
        self._assign(now_s)
        for name, move in self.traffic.release(now_s):
            self._extend(self.vehicles[name], move)
        for vehicle in self.vehicles.values():
            robot = self.traffic.robots[vehicle.name]
            if robot.work is not None and vehicle.action_id is None and robot.lost_s is None:
                self._begin_work(vehicle)
        outgoing = [self._due(vehicle, now_s) for vehicle in self.vehicles.values()]
        return [order for order in outgoing if order is not None]

    def _watch(self, now_s: float) -> None:
        if not self._is_connected:
            return
        for name, contact in list(self.contacts.items()):
            robot = self.traffic.robots[name]
            if robot.lost_s is None and now_s > contact.seen_s + self._parameters.lost_after_s:
                self.traffic.lose(name, now_s)
            if robot.lost_s is not None and now_s > robot.lost_s + self._parameters.lease_s:
                self.remove_robot(name)

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
            if robot.is_idle and robot.lost_s is None and self.contacts[robot.name].refusals < MOST_REFUSALS
        }
        for name, errand in assign(self.roadmap, free, waiting, now_s):
            order, vehicle = self.orders[errand.identifier], self.vehicles[name]
            if self.traffic.assign(name, self._stops(order), now_s):
                order.stage, order.robot, order.why = Stage.ASSIGNED, name, None
                vehicle.task, vehicle.stops_done = order.identifier, 0
                self._store.save(order, vehicle)

    def _extend(self, vehicle: Vehicle, move: Move) -> None:
        """One more node in the base: of the order that the robot drives by, or of a new one."""
        if not vehicle.order_id or vehicle.order_id.endswith("work"):
            self._new_order(vehicle, "drive")
        else:
            vehicle.update_id += 1
        vehicle.base.append(move.target)
        self._store.save(vehicle)

    def _new_order(self, vehicle: Vehicle, what: str) -> None:
        vehicle.trips += 1
        vehicle.order_id, vehicle.update_id = f"{vehicle.name}-{vehicle.series}-{vehicle.trips}-{what}", 0
        vehicle.sequence += (
            2  # a robot that compares node and sequenceId alone would take the node for one it has passed
        )

    def _begin_work(self, vehicle: Vehicle) -> None:
        state = self.contacts[vehicle.name].state
        if state is None or (vehicle.order_id and (state.order_id != vehicle.order_id or state.node_states)):
            return
        self._new_order(vehicle, "work")
        vehicle.action_id = f"{vehicle.task}-{vehicle.stops_done}-{vehicle.series}.{vehicle.trips}"
        self._store.save(vehicle)

    def _due(self, vehicle: Vehicle, now_s: float) -> Outgoing | None:
        """The robot's order if it lacks something: at once if it knows what came before, else again after a while."""
        contact, state = self.contacts[vehicle.name], self.contacts[vehicle.name].state
        if not vehicle.order_id or state is None or self.traffic.robots[vehicle.name].lost_s is not None:
            return None
        current = (vehicle.order_id, vehicle.update_id)
        reported = (state.order_id, state.order_update_id)
        if reported == current:
            self._accepted(vehicle, contact)
            return None
        is_first = contact.sent != current and (contact.sent == reported or not contact.sent[0])
        pause_s = self._parameters.resend_s if contact.refusals < MOST_REFUSALS else REFUSED_RESEND_S
        if not is_first and now_s < contact.sent_s + pause_s:
            return None
        why = _refusal(state, vehicle.order_id) if contact.seen_s > contact.sent_s else None
        if why is not None:
            self._refused(vehicle, contact, f"{vehicle.name} refuses it: {why}", now_s)
        contact.sent, contact.sent_s = current, now_s
        return self._message(vehicle, state)

    def _accepted(self, vehicle: Vehicle, contact: Contact) -> None:
        order = self.orders.get(vehicle.task) if vehicle.task is not None else None
        if contact.refusals and order is not None:
            order.why = None
            self._store.save(order)
        contact.refusals = 0

    def _refused(self, vehicle: Vehicle, contact: Contact, why: str, now_s: float) -> None:
        """Once more; too often, and the work is another robot's."""
        contact.refusals += 1
        order = self.orders.get(vehicle.task) if vehicle.task is not None else None
        if order is None:
            return
        order.why = why
        if contact.refusals < MOST_REFUSALS:
            self._store.save(order)
            return
        self._give_back(vehicle, order, why)
        vehicle.task, vehicle.action_id = None, None
        self._store.save(vehicle)
        self.traffic.withdraw(vehicle.name, now_s)

    def _message(self, vehicle: Vehicle, state: State) -> Outgoing:
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
            self._node(vehicle, node, sequence + 2 * k, DEVIATION_M if k or is_known else AT_NODE_M)
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

    def _node(self, vehicle: Vehicle, node: int, sequence: int, deviation_m: float) -> Node:
        x_m, y_m = self.roadmap.points_m[node]
        actions: tuple[Action, ...] = ()
        if vehicle.action_id is not None:
            order = self.orders[vehicle.task or ""]
            actions = (
                Action(
                    action_type="pick" if vehicle.stops_done == 0 else "drop",
                    action_id=vehicle.action_id,
                    blocking_type=BlockingType.HARD,
                    action_parameters=(ActionParameter(key="loadId", value=order.identifier),),
                ),
            )
        position = NodePosition(
            x=x_m, y=y_m, map_id=self._parameters.map_id, allowed_deviation_xy=deviation_m
        )
        return Node(
            node_id=str(node), sequence_id=sequence, released=True, actions=actions, node_position=position
        )


def _refusal(state: State, order_id: str) -> str | None:
    """Why a robot does not take an order, if it says so (6.6.5: the error refers to ``orderId``)."""
    for error in state.errors:
        references = error.error_references or ()
        if any((one.reference_key, one.reference_value) == ("orderId", order_id) for one in references):
            return " - ".join(filter(None, (error.error_type, error.error_description)))
    return None


def _corrected(roadmap: Roadmap, corrections: Iterable[Correction]) -> Roadmap:
    for one in corrections:
        if one.kind == "add edge":
            roadmap = roadmap.with_edge(one.a, one.b)
        elif one.kind == "remove edge":
            roadmap = roadmap.without_edge(one.a, one.b)
        elif one.kind == "add place":
            roadmap = roadmap.with_node((one.x_m, one.y_m), one.a)
        else:
            raise ValueError(f"{one.kind!a}: expected 'add edge', 'remove edge' or 'add place'")
    return roadmap
