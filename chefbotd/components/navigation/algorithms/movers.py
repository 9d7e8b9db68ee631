"""Moving objects: points that are not on the map, grouped and followed from scan to scan, and what people cost a path.

People move, so they will be elsewhere when the robot arrives. A walking person is expected where he will be when the
robot is there; so a path goes by him on the free side, and not round where he is now. A person who stands for a moment
costs as much as a wait for him. Neither ever closes a path, and neither is passed by grazing a wall: a tight place
beside him is as dear as he himself.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.navigation.algorithms.costmap import Costmap
from chefbotd.components.navigation.algorithms.grid import Floats, Singles
from chefbotd.components.worker.compiled import kernel
from chefbotd.core.record import Record, replace

GAP_M = 0.3
"""Points that follow each other no farther apart than this are one thing."""

WIDEST_M = 1.2
"""A wider thing is a wall or a table: its middle moves with the part of it that is seen."""

FASTEST_M_S = 2.0
SLOWEST_M_S = 0.18
"""Slower than this is noise."""

OVER_S, AFTER_S = 0.5, 0.35
"""A velocity is measured over the first time, and used after the second: beams that come and go shift the middle."""

FORGOTTEN_S, WALKER_FORGOTTEN_S = 0.6, 1.5
"""What was not seen for so long is a new thing; a walker is kept longer, since a board may be silent for a second."""

WALKED_M, WALKER_S = 0.5, 10.0
"""A thing that went so far from where it was first seen is a walker, and for so long after its last step it is expected
to walk on. What is seen of a chair shifts by less while the robot drives past."""


LEARNT = 0.02
"""The share of the present speed in the usual one, at each scan."""


class Mover(Record, frozen=True):
    """A thing: its middle and velocity in the grid's frame, and its last positions, the oldest first.

    A position is the time, the middle of what was seen, and where the middle is if it is round.

    ``from_m`` is where it was first seen, or last stood for long; ``walked_s`` is when it last walked; ``radius_m`` is
    half of its visible width.
    """

    x_m: float
    y_m: float
    vx_m_s: float
    vy_m_s: float
    stamp_s: float
    was: tuple[tuple[float, float, float, float, float], ...]
    from_m: tuple[float, float]
    walked_s: float = -math.inf
    radius_m: float = 0.0
    walks_m_s: tuple[float, float] = (0.0, 0.0)
    """Its last direction with its usual speed: a person who comes up to the robot slows down."""

    @property
    def is_walker(self) -> bool:
        """Whether it walks, or stands only for a moment."""
        return self.stamp_s - self.walked_s < WALKER_S


class TrackedScan(Record, frozen=True):
    """The things of a scan; for each point its velocity and its expected one (n, 2), and whether it is a walker (n)."""

    movers: tuple[Mover, ...]
    velocity_m_s: Floats
    intent_m_s: Floats
    is_walker: NDArray[np.bool_]


def track(
    movers: tuple[Mover, ...], stamp_s: float, points_m: Floats, sensor_m: Floats | None = None
) -> TrackedScan:
    """Follow the things of a new scan, of its points (n, 2) in the order of the beams.

    ``sensor_m`` is from where each point was seen (n, 2). A walker's velocity is that of his own middle then, and not of
    the middle of what is seen of him: that seems to turn towards the robot while he goes past it.
    """
    velocities, walkers = np.zeros_like(points_m), np.zeros(len(points_m), np.bool_)
    intents = np.zeros_like(points_m)
    matched = list[Mover]()
    left = [mover for mover in movers if stamp_s - mover.stamp_s <= _forgotten_s(mover)]
    for span in _things(points_m):
        thing = points_m[span]
        widest_m = float(np.ptp(thing, axis=0).max())
        if widest_m > WIDEST_M:
            continue
        x_m, y_m = (float(value) for value in (thing.min(axis=0) + thing.max(axis=0)) / 2)
        round_m = (x_m, y_m) if sensor_m is None else _middle_of_round(thing, sensor_m[span])
        mover = _match_mover(left, (stamp_s, x_m, y_m, *round_m), widest_m / 2)
        matched.append(mover)
        walkers[span] = mover.is_walker
        if math.hypot(mover.vx_m_s, mover.vy_m_s) > SLOWEST_M_S:
            velocities[span] = intents[span] = mover.vx_m_s, mover.vy_m_s
        if mover.is_walker:
            intents[span] = mover.walks_m_s
    return TrackedScan((*matched, *left), velocities, intents, walkers)


def displace_movers(movers: tuple[Mover, ...]) -> tuple[Mover, ...]:
    """The same after a jump of the robot's pose: velocities are kept, and not measured across the jump."""
    return tuple(replace(mover, was=()) for mover in movers)


def _forgotten_s(mover: Mover) -> float:
    return WALKER_FORGOTTEN_S if mover.is_walker else FORGOTTEN_S


def _things(points_m: Floats) -> list[NDArray[np.int64]]:
    """The numbers of the points of each thing; the turn's last beam lies beside its first."""
    count = len(points_m)
    if not count:
        return []
    gaps = np.hypot(*np.diff(points_m, axis=0).T) > GAP_M
    things = np.split(np.arange(count), np.flatnonzero(gaps) + 1)
    if len(things) > 1 and math.dist(points_m[0], points_m[-1]) <= GAP_M:
        things = [np.concatenate([things[-1], things[0]]), *things[1:-1]]
    return things


def _middle_of_round(points_m: Floats, sensor_m: Floats) -> tuple[float, float]:
    """The middle of something round that a sensor sees: between its outer beams, behind its nearest point."""
    ahead = points_m - sensor_m
    toward = math.atan2(*ahead.mean(axis=0)[::-1])
    bearing = np.remainder(np.arctan2(ahead[:, 1], ahead[:, 0]) - toward + math.pi, math.tau) - math.pi
    right, left = float(bearing.min()), float(bearing.max())
    range_m, half = float(np.hypot(ahead[:, 0], ahead[:, 1]).min()), math.sin((left - right) / 2)
    radius_m = min(range_m * half / max(1 - half, 1e-3), MOST_RADIUS_M)
    angle, away_m = toward + (left + right) / 2, range_m + radius_m
    x_m, y_m = sensor_m[0]
    return float(x_m) + away_m * math.cos(angle), float(y_m) + away_m * math.sin(angle)


def _match_mover(
    left: list[Mover], position: tuple[float, float, float, float, float], radius_m: float
) -> Mover:
    """The thing with its new position; the old one is removed from ``left``."""
    stamp_s, x_m, y_m = position[:3]
    nearest, best = None, 0.35
    for mover in left:
        dt_s = stamp_s - mover.stamp_s
        ahead_x, ahead_y = mover.x_m + mover.vx_m_s * dt_s, mover.y_m + mover.vy_m_s * dt_s
        away = min(math.hypot(x_m - ahead_x, y_m - ahead_y), math.hypot(x_m - mover.x_m, y_m - mover.y_m))
        if away < best and dt_s > 0:
            nearest, best = mover, away
    if nearest is None:
        return Mover(x_m, y_m, 0.0, 0.0, stamp_s, (position,), (x_m, y_m), radius_m=radius_m)
    left.remove(nearest)
    was = (*(place for place in nearest.was if stamp_s - place[0] <= OVER_S + 1e-6), position)
    over_s = stamp_s - was[0][0]
    k = 3 if nearest.is_walker else 1
    vx, vy = (
        (now - began) / max(over_s, 1e-3)
        for now, began in zip(position[k : k + 2], was[0][k : k + 2], strict=True)
    )
    if over_s < AFTER_S or math.hypot(vx, vy) > FASTEST_M_S:  # not measured: who walked walks on
        vx, vy = (nearest.vx_m_s, nearest.vy_m_s) if nearest.is_walker else (0.0, 0.0)
    radius_m = max(radius_m, 0.9 * nearest.radius_m)  # half of somebody may be hidden for a moment
    mover = Mover(
        x_m, y_m, vx, vy, stamp_s, was, nearest.from_m, nearest.walked_s, radius_m, nearest.walks_m_s
    )
    return _walking(mover)


def _walking(mover: Mover) -> Mover:
    """The same, with the time of its last step; a thing that stood for long begins again."""
    is_going = math.hypot(mover.vx_m_s, mover.vy_m_s) > SLOWEST_M_S
    is_far = math.dist((mover.x_m, mover.y_m), mover.from_m) > WALKED_M
    if is_going and (is_far or mover.is_walker):
        speed_m_s = math.hypot(mover.vx_m_s, mover.vy_m_s)
        usual_m_s = math.hypot(*mover.walks_m_s) or speed_m_s
        usual = (1 - LEARNT) * usual_m_s / speed_m_s + LEARNT
        return replace(mover, walked_s=mover.stamp_s, walks_m_s=(usual * mover.vx_m_s, usual * mover.vy_m_s))
    if mover.walked_s > -math.inf and not mover.is_walker:
        return replace(mover, walked_s=-math.inf, from_m=(mover.x_m, mover.y_m))
    return mover


STEP_S = 0.25
LEAST_RADIUS_M, MOST_RADIUS_M = 0.12, 0.4


WEIGHT: Final = 3.0
"""A cell costs so much more where a person will be when the robot comes: crossing his path is worth a wait of 10 s."""

ROOM_M: Final = 0.3
"""Beside him a cell costs less, and at this distance nothing more."""

FORESIGHT_S: Final = 5.0
"""A person is expected to walk on as now for so long,"""

SLACK_M: Final = 0.15
"""and the robot to be no farther than this from where it is at full speed."""


def with_people(costs: Costmap, people: Sequence[Mover], x_m: float, y_m: float, speed_m_s: float) -> Costmap:
    """The costs for a robot that sets out from (x, y) of the grid's frame at that speed."""
    if not people:
        return costs
    rows = np.array([_row(person) for person in people])
    inner_m, tight_m = costs.inflation.inner_m, costs.inflation.tight_m
    numbers = np.array([WEIGHT, ROOM_M, FORESIGHT_S, SLACK_M, inner_m, tight_m, speed_m_s])
    distance_m, extra = costs.distance_m.copy(), np.zeros_like(costs.costs)
    position, cell_m = np.array([x_m, y_m]), costs.frame.resolution_m
    _stamp_people(rows, position, numbers, cell_m, costs.standing_m, distance_m, extra)
    return replace(costs, distance_m=distance_m, costs=costs.costs + extra)


def _row(mover: Mover) -> tuple[float, float, float, float, float]:
    """His position, velocity and radius."""
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
