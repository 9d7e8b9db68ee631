"""Lets a standing robot make way for a person who comes nearer, step by step."""

import math

from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import Record
from chefbotd.navigation.evade import evasion
from chefbotd.navigation.parameters import NavigationParameters
from chefbotd.navigation.reports import StepInput
from chefbotd.navigation.steering import slewed
from chefbotd.navigation.surroundings import Surroundings

CALM_S = 3.0
"""When nobody was evaded for so long, the next one is another."""


class MakingWay(Record, frozen=True):
    """Whether the robot makes way now, when it last did, and from where (in the grid's frame)."""

    is_active: bool = False
    last_s: float = -math.inf
    grid_from_start: Pose2D | None = None


def make_way(
    params: NavigationParameters,
    making: MakingWay,
    now: StepInput,
    near: Surroundings,
    wanted: Twist2D | None,
    *,
    is_blocked: bool,
) -> tuple[MakingWay, Twist2D | None]:
    """Make way for who comes nearer while the robot stands, or brakes since it ``is_blocked``; else what is ``wanted``.

    None is standing.
    """
    here, start = near.grid_from_base, making.grid_from_start
    goes = wanted is not None and wanted.linear_m_s > 0.0 and not is_blocked
    if goes and not making.is_active:
        return making, wanted
    moves = goes or (not making.is_active and now.last.linear_m_s > 0.01)
    if start is None or now.now_s - making.last_s > CALM_S:
        start = here
    away_m = math.hypot(here.x_m - start.x_m, here.y_m - start.y_m)
    is_stuck = making.is_active or wanted is None or abs(wanted.angular_rad_s) < 0.05
    found = evasion(params.outline, near, now.last, away_m, is_stuck=is_stuck, only_touch=moves)
    if found is None:
        return MakingWay(False, making.last_s, start), wanted
    return MakingWay(True, now.now_s, start), slewed(params.follower, now.last, found, now.dt_s)
