"""Robots that obey traffic's releases in simulated time: slower than planned, delayed, and sometimes gone.

Discs move along straight edges. Whether two touch is measured between the discs alone, from nothing that traffic knows.
"""

import math
import random
from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from chefbot_fleet.assignment import Order, assign
from chefbot_fleet.roadmap import Point, Roadmap
from chefbot_fleet.routes import Pace, Stop
from chefbot_fleet.schedule import Move
from chefbot_fleet.traffic import Traffic
from chefbotd.core.record import Record

STEP_S = 0.25


class Disturbance(Record, frozen=True):
    """What goes wrong. Speeds lie between ``slowest`` and ``fastest`` times the planned one, anew for each edge.

    ``delay_share`` of the edges cost up to ``delay_s`` more. Every ``vanish_every_s`` on the average one of the robots
    vanishes for up to ``vanish_s``; half of them drive on to their last released node, the others stop at once.
    The first ``removed`` of them are carried away for good.
    """

    slowest: float = 1.0
    fastest: float = 1.0
    delay_share: float = 0.0
    delay_s: float = 0.0
    vanish_every_s: float = math.inf
    vanish_s: float = 0.0
    removed: int = 0


CALM = Disturbance()
ROUGH = Disturbance(0.6, 1.1, 0.03, 30.0, 600.0, 120.0, 1)


class Body(Struct, eq=False):
    """A simulated robot: where it is, what it was told to drive, and what holds it."""

    point: Point
    moves: list[Move] = []
    progress_m: float = 0.0
    pause_s: float = 0.0
    work_s: float | None = None
    gone_until_s: float | None = None
    stopped: bool = False
    unreported: int = 0
    driven_m: float = 0.0
    factor: float = 1.0


class Result(Record, frozen=True):
    """What a run came to; ``done`` counts how often each order was brought."""

    seconds: float
    done: dict[str, int]
    least_distance_m: float
    deadlocks: int
    replans: int
    driven_m: float
    vanished: int

    @property
    def per_hour(self) -> float:
        """Orders brought per hour."""
        return sum(self.done.values()) / self.seconds * 3600


class FleetSimulation:
    """Traffic, assignment and simulated robots, in steps of ``STEP_S``."""

    def __init__(
        self,
        roadmap: Roadmap,
        pace: Pace,
        homes: Sequence[int],
        orders: Sequence[Order],
        *,
        dwell_s: float,
        disturbance: Disturbance,
        seed: int,
    ) -> None:
        self.roadmap, self.now_s = roadmap, 0.0
        self.traffic = Traffic(roadmap, pace, seed=seed)
        self.bodies: dict[str, Body] = {}
        for k, home in enumerate(homes):
            self.traffic.add(f"robot {k + 1}", home, home)
            self.bodies[f"robot {k + 1}"] = Body(roadmap.points_m[home])
        self._pace, self._dwell_s, self._disturbance = pace, dwell_s, disturbance
        self._chance = random.Random(seed)
        self._waiting = list(orders)
        self._busy: dict[str, Order] = {}
        self.done: dict[str, int] = {order.identifier: 0 for order in orders}
        self.least_m, self.vanished, self._removed = math.inf, 0, 0

    def run(self, longest_s: float) -> Result:
        """Go on until every order is brought, or the time is up."""
        while (self._waiting or self._busy) and self.now_s < longest_s:
            self.step()
        driven_m = sum(body.driven_m for body in self.bodies.values())
        traffic = self.traffic
        return Result(
            self.now_s, self.done, self.least_m, traffic.deadlocks, traffic.replans, driven_m, self.vanished
        )

    def step(self) -> None:
        """One step of time."""
        self._give_orders()
        for name, move in self.traffic.release(self.now_s):
            self._obey(self.bodies[name], move)
        self.now_s += STEP_S
        for name, body in list(self.bodies.items()):
            self._vanish(name, body)
            if name in self.bodies:
                self._drive(name, body)
                self._work(name, body)
        points = np.array([body.point for body in self.bodies.values()])
        apart_m = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
        np.fill_diagonal(apart_m, np.inf)
        self.least_m = min(self.least_m, float(apart_m.min()))

    def _give_orders(self) -> None:
        if not self._waiting or round(self.now_s / STEP_S) % 4:
            return
        free = {
            robot.name: robot.last_released_node
            for robot in self.traffic.robots.values()
            if robot.is_idle and robot.lost_s is None
        }
        for name, order in assign(self.roadmap, free, self._waiting, self.now_s):
            stops = (Stop(order.pick, self._dwell_s), Stop(order.drop, self._dwell_s))
            if self.traffic.assign(name, stops, self.now_s):
                self._waiting.remove(order)
                self._busy[name] = order

    def _obey(self, body: Body, move: Move) -> None:
        if not body.moves:
            self._begin(body)
        body.moves.append(move)

    def _begin(self, body: Body) -> None:
        chance, what = self._chance, self._disturbance
        body.progress_m, body.pause_s = 0.0, self._pace.node_s
        body.factor = chance.uniform(what.slowest, what.fastest)
        if chance.random() < what.delay_share:
            body.pause_s += chance.uniform(0, what.delay_s)

    def _drive(self, name: str, body: Body) -> None:
        left_s = STEP_S
        while body.moves and left_s > 0 and not body.stopped:
            paused_s = min(body.pause_s, left_s)
            body.pause_s, left_s = body.pause_s - paused_s, left_s - paused_s
            move, speed_m_s = body.moves[0], body.factor * self._pace.speed_m_s
            length_m = self.roadmap.length_m[move.edge]
            driven_m = min(speed_m_s * left_s, length_m - body.progress_m)
            body.progress_m, left_s = body.progress_m + driven_m, left_s - driven_m / speed_m_s
            body.driven_m += driven_m
            start, end = self.roadmap.points_m[move.origin], self.roadmap.points_m[move.target]
            share = body.progress_m / length_m
            body.point = (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
            if body.progress_m >= length_m - 1e-9:
                body.moves.pop(0)
                self._begin(body)
                body.unreported += 1
        if body.gone_until_s is None:
            while body.unreported:
                self.traffic.arrived(name, self.now_s)
                body.unreported -= 1

    def _work(self, name: str, body: Body) -> None:
        robot = self.traffic.robots[name]
        if body.gone_until_s is not None or robot.work is None:
            return
        if body.work_s is None:
            slower = self._chance.uniform(1.0, 1.5) if self._disturbance.slowest < 1 else 1.0
            body.work_s = self.now_s + robot.work.dwell_s * slower
        if self.now_s >= body.work_s:
            body.work_s = None
            self.traffic.worked(name)
            if robot.is_idle:
                self.done[self._busy.pop(name).identifier] += 1

    def _vanish(self, name: str, body: Body) -> None:
        what, chance = self._disturbance, self._chance
        if body.gone_until_s is None:
            if chance.random() < STEP_S / what.vanish_every_s / len(self.bodies):
                self.vanished += 1
                body.gone_until_s, body.stopped = (
                    self.now_s + chance.uniform(5, what.vanish_s),
                    chance.random() < 0.5,
                )
                self.traffic.lose(name, self.now_s)
        elif self.now_s >= body.gone_until_s:
            body.gone_until_s, body.stopped = None, False
            if self._removed < what.removed and len(self.bodies) > 1:
                self._carry_away(name)
            else:
                self.traffic.find(name, self.now_s)

    def _carry_away(self, name: str) -> None:
        """Somebody takes the robot off the floor, and gives its order to another."""
        self._removed += 1
        self.traffic.remove(name)
        del self.bodies[name]
        order = self._busy.pop(name, None)
        if order is not None:
            self._waiting.append(order)
