"""Which robot does which order."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from chefbot_fleet.roadmap import Roadmap
from chefbotd.core.record import Record

AGE_M_PER_S = 0.05
"""An order that waits is worth a detour: so much for each second, so that none waits for ever."""


class Order(Record, frozen=True):
    """A thing to fetch at one node and to bring to another; ``identifier`` is the customer's own."""

    identifier: str
    pick: int
    drop: int
    since_s: float = 0.0


def assign(
    roadmap: Roadmap, robots: Mapping[str, int], orders: Sequence[Order], now_s: float
) -> list[tuple[str, Order]]:
    """Pair free robots (and the nodes where they are) with waiting orders, so that the ways to fetch are short.

    Where there are more orders than robots, the oldest count: twice as many as robots are looked at. A robot that
    cannot reach an order's nodes does not get it.
    """
    names = list(robots)
    looked_at = sorted(orders, key=lambda order: order.since_s)[: 2 * len(names)]
    if not names or not looked_at:
        return []
    away_m = roadmap.distance_m[np.ix_([robots[name] for name in names], [order.pick for order in looked_at])]
    bring_m = np.array([roadmap.distance_m[order.pick, order.drop] for order in looked_at])
    reachable = np.isfinite(away_m) & np.isfinite(bring_m)
    waited_m = np.array([AGE_M_PER_S * (now_s - order.since_s) for order in looked_at])
    costs = np.where(reachable, away_m - waited_m, 1e9)
    rows, columns = linear_sum_assignment(costs)
    return [
        (names[row], looked_at[column])
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
        if reachable[row, column]
    ]
