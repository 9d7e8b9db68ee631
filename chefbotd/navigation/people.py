"""The cost of people on a path. They move, so they will be elsewhere when the robot arrives.

Somebody who walks is expected where he will be when the robot is there; so a path goes by him on the free side, and
not round where he is now. Somebody who stands for a moment costs as much as a wait for him. Neither ever closes a way,
and neither is passed by grazing a wall: a tight place beside him is as dear as he himself.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from chefbotd.core.compiled import kernel
from chefbotd.core.record import replace
from chefbotd.navigation.costmap import Costmap
from chefbotd.navigation.distance import Singles
from chefbotd.navigation.grid_frame import Floats
from chefbotd.navigation.movers import SLOWEST_M_S, Mover

STEP_S = 0.25
LEAST_RADIUS_M, MOST_RADIUS_M = 0.12, 0.4


WEIGHT: Final = 3.0
"""A cell that somebody will be on when the robot comes costs so much more: to cross him is worth a wait of 10 s."""

ROOM_M: Final = 0.3
"""Beside him a cell costs less, and with so much room no more than any other."""

FORESIGHT_S: Final = 5.0
"""For so long somebody is expected to walk on as now,"""

SLACK_M: Final = 0.15
"""and the robot to be so much farther, or less far, than it goes at full speed."""


def with_people(
    costs: Costmap,
    people: Sequence[Mover],
    x_m: float,
    y_m: float,
    speed_m_s: float,
) -> Costmap:
    """The costs for a robot that sets out from (x, y) of the grid's frame at that speed."""
    if not people:
        return costs
    rows = np.array([_row(each) for each in people])
    inner_m, tight_m = costs.inflation.inner_m, costs.inflation.tight_m
    numbers = np.array([WEIGHT, ROOM_M, FORESIGHT_S, SLACK_M, inner_m, tight_m, speed_m_s])
    distance_m, extra = costs.distance_m.copy(), np.zeros_like(costs.costs)
    here, cell_m = np.array([x_m, y_m]), costs.frame.resolution_m
    _stamp_people(rows, here, numbers, cell_m, costs.standing_m, distance_m, extra)
    return replace(costs, distance_m=distance_m, costs=costs.costs + extra)


def _row(mover: Mover) -> tuple[float, float, float, float, float]:
    """Where he is, how he walks, and his radius."""
    vx, vy = mover.vx_m_s, mover.vy_m_s
    if math.hypot(vx, vy) <= SLOWEST_M_S:
        vx = vy = 0.0
    return mover.x_m, mover.y_m, vx, vy, min(max(mover.radius_m, LEAST_RADIUS_M), MOST_RADIUS_M)


@kernel
def _stamp_people(
    people: Floats,
    robot: Floats,
    numbers: Floats,
    cell_m: float,
    standing_m: Singles,
    distance_m: Singles,
    extra: Singles,
) -> None:
    weight, room_m, foresight_s, slack_m, inner_m, tight_m, speed = numbers
    rows, columns = extra.shape
    for i in range(people.shape[0]):
        x_0, y_0, vx, vy, radius_m = people[i]
        reach = int((radius_m + inner_m + room_m) / cell_m) + 1
        for k in range(int(foresight_s / STEP_S) + 1):
            time_s = k * STEP_S
            x, y = x_0 + vx * time_s, y_0 + vy * time_s
            if abs(math.hypot(x - robot[0], y - robot[1]) - speed * time_s) > slack_m + radius_m + inner_m:
                continue
            middle_row, middle_column = math.floor(y / cell_m), math.floor(x / cell_m)
            for row in range(max(middle_row - reach, 0), min(middle_row + reach + 1, rows)):
                for column in range(max(middle_column - reach, 0), min(middle_column + reach + 1, columns)):
                    apart_m = math.hypot((column + 0.5) * cell_m - x, (row + 0.5) * cell_m - y) - radius_m
                    distance_m[row, column] = min(distance_m[row, column], max(apart_m, 0.5 * cell_m))
                    lacking = min(max(1.0 - (apart_m - inner_m) / room_m, 0.0), 1.0)
                    if lacking > 0.0 and standing_m[row, column] < inner_m + tight_m:
                        lacking = 1.0
                    extra[row, column] = max(extra[row, column], weight * lacking)
            if vx == 0.0 and vy == 0.0:
                break
