"""Decides whether a new path replaces the one that is driven: when that one is blocked, or the new one is better."""

from enum import StrEnum
from typing import Final

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record
from chefbotd.navigation.awareness import Awareness
from chefbotd.navigation.costmap import Costmap
from chefbotd.navigation.evade import is_in_the_way
from chefbotd.navigation.parameters import NavigationParameters
from chefbotd.navigation.path import NoPath, Path
from chefbotd.navigation.recovery import DETOUR_S
from chefbotd.navigation.reports import StepInput
from chefbotd.navigation.steering import Phase
from chefbotd.navigation.surroundings import Surroundings
from chefbotd.navigation.trips import Trip, blocked_after_m, blocked_at, least_room_m, turn_worth, worth

REPLAN_S: Final = 1.0
BETTER_SHARE: Final = 0.85
"""A new path is taken when it costs no more than this share of the present one, or when that is blocked."""

TURN_BACK_M: Final = 1.0
"""Where there is no way but the blocked one, the robot drives on until it is so near to what blocks it."""

TURN_S = 4.0
"""The robot does not stop to turn to a better path where somebody will come by within this time."""

LONGER_M = 0.6
"""A way round that is no longer than this is taken at once."""

CLEARER_M = 0.02
"""A path that leaves so much more room where the present one is tight is a better one."""


class Choice(StrEnum):
    """What to do about the present path."""

    KEEP = "keep"
    TAKE_NEW = "take_new"
    STUCK = "stuck"


def is_due(params: NavigationParameters, trip: Trip, planned_s: float, now_s: float) -> bool:
    """Whether to plan again; at the goal it is too late."""
    at_goal = trip.follow.phase in (Phase.APPROACHING, Phase.FINAL_TURN, Phase.DONE)
    return not at_goal and now_s - planned_s >= REPLAN_S


def choice(
    params: NavigationParameters,
    costs: Costmap,
    trip: Trip,
    found: Trip | NoPath,
    now: StepInput,
    near: Surroundings,
) -> Choice:
    """Compare what was found with these costs to what is left of the trip."""
    left = trip.left
    blocked_m = blocked_after_m(costs, left)
    if isinstance(found, NoPath):
        is_stuck = blocked_m is not None and blocked_m < TURN_BACK_M
        return Choice.STUCK if is_stuck else Choice.KEEP
    if blocked_m is not None or found.is_interim != trip.is_interim:
        return Choice.TAKE_NEW
    turn = turn_worth(params.follower, found.path, now.pose)
    is_better = worth(costs, found.path) + turn < BETTER_SHARE * worth(costs, left)
    if turn == 0.0 and not is_better:
        is_better = _is_clearer(costs, found.path, left)
    if not is_better or trip.is_interim:
        return Choice.KEEP
    has_to_wait = turn > 0 and is_in_the_way(params.outline, near, TURN_S)
    return Choice.KEEP if has_to_wait else Choice.TAKE_NEW


class Waiting(Record, frozen=True):
    """Since when, and until when, the robot waits for somebody rather than going round him; why, as a sentence."""

    since_s: float
    until_s: float
    reason: str


def waiting(
    params: NavigationParameters, known: Awareness, trip: Trip, found: Trip, since_s: float, now_s: float
) -> Waiting | None:
    """Whether to wait for who stands on the trip, instead of taking the longer path that was found.

    It waits as long as the way round would take, counted from ``since_s``.
    """
    place = blocked_at(known.planned_costs, trip.left)
    longer_m = found.path.length_m - trip.left.length_m
    until_s = since_s + min(longer_m / params.follower.max_speed_m_s, DETOUR_S)
    if place is None or longer_m < LONGER_M or now_s >= until_s or not known.may_leave(place, now_s):
        return None
    there = known.frame.pose_to_map(Pose2D(float(place[0]), float(place[1])))
    where = f"({there.x_m:.2f}, {there.y_m:.2f})"
    told = f"waiting for somebody at {where} to go on: the way round is {longer_m:.1f} m longer"
    return Waiting(since_s, until_s, told)


def _is_clearer(costs: Costmap, new: Path, left: Path) -> bool:
    """Whether a path leaves more room to what stands, where the present one is tight."""
    tight_m = costs.inflation.tight_m
    has_m = least_room_m(costs, left)
    return has_m < tight_m and min(least_room_m(costs, new), tight_m) > has_m + CLEARER_M
