"""The quickest route along a roadmap in the time that other robots leave.

Method: safe interval path planning (Phillips and Likhachev, "SIPP: Safe interval path planning for dynamic
environments", ICRA 2011). The stops of a trip are layers of one search, so a stop is reached only where the trip can go
on from it.
"""

import heapq
import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import TypeAlias

from msgspec import Struct

from chefbot_fleet.roadmap import Roadmap
from chefbotd.core.record import Record

Span: TypeAlias = tuple[float, float]

MOST_STATES = 10_000
"""A search ends here without a route: it would take seconds, and the robot can wait where it is."""


class Pace(Record, frozen=True):
    """How long a robot takes: a speed along edges, and a time for each of them (stopping, turning)."""

    speed_m_s: float = 0.3
    node_s: float = 1.0

    def duration_s(self, length_m: float) -> float:
        """The time for an edge of this length."""
        return length_m / self.speed_m_s + self.node_s


class Stop(Record, frozen=True):
    """A node to go to, and how long the work there takes. The last stop of a trip is where the robot stays."""

    node: int
    dwell_s: float = 0.0


class Step(Record, frozen=True):
    """An edge of a route, its planned times of leaving and arriving, and how many stops are behind when it is left."""

    edge: int
    origin: int
    target: int
    start_s: float
    end_s: float
    stops_done: int


class Reservations(Struct):
    """For each node and edge the spans of time in which other robots exclude one more."""

    nodes: list[list[Span]]
    edges: list[list[Span]]

    @classmethod
    def none(cls, roadmap: Roadmap) -> "Reservations":
        """All is free for ever."""
        return cls([[] for _ in roadmap.points_m], [[] for _ in roadmap.edges])

    def stay(self, roadmap: Roadmap, node: int, span: Span) -> None:
        """A robot stands at a node."""
        self.exclude(roadmap.nodes_at_node[node], roadmap.edges_at_node[node], span)

    def exclude(self, nodes: Iterable[int], edges: Iterable[int], span: Span) -> None:
        """Nobody may be at these."""
        for node in nodes:
            self.nodes[node].append(span)
        for edge in edges:
            self.edges[edge].append(span)

    def pass_along(self, roadmap: Roadmap, edge: int, span: Span) -> None:
        """A robot is on an edge."""
        self.exclude(roadmap.nodes_at_edge[edge], roadmap.edges_at_edge[edge], span)


class _Free(Struct):
    """The gaps between spans, in order."""

    starts: list[float]
    ends: list[float]

    @classmethod
    def between(cls, spans: Iterable[Span]) -> "_Free":
        starts, ends, clear = [], [], -math.inf
        for start, end in sorted(spans):
            if start > clear:
                starts.append(clear)
                ends.append(start)
            clear = max(clear, end)
        if clear < math.inf:
            starts.append(clear)
            ends.append(math.inf)
        return cls(starts, ends)

    def at(self, time_s: float) -> int:
        """The gap that holds this time, or the next one."""
        k = max(bisect_right(self.starts, time_s) - 1, 0)
        return k if k < len(self.ends) and time_s < self.ends[k] else k + 1


def route(
    roadmap: Roadmap, reservations: Reservations, pace: Pace, node: int, start_s: float, stops: Sequence[Stop]
) -> tuple[Step, ...] | None:
    """The quickest trip over all stops, in order, and for ever at the last; None if there is none.

    The robot stands at ``node`` and may stay there until somebody else needs the place.
    """
    search = _Search(roadmap, reservations, pace, stops)
    return search.run(node, start_s)


class _Search:
    def __init__(
        self, roadmap: Roadmap, reservations: Reservations, pace: Pace, stops: Sequence[Stop]
    ) -> None:
        self._roadmap, self._reservations, self._stops = roadmap, reservations, stops
        self._duration_s = [pace.duration_s(length) for length in roadmap.length_m]
        self._nodes: dict[int, _Free] = {}
        self._edges: dict[int, _Free] = {}
        distance = roadmap.distance_m
        rest_s = [0.0] * len(stops)
        for k in range(len(stops) - 2, -1, -1):
            ahead_m = float(distance[stops[k].node, stops[k + 1].node])
            rest_s[k] = rest_s[k + 1] + stops[k].dwell_s + ahead_m / pace.speed_m_s
        self._ahead_s = [
            (distance[stop.node] / pace.speed_m_s + rest).tolist()
            for stop, rest in zip(stops, rest_s, strict=True)
        ]

    def _node(self, node: int) -> _Free:
        if node not in self._nodes:
            self._nodes[node] = _Free.between(self._reservations.nodes[node])
        return self._nodes[node]

    def _edge(self, edge: int) -> _Free:
        if edge not in self._edges:
            self._edges[edge] = _Free.between(self._reservations.edges[edge])
        return self._edges[edge]

    def run(self, node: int, start_s: float) -> tuple[Step, ...] | None:
        """A* over nodes, their gaps and the stops that are behind."""
        if any(start <= start_s < end for start, end in self._reservations.nodes[node]):
            return None
        if not {stop.node for stop in self._stops} <= self._ever_reachable(node):
            return None
        until_s = min(
            (start for start, _ in self._reservations.nodes[node] if start > start_s), default=math.inf
        )
        open_list: list[tuple[float, int, float, int, int, float]] = []
        parents: dict[int, tuple[int, Step | None]] = {0: (-1, None)}
        best: dict[tuple[int, float, int], float] = {}
        heapq.heappush(open_list, (start_s + self._ahead_s[0][node], 0, start_s, node, 0, until_s))
        count, last = 0, len(self._stops) - 1
        while open_list and count < MOST_STATES:
            _, state, now_s, node, layer, until_s = heapq.heappop(open_list)
            if best.get((node, until_s, layer), math.inf) < now_s:
                continue
            layer, now_s = self._worked(node, layer, now_s, until_s)
            if layer > last:
                return self._followed(parents, state)
            for step, gap_end_s in self._moves(node, layer, now_s, until_s):
                key = (step.target, gap_end_s, layer)
                if step.end_s >= best.get(key, math.inf):
                    continue
                best[key] = step.end_s
                count += 1
                parents[count] = (state, step)
                value = step.end_s + self._ahead_s[layer][step.target]
                if value < math.inf:
                    heapq.heappush(open_list, (value, count, step.end_s, step.target, layer, gap_end_s))
        return None

    def _ever_reachable(self, node: int) -> set[int]:
        """The nodes that can be reached along edges and nodes that are not taken for ever."""
        seen, ahead = {node}, [node]
        while ahead:
            for edge, end in self._roadmap.exits[ahead.pop()]:
                if end not in seen and self._edge(edge).starts and self._node(end).starts:
                    seen.add(end)
                    ahead.append(end)
        return seen

    def _worked(self, node: int, layer: int, now_s: float, until_s: float) -> tuple[int, float]:
        """The stop that is ahead, and the time, once the work is done that can be done here."""
        last = len(self._stops) - 1
        while layer <= last and node == self._stops[layer].node:
            then_s = math.inf if layer == last else now_s + self._stops[layer].dwell_s
            if then_s >= until_s and until_s < math.inf:
                break
            layer, now_s = layer + 1, now_s if layer == last else then_s
        return layer, now_s

    def _moves(self, node: int, layer: int, now_s: float, until_s: float) -> Iterable[tuple[Step, float]]:
        """The earliest step along each edge into each gap of its end, and when that gap closes."""
        for edge, end in self._roadmap.exits[node]:
            duration_s, along, there = self._duration_s[edge], self._edge(edge), self._node(end)
            k = along.at(now_s)
            while k < len(along.starts) and along.starts[k] < until_s:
                leave_s = max(now_s, along.starts[k])
                arrive_s = leave_s + duration_s
                if arrive_s < along.ends[k] and leave_s < until_s:
                    gap = there.at(arrive_s)
                    if gap < len(there.starts) and there.starts[gap] <= arrive_s:
                        yield Step(edge, node, end, leave_s, arrive_s, layer), there.ends[gap]
                k += 1

    @staticmethod
    def _followed(parents: dict[int, tuple[int, Step | None]], state: int) -> tuple[Step, ...]:
        steps: list[Step] = []
        while state >= 0:
            state, step = parents[state]
            if step is not None:
                steps.append(step)
        return tuple(reversed(steps))
