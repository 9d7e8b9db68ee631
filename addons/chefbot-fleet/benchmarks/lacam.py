"""What LaCAM makes of the same roadmap and the same orders: the reference for throughput.

LaCAM plans all robots together in steps of one edge, and knows of conflicts only at nodes and on edges: two robots may
follow each other nose to tail, and pass where their discs would touch. Nothing is late. A step takes as long as an edge
of mean length. Whenever a robot gets to its goal, all are planned anew.
"""

from collections.abc import Sequence

import pymapf
from chefbot_fleet.assignment import Order, assign
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace
from pymapf import Agent, MAPFProblem
from pymapf.core.graph import ExplicitGraph


def lacam_orders_per_hour(
    roadmap: Roadmap, pace: Pace, homes: Sequence[int], orders: Sequence[Order], dwell_s: float, seed: int
) -> float:
    """How many orders robots that start at ``homes`` bring in an hour."""
    graph = ExplicitGraph.undirected(roadmap.edges)
    step_s = pace.duration_s(sum(roadmap.length_m) / len(roadmap.edges))
    dwell_steps = round(dwell_s / step_s)
    place, home = dict(enumerate(homes)), dict(enumerate(homes))
    goals: dict[int, list[int]] = {robot: [] for robot in place}
    held = dict.fromkeys(place, 0)
    waiting, steps, done = list(orders), 0, 0
    plan: list[dict[int, int]] = []
    while done < len(orders):
        free = {str(robot): place[robot] for robot in place if not goals[robot]}
        for name, order in assign(roadmap, free, waiting, steps * step_s):
            goals[int(name)] = [order.pick, order.drop]
            waiting.remove(order)
            plan = []
        if not plan:
            plan = _plan(graph, place, _distinct(goals, home, held, place), seed + steps)
        place = plan.pop(0)
        steps += 1
        for robot, node in place.items():
            if goals[robot] and goals[robot][0] == node:
                held[robot] += 1
                if held[robot] > dwell_steps:
                    held[robot] = 0
                    goals[robot].pop(0)
                    done += not goals[robot]
                    plan = []
    return done / (steps * step_s) * 3600


def _distinct(
    goals: dict[int, list[int]], home: dict[int, int], held: dict[int, int], place: dict[int, int]
) -> dict[int, int]:
    """One goal for each robot and no two alike: who works stays, who comes second to a node waits at home."""
    chosen: dict[int, int] = {}
    for robot in sorted(goals, key=lambda robot: (not held[robot], robot)):
        goal = goals[robot][0] if goals[robot] else home[robot]
        chosen[robot] = home[robot] if goal in chosen.values() else goal
    return chosen


def _plan(
    graph: ExplicitGraph, place: dict[int, int], goals: dict[int, int], seed: int
) -> list[dict[int, int]]:
    agents = [Agent(str(robot), place[robot], goals[robot]) for robot in place]
    solution = pymapf.solve(MAPFProblem(graph, agents), "lacam", seed=seed)
    if solution is None:
        return _plan(graph, place, goals, seed + 1)
    paths = {int(name): path for name, path in solution.paths.items()}
    longest = max(map(len, paths.values()))
    if longest < 2:
        return [place]
    return [{robot: path[min(k, len(path) - 1)] for robot, path in paths.items()} for k in range(1, longest)]
