"""The plans of all robots in time: what each uses and when, and in which order they use the same place.

Robots are late in ways that nobody plans. Therefore the order in which they use a place is kept, and not the time: a
move is released when all moves that exclude it and come before it are over (Hönig et al., "Persistent and robust
execution of MAPF schedules in warehouses", RA-L 4(2), 2019). Times are estimated from the present before each plan.
"""

import math
from collections.abc import Iterable, Set

from msgspec import Struct

from chefbot_fleet.roadmap import Point, Roadmap
from chefbot_fleet.routes import Pace, Reservations, Step, Stop, route
from chefbotd.core.record import Record

GUARD_S = 0.5
"""Plans leave so much time between two robots at a place, so that rounding decides nothing."""

ALWAYS = (-math.inf, math.inf)


class Move(Struct, eq=False):
    """A robot's use of an edge up to and at its end; it begins when the moves numbered in ``after`` are over.

    ``stops_done`` stops of the trip are behind when it begins; ``dwell_s`` is the work before it.
    """

    number: int
    edge: int
    origin: int
    target: int
    start_s: float
    end_s: float
    stops_done: int
    dwell_s: float
    after: set[int]


class Robot(Struct, eq=False):
    """A robot's place and plan: it stands at ``node`` or is on the first of the ``released`` moves.

    ``stops`` are the work that is left, the first one next. ``lost_s`` is when it vanished. Without moves and not at its
    ``home`` it waits for a plan. Nothing is released to it while it is ``held``.
    """

    name: str
    home: int
    node: int
    moves: list[Move] = []
    released: int = 0
    stops: tuple[Stop, ...] = ()
    stops_done: int = 0
    ready_s: float = -math.inf
    lost_s: float | None = None
    tried_s: float = -math.inf
    held: bool = False

    @property
    def last_released_node(self) -> int:
        """Where it comes to stand without another word."""
        return self.moves[self.released - 1].target if self.released else self.node

    @property
    def is_at_stop(self) -> bool:
        """Whether it stands where it has work."""
        return not self.released and not self.is_idle and self.stops[self.stops_done].node == self.node

    @property
    def work(self) -> Stop | None:
        """The work that is due where the robot stands; None where it has to get out of somebody's way first."""
        if not self.is_at_stop:
            return None
        leaves_first = bool(self.moves) and self.moves[0].stops_done <= self.stops_done
        return None if leaves_first else self.stops[self.stops_done]

    @property
    def is_idle(self) -> bool:
        """Whether all work is done."""
        return self.stops_done >= len(self.stops)


class Occupied(Record, frozen=True):
    """The path on which a robot without a plan here may be, and the nodes and edges that nobody else may use then."""

    path: tuple[Point, ...]
    nodes: frozenset[int]
    edges: frozenset[int]


class Schedule:
    """The robots with their moves, and which move comes after which; ``occupied`` is for ever."""

    def __init__(self, roadmap: Roadmap, pace: Pace) -> None:
        self.roadmap, self.pace = roadmap, pace
        self.robots: dict[str, Robot] = {}
        self.occupied: dict[str, Occupied] = {}
        self._count = 0

    def resume(self, robot: Robot, edge: int, origin: int, target: int, start_s: float, end_s: float) -> None:
        """Tell of a move that was released before all this began."""
        self._count += 1
        robot.moves.append(
            Move(self._count, edge, origin, target, start_s, end_s, robot.stops_done, 0.0, set())
        )
        robot.released += 1

    def steps(
        self,
        robot: Robot,
        stops: tuple[Stop, ...],
        now_s: float,
        reserved: Reservations,
        end: int | None = None,
    ) -> tuple[Step, ...] | None:
        """A plan from the last released node over the stops to the robot's home, or to ``end``."""
        last_s = robot.moves[robot.released - 1].end_s if robot.released else now_s
        home = Stop(robot.home if end is None else end)
        start_s = max(now_s, last_s, robot.ready_s)
        return route(self.roadmap, reserved, self.pace, robot.last_released_node, start_s, (*stops, home))

    def reservations(self, own: Robot, without: Set[str] = frozenset()) -> Reservations:
        """What all others use, as planned; of a robot in ``without`` only what was released to it."""
        reserved = Reservations.none(self.roadmap)
        for name, occupied in self.occupied.items():
            if name != own.name:
                reserved.exclude(occupied.nodes, occupied.edges, ALWAYS)
        for robot in self.robots.values():
            moves = robot.moves
            if robot is own:
                continue
            if robot.lost_s is not None:
                self._reserve_for_ever(robot, reserved)
                continue
            if robot.name in without:
                moves = moves[: robot.released]
                if not moves:
                    continue
            first_s = moves[0].start_s + GUARD_S if moves else math.inf
            reserved.stay(self.roadmap, robot.node, (-math.inf, first_s))
            for k, move in enumerate(moves):
                until_s = moves[k + 1].start_s + GUARD_S if k + 1 < len(moves) else math.inf
                from_s = -math.inf if k < robot.released else move.start_s - GUARD_S
                reserved.pass_along(self.roadmap, move.edge, (from_s, move.end_s + GUARD_S))
                if k + 1 < len(moves) or robot.name not in without:
                    reserved.stay(self.roadmap, move.target, (move.end_s, until_s))
        return reserved

    def _reserve_for_ever(self, robot: Robot, reserved: Reservations) -> None:
        if not robot.released:
            reserved.stay(self.roadmap, robot.node, ALWAYS)
        for move in robot.moves[: robot.released]:
            reserved.pass_along(self.roadmap, move.edge, ALWAYS)

    def set_plan(self, robot: Robot, steps: tuple[Step, ...]) -> None:
        """Make this the robot's plan behind what is released, and find its order among the others' moves."""
        self.drop_unreleased([robot])
        done = robot.stops_done
        others = [move for other in self.robots.values() if other is not robot for move in other.moves]
        for step in steps:
            behind = robot.stops_done + step.stops_done
            dwell_s = sum(stop.dwell_s for stop in robot.stops[done:behind])
            done = behind
            self._count += 1
            move = Move(
                self._count,
                step.edge,
                step.origin,
                step.target,
                step.start_s,
                step.end_s,
                behind,
                dwell_s,
                set(),
            )
            excluded = self.roadmap.edges_at_edge[step.edge]
            for other in others:
                if other.edge in excluded:
                    first, second = (other, move) if other.start_s < move.start_s else (move, other)
                    second.after.add(first.number)
            robot.moves.append(move)

    def drop(self, names: set[str]) -> list[Robot]:
        """Drop what is not released of these robots' plans and of all that wait for them; lost ones get no new plan."""
        dropped = set(names)
        while True:
            numbers = {
                move.number
                for name in dropped
                for move in self.robots[name].moves[
                    0 if self.robots[name].lost_s is not None else self.robots[name].released :
                ]
            }
            more = {
                robot.name
                for robot in self.robots.values()
                if robot.name not in dropped
                and any(move.after & numbers for move in robot.moves[robot.released :])
            }
            if not more:
                break
            dropped |= more
        self.drop_unreleased(self.robots[name] for name in dropped)
        return [robot for name, robot in self.robots.items() if name in dropped and robot.lost_s is None]

    def drop_unreleased(self, robots: Iterable[Robot]) -> None:
        """Drop what is planned for these robots and not released."""
        for robot in robots:
            self.cut(robot, robot.released)

    def cut(self, robot: Robot, keep: int) -> None:
        """Drop a robot's moves but for the first ones, released or not."""
        self.forget({move.number for move in robot.moves[keep:]})
        del robot.moves[keep:]
        robot.released = min(robot.released, keep)

    def forget(self, numbers: set[int]) -> None:
        """Nobody waits for these moves any more."""
        for robot in self.robots.values():
            for move in robot.moves:
                move.after -= numbers

    def retime(self, now_s: float) -> None:
        """Estimate all times from the present; every robot goes on as soon as those before it are past."""
        moves = [
            (move.start_s, robot, k) for robot in self.robots.values() for k, move in enumerate(robot.moves)
        ]
        moves.sort(key=lambda entry: entry[0])
        end_s: dict[int, float] = {}
        for _, robot, k in moves:
            move = robot.moves[k]
            length_s = self.pace.duration_s(self.roadmap.length_m[move.edge])
            if k < robot.released:
                begin_s = robot.moves[k - 1].end_s if k else move.start_s
                move.start_s, move.end_s = begin_s, max(begin_s + length_s, now_s + (k + 1) * GUARD_S)
            else:
                ready_s = robot.moves[k - 1].end_s if k else max(now_s, robot.ready_s)
                dwell_s = move.dwell_s if k or robot.ready_s == -math.inf else 0.0
                before_s = max((end_s[number] for number in move.after if number in end_s), default=-math.inf)
                move.start_s = max(ready_s + dwell_s, before_s + 2 * GUARD_S)
                move.end_s = move.start_s + length_s
            end_s[move.number] = move.end_s
