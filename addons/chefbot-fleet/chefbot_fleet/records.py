"""What the manager knows: orders, robots and what they said last, the roadmap and traffic; kept in the store."""

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import Final

from chefbot_vda5050.messages import ConnectionState, State
from msgspec import Struct

from chefbot_fleet.corrections import corrected
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace, Stop
from chefbot_fleet.store import FleetOrder, Stage, Store, Vehicle
from chefbot_fleet.traffic import Traffic
from chefbotd.core.record import Record

MOST_NAMES: Final = 256
"""Of robots that are not in the fleet: names come from the broker, where anybody may invent them."""

LONGEST_REASON: Final = 300


class Newest(dict[str, str]):
    """So many sentences by name: a new name takes the place of the oldest."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def __setitem__(self, name: str, text: str) -> None:
        """Keep a sentence, cut where it is long."""
        if name not in self and len(self) >= self._most:
            del self[next(iter(self))]
        super().__setitem__(name, text if len(text) <= LONGEST_REASON else f"{text[: LONGEST_REASON - 1]}…")


class FleetParameters(Record, frozen=True):
    """``lost_after_s`` without a state a robot has vanished; a state comes at least every 30 s (VDA 5050, 6.10).

    What a vanished robot has reserved is freed ``lease_s`` after; infinite: only when somebody says so.
    """

    map_id: str
    lost_after_s: float = 45.0
    lease_s: float = math.inf
    resend_s: float = 3.0
    dwell_s: float = 10.0


class Contact(Struct):
    """What a robot said last, and when it was last sent something; ``foreign`` is another's order that it is doing."""

    seen_s: float
    connection: ConnectionState = ConnectionState.ONLINE
    state: State | None = None
    sent_s: float = -math.inf
    sent: tuple[str, int] = ("", -1)
    refusals: int = 0
    foreign: str | None = None
    cancel_sent_s: float = -math.inf
    cancels_sent: int = 0
    recalled_s: float = -math.inf


class FleetRecords:
    """All robots and orders; ``ignored`` says why a robot is not in the fleet, or not where it says.

    ``notices`` are sentences for the log.
    """

    def __init__(
        self,
        roadmap: Roadmap,
        homes: Iterable[int],
        store: Store,
        pace: Pace,
        parameters: FleetParameters,
        now_s: float,
    ) -> None:
        self._plain, self.homes, self.store = roadmap, tuple(homes), store
        self.pace, self.parameters = pace, parameters
        self.orders = store.orders()
        self.vehicles = {vehicle.name: vehicle for vehicle in store.vehicles()}
        self.contacts: dict[str, Contact] = {}
        self.ignored: dict[str, str] = Newest(MOST_NAMES)
        self.notices: list[str] = []
        self._failures = store.failures
        self.resume(now_s)

    def follow_disk(self, now_s: float) -> None:
        """Where a write has failed since the last time, make traffic again: it may have gone on without it."""
        if self._failures != self.store.failures:
            self._failures = self.store.failures
            self.make_traffic_again(now_s)

    def make_traffic_again(self, now_s: float) -> None:
        """As the disk has it; who has vanished, and what strangers occupy, stays so."""
        lost = {name: robot.lost_s for name, robot in self.traffic.robots.items()}
        occupied = self.traffic.occupied
        self.resume(now_s)
        for name, lost_s in lost.items():
            if lost_s is not None and name in self.vehicles:
                self.traffic.lose(name, lost_s)
        for name, path in occupied.items():
            self.traffic.occupy(name, path, now_s)

    def resume(self, now_s: float) -> None:
        """Take up traffic where the store has it: each robot at its node, with what was released to it."""
        self.roadmap = corrected(self._plain, self.store.corrections())
        self.traffic = Traffic(self.roadmap, self.pace)
        for vehicle in self.vehicles.values():
            self.contacts.setdefault(vehicle.name, Contact(now_s))
            self.place(vehicle, now_s)

    def place(self, vehicle: Vehicle, now_s: float) -> None:
        """Put a robot into traffic: where it is, with what was released to it and the work that it has."""
        robot = self.traffic.add(vehicle.name, vehicle.node, vehicle.home)
        for number, (a, b) in enumerate(pairwise([vehicle.node, *vehicle.base])):
            edge = next(k for k, end in self.roadmap.exits[a] if end == b)
            at_s = now_s + number * self.pace.duration_s(self.roadmap.length_m[edge])
            end_s = at_s + self.pace.duration_s(self.roadmap.length_m[edge])
            self.traffic.resume(robot, edge, a, b, at_s, end_s)
        task = self.orders.get(vehicle.task) if vehicle.task is not None else None
        if task is not None:
            robot.stops, robot.stops_done = self.stops(task), vehicle.stops_done
        if not robot.is_at_stop:
            vehicle.action_id = None

    def stops(self, order: FleetOrder) -> tuple[Stop, ...]:
        """Where an order's work is to be done."""
        dwell_s = self.parameters.dwell_s
        return Stop(self.roadmap.names[order.pick], dwell_s), Stop(self.roadmap.names[order.drop], dwell_s)

    def advance(self, vehicle: Vehicle, count: int, now_s: float) -> None:
        """A robot has reached so many more nodes of its base."""
        self.move_on(vehicle, count, now_s)
        if count:
            self.store.save(vehicle)

    def move_on(self, vehicle: Vehicle, count: int, now_s: float) -> None:
        """The same, for who saves it with what follows."""
        for _ in range(count):
            vehicle.node, vehicle.sequence = vehicle.base.pop(0), vehicle.sequence + 2
            self.traffic.arrived(vehicle.name, now_s)

    def give_back(self, vehicle: Vehicle, order: FleetOrder, why: str) -> None:
        """For another robot, as long as this one has not begun to load: nobody fetches what was fetched already.

        Whoever calls this saves it, with what becomes of the robot: else both might have the order.
        """
        has_load = vehicle.stops_done > 0 or vehicle.action_id is not None
        if order.stage is Stage.CANCELLING:
            order.stage, order.why = Stage.CANCELLED, f"{why}, perhaps with its load" if has_load else None
        elif has_load:
            order.stage, order.why = Stage.FAILED, f"{why}, perhaps with its load"
        else:
            order.stage, order.robot = Stage.WAITING, None

    def plan_around(self, now_s: float) -> None:
        """New plans for all that have one: theirs know nothing of a robot that is in a new place."""
        planned = [robot.name for robot in self.traffic.robots.values() if robot.released < len(robot.moves)]
        if planned:
            self.traffic.resolve(planned, now_s)
