"""New plans for several robots at once, which fit the others' plans: in several orders, and with robots that yield."""

import math
import random
from collections.abc import Set
from typing import TypeAlias

from chefbot_fleet.routes import Reservations, Step
from chefbot_fleet.schedule import Robot, Schedule

ATTEMPTS = 12
"""So many orders of planning are tried when several robots need new plans at once."""

GRACE_EDGES = (0, 4, 12, 30)
"""Then a robot that is planned for first leaves the others where they stand for the time of so many edges, in turn."""

MOST_YIELDS = 6
"""So many passing places are tried, the nearest first."""

Plan: TypeAlias = tuple[Robot, tuple[Step, ...]]


class Replanning:
    """Plans for robots that have none. The same seed and calls give the same plans."""

    def __init__(self, schedule: Schedule, seed: int) -> None:
        self._schedule, self._roadmap = schedule, schedule.roadmap
        self.count = 0
        self._chance = random.Random(seed)

    def replan(self, robots: list[Robot], now_s: float) -> None:
        """Give robots without a plan one that fits all others'; who gets none stays where it is, and tries again."""
        self.count += 1
        self._schedule.retime(now_s)
        order = list(robots)
        best = len(robots) + 1
        chosen: list[Plan] = []
        edge_s = self._schedule.pace.duration_s(sum(self._roadmap.length_m) / len(self._roadmap.edges))
        for attempt in range(ATTEMPTS):
            grace_s = GRACE_EDGES[attempt % len(GRACE_EDGES)] * edge_s
            yields = {
                robot.name for robot in order if attempt >= ATTEMPTS // 2 and self._chance.random() < 0.5
            }
            plans, failed = self._attempt(order, now_s, now_s + grace_s, yields)
            self._schedule.drop_unreleased(robots)
            if len(failed) < best and not (failed and self._collides(failed, plans)):
                best, chosen = len(failed), plans
            if not failed:
                break
            rest = [robot for robot in order if robot not in failed]
            self._chance.shuffle(rest)
            order = [*failed, *rest]
        for robot, steps in chosen:
            self._schedule.set_plan(robot, steps)
        for robot in robots:
            robot.tried_s = now_s

    def _attempt(
        self, order: list[Robot], now_s: float, grace_until_s: float, yields: Set[str]
    ) -> tuple[list[Plan], list[Robot]]:
        """Plans in this order, and who got none; those of ``yields`` go out of the way first."""
        plans, failed = [], list[Robot]()
        pending = {robot.name for robot in order}
        for robot in order:
            reserved = self._schedule.reservations(robot, pending)
            for other in order:
                if other is not robot and other.name in pending:
                    reserved.stay(self._roadmap, other.last_released_node, (-math.inf, grace_until_s))
            steps = None
            if robot.name not in yields:
                steps = self._schedule.steps(robot, robot.stops[robot.stops_done :], now_s, reserved)
            if steps is None:
                steps = self._yield(robot, now_s, reserved)
            if steps is None:
                failed.append(robot)
                continue
            pending.discard(robot.name)
            plans.append((robot, steps))
            self._schedule.set_plan(robot, steps)
        return plans, failed

    def _yield(self, robot: Robot, now_s: float, reserved: Reservations) -> tuple[Step, ...] | None:
        """A plan out of the others' way: home, or to a passing place nearby that stays free."""
        distance_m = self._roadmap.distance_m[robot.last_released_node]
        used = {other.home for other in self._schedule.robots.values()} - {robot.home}
        places = [
            node for node in self._roadmap.passing_places if node not in used and not reserved.nodes[node]
        ]
        places.sort(key=lambda node: distance_m[node])
        for end in (robot.home, *places[:MOST_YIELDS]):
            if not self._roadmap.nodes_at_node[end] & (used - {robot.home}):
                steps = self._schedule.steps(robot, (), now_s, reserved, end)
                if steps is not None:
                    return tuple(Step(s.edge, s.origin, s.target, s.start_s, s.end_s, 0) for s in steps)
        return None

    def _collides(self, failed: list[Robot], plans: list[Plan]) -> bool:
        """Whether a new plan leads past a robot that would stay where it is."""
        return any(
            step.edge in self._roadmap.edges_at_node[robot.last_released_node]
            for robot in failed
            for _, steps in plans
            for step in steps
        )
