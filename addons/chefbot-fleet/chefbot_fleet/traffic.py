"""Who may drive where, and when: plans, their order at each place, and what is released.

Every robot has a plan that ends at its own home, where it blocks nobody (*Roadmap.homes*). A new plan is only taken if
it fits the others' plans in time; until then the robot keeps the plan that it has. So there is always a way for all to
get home, and no deadlock. Method: token passing (Ma et al., "Lifelong multi-agent path finding for online pickup and
delivery tasks", AAMAS 2017).

A robot that vanishes keeps what was released to it, since it may drive on. Whoever waits for it gets a new plan.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

from chefbot_fleet.replanning import Replanning
from chefbot_fleet.roadmap import Point, Roadmap
from chefbot_fleet.routes import Pace, Reservations, Stop
from chefbot_fleet.schedule import Move, Occupied, Robot, Schedule
from chefbotd.core.record import Record

RETRY_S = 5.0
"""A robot without a plan tries again so often."""

RETRY_ALL_S = 30.0
"""If it still has none, all others get new plans together with it so often."""


class Wait(Record, frozen=True):
    """Why a robot does not drive on: it needs what ``waits_for`` uses first, at ``node``."""

    robot: str
    waits_for: str
    node: int


class Traffic:
    """The plans of all robots. Time is an argument, and chance a seed: the same calls give the same plans."""

    def __init__(self, roadmap: Roadmap, pace: Pace, *, horizon: int = 2, seed: int = 0) -> None:
        """``horizon`` moves at most are released to a robot and not over."""
        self.roadmap, self._pace, self._horizon = roadmap, pace, horizon
        self._schedule = Schedule(roadmap, pace)
        self._replanning = Replanning(self._schedule, seed)
        self.robots = self._schedule.robots
        self.deadlocks = 0
        self._checked_s = self._all_replanned_s = -math.inf

    @property
    def replans(self) -> int:
        """How often several robots got new plans at once."""
        return self._replanning.count

    def add(self, name: str, node: int, home: int) -> Robot:
        """A robot that stands at a node."""
        robot = self.robots[name] = Robot(name, home, node)
        return robot

    def resume(self, robot: Robot, edge: int, origin: int, target: int, start_s: float, end_s: float) -> None:
        """Tell of a move that was released before all this began."""
        self._schedule.resume(robot, edge, origin, target, start_s, end_s)

    def assign(self, name: str, stops: Sequence[Stop], now_s: float) -> bool:
        """Give an idle robot work; False if it fits no plan yet, and the robot keeps the plan that it has."""
        robot = self.robots[name]
        if robot.lost_s is not None or robot.held or not robot.is_idle:
            return False
        self._schedule.retime(now_s)
        steps = self._schedule.steps(robot, tuple(stops), now_s, self._schedule.reservations(robot))
        if steps is None:
            return False
        robot.stops, robot.stops_done = tuple(stops), 0
        self._schedule.set_plan(robot, steps)
        return True

    def withdraw(self, name: str, now_s: float) -> None:
        """Take a robot's work away; it drives home."""
        robot = self.robots[name]
        robot.stops, robot.stops_done = (), 0
        self._schedule.retime(now_s)
        steps = self._schedule.steps(robot, (), now_s, self._schedule.reservations(robot))
        if steps is not None:
            self._schedule.set_plan(robot, steps)

    def take_back(self, name: str, keep: int = 0) -> None:
        """Tell that a robot does not have what was released to it, but for so many moves."""
        self._schedule.cut(self.robots[name], keep)

    def arrived(self, name: str, now_s: float) -> None:
        """Tell that the first released move is over."""
        robot = self.robots[name]
        if not robot.released:
            raise ValueError(f"{name}: nothing was released that could be over")
        move = robot.moves.pop(0)
        robot.released -= 1
        robot.node = move.target
        work = robot.work
        if work is not None:
            robot.ready_s = now_s + work.dwell_s
        self._schedule.forget({move.number})

    def worked(self, name: str) -> None:
        """Tell that the work is done where the robot stands."""
        robot = self.robots[name]
        if not robot.is_at_stop:
            raise ValueError(f"{name}: no work is due at node {robot.node}")
        robot.stops_done += 1
        robot.ready_s = -math.inf

    def release(self, now_s: float) -> list[tuple[str, Move]]:
        """Release all moves that nothing is in the way of; try again for robots without a plan; resolve a deadlock."""
        self._retry(now_s)
        if now_s >= self._checked_s + RETRY_S:
            self._checked_s = now_s
            if cycle := self.deadlock():
                self.deadlocks += 1
                self.resolve(cycle, now_s)
        return [(robot.name, move) for robot in self.robots.values() for move in self._released(robot, now_s)]

    def _released(self, robot: Robot, now_s: float) -> Iterator[Move]:
        while (
            robot.lost_s is None and not robot.held and robot.released < min(self._horizon, len(robot.moves))
        ):
            move = robot.moves[robot.released]
            if move.after or move.stops_done > robot.stops_done:
                return
            length_s = self._pace.duration_s(self.roadmap.length_m[move.edge])
            move.start_s = robot.moves[robot.released - 1].end_s if robot.released else now_s
            move.end_s = move.start_s + length_s
            robot.released += 1
            yield move

    def lose(self, name: str, now_s: float) -> None:
        """Take a robot for vanished: what was released to it stays reserved, and who waits for it gets a new plan."""
        robot = self.robots[name]
        if robot.lost_s is None:
            robot.lost_s = now_s
            self.resolve({name}, now_s)

    def find(self, name: str, now_s: float) -> None:
        """Tell that a robot is there again, where its last ``arrived`` and what was released to it say."""
        robot = self.robots[name]
        robot.lost_s, robot.tried_s = None, -math.inf
        self._retry(now_s)

    def remove(self, name: str) -> Robot:
        """Take a robot off the map, with all that is reserved for it: somebody carried it away, or its lease is over."""
        robot = self.robots.pop(name)
        self._schedule.forget({move.number for move in robot.moves})
        return robot

    def occupy(self, name: str, path: Sequence[Point], now_s: float) -> None:
        """Tell where a robot is that has no plan here; who was to pass there gets a new plan, as far as there is one."""
        occupied = Occupied(tuple(path), *self.roadmap.excluded_by(path))
        self._schedule.occupied[name] = occupied
        passing = {
            robot.name
            for robot in self.robots.values()
            if robot.lost_s is None and any(m.edge in occupied.edges for m in robot.moves[robot.released :])
        }
        if passing:
            self.resolve(passing, now_s)

    @property
    def occupied(self) -> dict[str, tuple[Point, ...]]:
        """The paths of robots that have no plan here."""
        return {name: occupied.path for name, occupied in self._schedule.occupied.items()}

    def released_into(self, name: str) -> list[str]:
        """The robots to which a move was released that is not over and leads where this one is, without a plan here."""
        occupied = self._schedule.occupied.get(name)
        return [
            robot.name
            for robot in self.robots.values()
            if occupied is not None
            and robot.name != name
            and any(move.edge in occupied.edges for move in robot.moves[: robot.released])
        ]

    def vacate(self, name: str) -> None:
        """Tell that such a robot is there no more."""
        self._schedule.occupied.pop(name, None)

    def waits(self) -> list[Wait]:
        """Who waits for whom: for each robot with a move that is not released, those that come first.

        For one without a plan, those without a plan here that stand in its shortest way.
        """
        user = {move.number: robot.name for robot in self.robots.values() for move in robot.moves}
        waits: list[Wait] = []
        for robot in self.robots.values():
            if robot.released < len(robot.moves) and robot.lost_s is None:
                move = robot.moves[robot.released]
                others = {user[number] for number in move.after}
                waits.extend(Wait(robot.name, other, move.target) for other in sorted(others))
        return waits + [wait for robot in self._stuck() for wait in self._blocked(robot)]

    def _blocked(self, robot: Robot) -> list[Wait]:
        if not self._schedule.occupied:
            return []
        free = Reservations.none(self.roadmap)
        steps = self._schedule.steps(robot, robot.stops[robot.stops_done :], 0.0, free) or ()
        first = {
            name: next((step.target for step in steps if step.edge in occupied.edges), None)
            for name, occupied in sorted(self._schedule.occupied.items())
            if name != robot.name
        }
        return [Wait(robot.name, name, node) for name, node in first.items() if node is not None]

    def _stuck(self) -> list[Robot]:
        """Robots without a plan that are not where they are to be."""
        return [
            robot
            for robot in self.robots.values()
            if robot.lost_s is None
            and robot.released == len(robot.moves)
            and robot.work is None
            and (robot.last_released_node != robot.home or not robot.is_idle)
        ]

    def deadlock(self) -> tuple[str, ...]:
        """A cycle of robots that wait for each other and have nothing released; empty if there is none."""
        waits: dict[str, set[str]] = {}
        for wait in self.waits():
            if not self.robots[wait.robot].released:
                waits.setdefault(wait.robot, set()).add(wait.waits_for)
        return wait_cycle(waits)

    def resolve(self, names: Iterable[str], now_s: float) -> None:
        """Give these robots new plans, all at once."""
        self._replanning.replan(self._schedule.drop(set(names)), now_s)

    def _retry(self, now_s: float) -> None:
        stuck = self._stuck()
        if stuck and now_s >= min(robot.tried_s for robot in stuck) + RETRY_S:
            self._replanning.replan(stuck, now_s)
            in_vain = any(robot.released == len(robot.moves) for robot in stuck)
            if in_vain and now_s >= self._all_replanned_s + RETRY_ALL_S:
                self._all_replanned_s = now_s
                self.resolve({n for n, r in self.robots.items() if r.lost_s is None}, now_s)


def wait_cycle(waits: dict[str, set[str]]) -> tuple[str, ...]:
    """A cycle in a wait-for graph, each name before the one that it waits for; empty if there is none."""
    finished: set[str] = set()
    for first in waits:
        path: list[str] = []
        ahead = [iter((first,))]
        while ahead:
            name = next(ahead[-1], None)
            if name is None:
                ahead.pop()
                if path:
                    finished.add(path.pop())
            elif name in path:
                return tuple(path[path.index(name) :])
            elif name not in finished:
                path.append(name)
                ahead.append(iter(sorted(waits.get(name, ()))))
    return ()
