"""A manager, its database, two robots in a corridor and a broker, in simulated time; each of them can be killed."""

import contextlib
import math
import random
import sqlite3
from pathlib import Path

import numpy as np
from chefbot_fleet.fleet import Fleet
from chefbot_fleet.orders import CancelOrder, Outgoing
from chefbot_fleet.records import FleetParameters
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace
from chefbot_fleet.store import Stage, Store
from chefbot_vda5050.messages import ConnectionState
from fleet_robots import StandardRobot

from chefbotd.components.maps.algorithms.map_server import to_description, to_image
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, OccupancyGrid

HOMES = (0, 4, 5)
PLACES = {"counter": (1.0, 2.4), "table": (8.5, 2.4)}
VICTIMS = ("manager", "broker", "robot")


def small_roadmap() -> Roadmap:
    """A corridor with a passing place, and two places to work, each beside a node of it.

    ::

           6  5  7
           |  |  |
        0--1--2--3--4
    """
    points = ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (4.0, 0.0), (2.0, 1.0), (1.0, 1.0), (3.0, 1.0))
    edges = ((0, 1), (1, 2), (2, 3), (3, 4), (2, 5), (1, 6), (3, 7))
    return Roadmap(points, edges, 0.6, {"counter": 6, "table": 7})


def write_map(folder: Path) -> None:
    """A hall of 9.8 by 3 m, and the places."""
    cells = np.full((68, 200), OCCUPIED, np.int8)
    cells[2:-2, 2:-2] = FREE
    grid = OccupancyGrid(0.05, Pose2D(), cells)
    (folder / "map.pgm").write_bytes(to_image(grid))
    (folder / "map.yaml").write_text(to_description(grid, "map.pgm"))
    lines = [f"{name}: [{x}, {y}]" for name, (x, y) in PLACES.items()]
    (folder / "places.yaml").write_text("\n".join(lines))


class World:
    """A manager with its database, robots, and a broker that can be down."""

    def __init__(
        self, roadmap: Roadmap, path: Path, robots: int = 2, seed: int = 0, lease_s: float = math.inf
    ) -> None:
        self._lease_s = lease_s
        self.roadmap, self.path, self.now_s, self.chance = roadmap, path, 0.0, random.Random(seed)
        self.robots = {f"r{k}": StandardRobot(f"r{k}", roadmap, HOMES[k]) for k in range(robots)}
        self.broker_down_until_s = -1.0
        self.loss = 0.0
        self.fleet = self.start()

    def start(self) -> Fleet:
        """A manager on what is in the database."""
        self.store = Store(self.path)
        parameters = FleetParameters("map", lost_after_s=20.0, lease_s=self._lease_s, dwell_s=3.0)
        self._is_down = False
        return Fleet(self.roadmap, HOMES, self.store, Pace(0.5, 0.0), parameters, self.now_s)

    def kill_manager(self) -> None:
        """And start it again: nothing is left of it but the database."""
        self.store.close()
        self.fleet = self.start()

    def passes(self) -> bool:
        """Whether a message gets through now."""
        return self.now_s > self.broker_down_until_s and self.chance.random() >= self.loss

    def step(self) -> None:
        """Half a second."""
        self.now_s += 0.5
        is_down = self.now_s <= self.broker_down_until_s
        if is_down and not self._is_down:
            self.fleet.disconnected()
        elif self._is_down and not is_down:
            self.fleet.connected(self.now_s)
        self._is_down = is_down
        for robot in self.robots.values():
            robot.step(self.now_s)
            if self.passes():
                with contextlib.suppress(sqlite3.Error):  # as the manager does
                    self.fleet.on_state(robot.name, robot.state(), self.now_s)
        due: list[Outgoing | CancelOrder] = []
        with contextlib.suppress(sqlite3.Error):
            due = self.fleet.tick(self.now_s)
        for outgoing in due:
            if self.passes() and outgoing.robot in self.robots:
                self.deliver(outgoing)

    def deliver(self, outgoing: Outgoing | CancelOrder) -> None:
        """A message reaches its robot."""
        robot = self.robots[outgoing.robot]
        if isinstance(outgoing, CancelOrder):
            robot.cancel(outgoing.action_id)
        else:
            robot.receive(outgoing)

    def run(self, most_s: float) -> None:
        """Until every order is done."""
        end_s = self.now_s + most_s
        while self.now_s < end_s and any(o.stage is not Stage.DONE for o in self.fleet.orders.values()):
            self.step()

    def work(self) -> list[str]:
        """All that robots have done, as order and kind, without repetitions of a robot that forgot."""
        ids = {action_id for robot in self.robots.values() for action_id, _ in robot.worked}
        return sorted(action_id.rsplit("-", 1)[0] for action_id in ids)

    def give(self, count: int) -> None:
        """So many orders, there and back in turn."""
        for k in range(count):
            pick, drop = ("counter", "table") if k % 2 else ("table", "counter")
            self.fleet.add_order(f"o{k}", pick, drop, self.now_s)

    def kill_and_go_on(self, victim: str) -> None:
        """One of ``VICTIMS`` at a random moment; then on, until every order is done."""
        for _ in range(self.chance.randrange(4, 100)):
            self.step()
        if victim == "manager":
            self.kill_manager()
        elif victim == "broker":
            self.broker_down_until_s = self.now_s + self.chance.uniform(1.0, 40.0)
        else:
            self.robots["r0"].restart()
        self.run(1000.0)

    def kill_robots_and_go_on(self, times: int) -> None:
        """A robot at a random moment, again and again; then on, until every order is done.

        Its connection breaks, and up to two seconds later it is there again, without its order.
        """
        for _ in range(times):
            for _ in range(self.chance.randrange(1, 8)):
                self.step()
            name = self.chance.choice(sorted(self.robots))
            robot = self.robots.pop(name)
            self.fleet.on_connection(name, ConnectionState.BROKEN, self.now_s)
            for _ in range(self.chance.randrange(5)):
                self.step()
            robot.restart()
            self.robots[name] = robot
        self.run(1000.0)

    def lost(self) -> int:
        """Orders that are not done."""
        return sum(order.stage is not Stage.DONE for order in self.fleet.orders.values())

    def done_by_two(self) -> int:
        """Fetchings and bringings that more than one robot did."""
        by: dict[str, set[str]] = {}
        for robot in self.robots.values():
            for action_id, _ in robot.worked:
                by.setdefault(action_id.rsplit("-", 1)[0], set()).add(robot.name)
        return sum(len(names) > 1 for names in by.values())

    def repeated(self) -> int:
        """Fetchings and bringings that were done again."""
        done = [
            action_id.rsplit("-", 1)[0] for robot in self.robots.values() for action_id, _ in robot.worked
        ]
        return len(done) - len(set(done))


def steps(world: World, seconds: float) -> None:
    """Let so much time pass."""
    end_s = world.now_s + seconds
    while world.now_s < end_s:
        world.step()
