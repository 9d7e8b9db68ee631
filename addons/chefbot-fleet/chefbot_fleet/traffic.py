"""Who may drive where, and when: plans, their order at each place, and what is released.

Every robot has a plan that ends at its own home, where it blocks nobody (*Roadmap.homes*). A new plan is only taken if
it fits the others' plans in time; until then the robot keeps the plan that it has. So there is always a way for all to
get home, and no deadlock. Method: token passing (Ma et al., "Lifelong multi-agent path finding for online pickup and
delivery tasks", AAMAS 2017).

Robots are late in ways that nobody plans. Therefore the order in which they use a place is kept, and not the time: a
move is released when all moves that exclude it and come before it are over (Hönig et al., "Persistent and robust
execution of MAPF schedules in warehouses", RA-L 4(2), 2019). Times are estimated from the present before each plan.

A robot that vanishes keeps what was released to it, since it may drive on. Whoever waits for it gets a new plan.
"""

import math
import random
from collections.abc import Iterable, Iterator, Sequence, Set

from msgspec import Struct

from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace, Reservations, Step, Stop, route
from chefbotd.core.record import Record

GUARD_S = 0.5
"""Plans leave so much time between two robots at a place, so that rounding decides nothing."""

ATTEMPTS = 12
"""So many orders of planning are tried when several robots need new plans at once."""

RETRY_S = 5.0
"""A robot without a plan tries again so often."""

RETRY_ALL_S = 30.0
"""If it still has none, all others get new plans together with it so often."""

GRACE_EDGES = (0, 4, 12, 30)
"""Then a robot that is planned for first leaves the others where they stand for the time of so many edges, in turn."""

MOST_YIELDS = 6
"""So many passing places are tried, the nearest first."""


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
    ``home`` it waits for a plan.
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

    @property
    def last_released_node(self) -> int:
        """Where it comes to stand without another word."""
        return self.moves[self.released - 1].target if self.released else self.node

    @property
    def work(self) -> Stop | None:
        """The work that is due where the robot stands."""
        if (
            self.released
            or self.stops_done >= len(self.stops)
            or self.stops[self.stops_done].node != self.node
        ):
            return None
        leaves_first = bool(self.moves) and self.moves[0].stops_done <= self.stops_done
        return None if leaves_first else self.stops[self.stops_done]

    @property
    def is_idle(self) -> bool:
        """Whether all work is done."""
        return self.stops_done >= len(self.stops)


class Wait(Record, frozen=True):
    """Why a robot does not drive on: it needs what ``waits_for`` uses first, at ``node``."""

    robot: str
    waits_for: str
    node: int


class Traffic:
    """The plans of all robots. Time is an argument, and chance a seed: the same calls give the same plans."""

    def __init__(self, roadmap: Roadmap, pace: Pace, *, horizon: int = 2, seed: int = 0) -> None:
        """``horizon`` moves at most are released to a robot and not over."""
        self.roadmap = roadmap
        self.robots: dict[str, Robot] = {}
        self.replans = self.deadlocks = 0
        self._checked_s = self._all_replanned_s = -math.inf
        self._pace, self._horizon = pace, horizon
        self._chance = random.Random(seed)
        self._count = 0

    def add(self, name: str, node: int, home: int) -> Robot:
        """A robot that stands at a node."""
        robot = self.robots[name] = Robot(name, home, node)
        return robot

    def resume(self, robot: Robot, edge: int, origin: int, target: int, start_s: float, end_s: float) -> None:
        """Tell of a move that was released before all this began."""
        self._count += 1
        robot.moves.append(
            Move(self._count, edge, origin, target, start_s, end_s, robot.stops_done, 0.0, set())
        )
        robot.released += 1

    def assign(self, name: str, stops: Sequence[Stop], now_s: float) -> bool:
        """Give an idle robot work; False if it fits no plan yet, and the robot keeps the plan that it has."""
        robot = self.robots[name]
        if robot.lost_s is not None or not robot.is_idle:
            return False
        self._retime(now_s)
        steps = self._steps(robot, tuple(stops), now_s, self._reservations(robot))
        if steps is None:
            return False
        robot.stops, robot.stops_done = tuple(stops), 0
        self._take(robot, steps, tuple(stops))
        return True

    def withdraw(self, name: str, now_s: float) -> None:
        """Take a robot's work away; it drives home."""
        robot = self.robots[name]
        robot.stops, robot.stops_done = (), 0
        self._retime(now_s)
        steps = self._steps(robot, (), now_s, self._reservations(robot))
        if steps is not None:
            self._take(robot, steps, ())

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
        self._forget({move.number})

    def worked(self, name: str) -> None:
        """Tell that the work is done where the robot stands."""
        robot = self.robots[name]
        if robot.work is None:
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
        while robot.lost_s is None and robot.released < min(self._horizon, len(robot.moves)):
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
            self._replan(self._drop({name}), now_s)

    def find(self, name: str, now_s: float) -> None:
        """Tell that a robot is there again, where its last ``arrived`` and what was released to it say."""
        robot = self.robots[name]
        robot.lost_s, robot.tried_s = None, -math.inf
        self._retry(now_s)

    def remove(self, name: str) -> Robot:
        """Take a robot off the map, with all that is reserved for it: somebody carried it away, or its lease is over."""
        robot = self.robots.pop(name)
        self._forget({move.number for move in robot.moves})
        return robot

    def waits(self) -> list[Wait]:
        """Who waits for whom: for each robot with a move that is not released, those that come first."""
        user = {move.number: robot.name for robot in self.robots.values() for move in robot.moves}
        waits: list[Wait] = []
        for robot in self.robots.values():
            if robot.released < len(robot.moves) and robot.lost_s is None:
                move = robot.moves[robot.released]
                others = {user[number] for number in move.after}
                waits.extend(Wait(robot.name, other, move.target) for other in sorted(others))
        return waits

    def deadlock(self) -> tuple[str, ...]:
        """A cycle of robots that wait for each other and have nothing released; empty if there is none."""
        waits: dict[str, set[str]] = {}
        for wait in self.waits():
            if not self.robots[wait.robot].released:
                waits.setdefault(wait.robot, set()).add(wait.waits_for)
        return wait_cycle(waits)

    def resolve(self, names: Iterable[str], now_s: float) -> None:
        """Give these robots new plans, all at once."""
        self._replan(self._drop(set(names)), now_s)

    # Plans

    def _steps(
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
        return route(self.roadmap, reserved, self._pace, robot.last_released_node, start_s, (*stops, home))

    def _reservations(self, own: Robot, without: Set[str] = frozenset()) -> Reservations:
        """What all others use, as planned; of a robot in ``without`` only what was released to it."""
        reserved = Reservations.none(self.roadmap)
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
        always = (-math.inf, math.inf)
        if not robot.released:
            reserved.stay(self.roadmap, robot.node, always)
        for move in robot.moves[: robot.released]:
            reserved.pass_along(self.roadmap, move.edge, always)

    def _take(self, robot: Robot, steps: tuple[Step, ...], stops: tuple[Stop, ...]) -> None:
        """Make this the robot's plan behind what is released, and find its order among the others' moves."""
        dropped = {move.number for move in robot.moves[robot.released :]}
        self._forget(dropped)
        del robot.moves[robot.released :]
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

    def _forget(self, numbers: set[int]) -> None:
        for robot in self.robots.values():
            for move in robot.moves:
                move.after -= numbers

    def _retime(self, now_s: float) -> None:
        """Estimate all times from the present; every robot goes on as soon as those before it are past."""
        moves = [
            (move.start_s, robot, k) for robot in self.robots.values() for k, move in enumerate(robot.moves)
        ]
        moves.sort(key=lambda entry: entry[0])
        end_s: dict[int, float] = {}
        for _, robot, k in moves:
            move = robot.moves[k]
            length_s = self._pace.duration_s(self.roadmap.length_m[move.edge])
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

    # What was not planned

    def _drop(self, names: set[str]) -> list[Robot]:
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
        for name in dropped:
            robot = self.robots[name]
            self._forget({move.number for move in robot.moves[robot.released :]})
            del robot.moves[robot.released :]
        return [robot for name, robot in self.robots.items() if name in dropped and robot.lost_s is None]

    def _retry(self, now_s: float) -> None:
        stuck = [
            robot
            for robot in self.robots.values()
            if robot.lost_s is None
            and robot.released == len(robot.moves)
            and robot.work is None
            and (robot.last_released_node != robot.home or not robot.is_idle)
        ]
        if stuck and now_s >= min(robot.tried_s for robot in stuck) + RETRY_S:
            self._replan(stuck, now_s)
            in_vain = any(robot.released == len(robot.moves) for robot in stuck)
            if in_vain and now_s >= self._all_replanned_s + RETRY_ALL_S:
                self._all_replanned_s = now_s
                self._replan(self._drop({n for n, r in self.robots.items() if r.lost_s is None}), now_s)

    def _replan(self, robots: list[Robot], now_s: float) -> None:
        """Give robots without a plan one that fits all others'; who gets none stays where it is, and tries again."""
        self.replans += 1
        self._retime(now_s)
        order, unplanned = list(robots), list(robots)
        best = len(robots) + 1
        chosen: list[tuple[Robot, tuple[Step, ...]]] = []
        edge_s = self._pace.duration_s(sum(self.roadmap.length_m) / len(self.roadmap.edges))
        for attempt in range(ATTEMPTS):
            grace_s = GRACE_EDGES[attempt % len(GRACE_EDGES)] * edge_s
            yields = {
                robot.name for robot in order if attempt >= ATTEMPTS // 2 and self._chance.random() < 0.5
            }
            plans, failed = self._attempt(order, now_s, now_s + grace_s, yields)
            self._undo(robots)
            if len(failed) < best and not (failed and self._collides(failed, plans)):
                best, chosen = len(failed), plans
            if not failed:
                break
            rest = [robot for robot in order if robot not in failed]
            self._chance.shuffle(rest)
            order = [*failed, *rest]
        for robot, steps in chosen:
            self._take(robot, steps, robot.stops[robot.stops_done :])
            unplanned.remove(robot)
        for robot in robots:
            robot.tried_s = now_s

    def _attempt(
        self, order: list[Robot], now_s: float, grace_until_s: float, yields: Set[str]
    ) -> tuple[list[tuple[Robot, tuple[Step, ...]]], list[Robot]]:
        """Plans in this order, and who got none; those of ``yields`` go out of the way first."""
        plans, failed = [], list[Robot]()
        pending = {robot.name for robot in order}
        for robot in order:
            reserved = self._reservations(robot, pending)
            for other in order:
                if other is not robot and other.name in pending:
                    reserved.stay(self.roadmap, other.last_released_node, (-math.inf, grace_until_s))
            steps = None
            if robot.name not in yields:
                steps = self._steps(robot, robot.stops[robot.stops_done :], now_s, reserved)
            if steps is None:
                steps = self._yield(robot, now_s, reserved)
            if steps is None:
                failed.append(robot)
                continue
            pending.discard(robot.name)
            plans.append((robot, steps))
            self._take(robot, steps, robot.stops[robot.stops_done :])
        return plans, failed

    def _undo(self, robots: list[Robot]) -> None:
        for robot in robots:
            self._forget({move.number for move in robot.moves[robot.released :]})
            del robot.moves[robot.released :]

    def _yield(self, robot: Robot, now_s: float, reserved: Reservations) -> tuple[Step, ...] | None:
        """A plan out of the others' way: home, or to a passing place nearby that stays free."""
        distance_m = self.roadmap.distance_m[robot.last_released_node]
        used = {other.home for other in self.robots.values()} - {robot.home}
        places = [
            node for node in self.roadmap.passing_places if node not in used and not reserved.nodes[node]
        ]
        places.sort(key=lambda node: distance_m[node])
        for end in (robot.home, *places[:MOST_YIELDS]):
            if not self.roadmap.nodes_at_node[end] & (used - {robot.home}):
                steps = self._steps(robot, (), now_s, reserved, end)
                if steps is not None:
                    return tuple(Step(s.edge, s.origin, s.target, s.start_s, s.end_s, 0) for s in steps)
        return None

    def _collides(self, failed: list[Robot], plans: list[tuple[Robot, tuple[Step, ...]]]) -> bool:
        """Whether a new plan leads past a robot that would stay where it is."""
        return any(
            step.edge in self.roadmap.edges_at_node[robot.last_released_node]
            for robot in failed
            for _, steps in plans
            for step in steps
        )


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
