"""Where the robot is going to drive, as version 3.0 wants to be told (6.8).

It is told where its daemon plans to drive now: to the node that it drives to, and not beyond. Version 2.1 has no field
for it.
"""

import math
from itertools import pairwise
from typing import Any, Final

from chefbot_vda5050.topics import seconds_of, timestamp_of
from chefbot_vda5050.vehicle import Facts, Limits

Point = tuple[float, float]

NEAR_M: Final = 3.0
"""So far the robot's sensors tell whether the way is free."""

USUAL_SPEED_M_S: Final = 0.3
"""Where the robot's own is not known."""

MOST_POINTS: Final = 50


def planned_path(facts: Facts) -> dict[str, Any] | None:
    """The whole path as a NURBS of degree 1: a polyline; None: the robot has no path."""
    if not facts.path:
        return None
    points = _ahead(facts)
    inner = [index / (len(points) - 1) for index in range(len(points))]
    return {
        "trajectory": {
            "degree": 1,
            "knotVector": [0.0, *inner, 1.0],
            "controlPoints": [{"x": x, "y": y} for x, y in points],
        }
    }


def intermediate_path(facts: Facts, now: str, limits: Limits) -> dict[str, Any] | None:
    """The path of the next metres, with the times at which the robot is there if nobody stands in its way."""
    if not facts.path:
        return None
    speed_m_s = limits.speed_max_m_s or USUAL_SPEED_M_S
    points = _ahead(facts)
    now_s, along_m, found = seconds_of(now), 0.0, [(points[0], 0.0)]
    for start, end in pairwise(points):
        length_m = math.dist(start, end)
        if along_m + length_m > NEAR_M:
            share = (NEAR_M - along_m) / length_m
            end = (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
            length_m = NEAR_M - along_m
        along_m += length_m
        found.append((end, along_m))
        if along_m >= NEAR_M:
            break
    return {
        "polyline": [
            {"x": x, "y": y, "eta": timestamp_of(now_s + metres / speed_m_s)} for (x, y), metres in found
        ]
    }


def _ahead(facts: Facts) -> list[Point]:
    """The robot and what of its path is still before it; of many points some, the last among them."""
    here = (facts.x_m, facts.y_m)
    nearest = min(range(len(facts.path)), key=lambda index: math.dist(here, facts.path[index]))
    left = facts.path[nearest + 1 :] or facts.path[-1:]
    step = max(1, math.ceil(len(left) / (MOST_POINTS - 1)))
    return [here, *left[:-1:step], left[-1]]
