"""Lets a standing robot make way for a person who comes nearer, step by step."""

import math
from dataclasses import dataclass, replace

from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.navigation.arcs import Surroundings
from chefbotd.navigation.evade import evasion
from chefbotd.navigation.parameters import NavigationParameters
from chefbotd.navigation.reports import StepInput
from chefbotd.navigation.steering import slewed

CALM_S = 3.0
"""When nobody was evaded for so long, the next one is another."""


@dataclass(frozen=True, slots=True)
class MakingWay:
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
) -> tuple[MakingWay, Twist2D | None]:
    """Make way for who comes nearer while the robot stands; otherwise what is ``wanted`` (None is standing)."""
    here, start = near.grid_from_base, making.grid_from_start
    goes = wanted is not None and wanted.linear_m_s > 0.0
    if goes or (not making.is_active and now.last.linear_m_s > 0.01):
        return replace(making, is_active=False), wanted
    if start is None or now.now_s - making.last_s > CALM_S:
        start = here
    away_m = math.hypot(here.x_m - start.x_m, here.y_m - start.y_m)
    arcs, delay_s = params.follower.arcs, params.follower.delay_s
    is_stuck = making.is_active or wanted is None or abs(wanted.angular_rad_s) < 0.05
    found = evasion(params.evade, arcs, params.outline, near, now.last, delay_s, away_m, is_stuck=is_stuck)
    if found is None:
        return MakingWay(False, making.last_s, start), wanted
    return MakingWay(True, now.now_s, start), slewed(params.follower, now.last, found, now.dt_s)
