"""Decides whether the robot drives on or evades a person, and for how far on the way to one goal.

Who follows the robot, or comes to it at its goal, is not evaded as long as he is no faster and keeps his distance.
"""

import math
from typing import Final

import numpy as np

from chefbotd.components.navigation.algorithms.evade import ROOM_M, evading_twist, safest
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, StepInput
from chefbotd.components.navigation.algorithms.outline import Footprint, clearances_m
from chefbotd.components.navigation.algorithms.steering import limit_change
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import Record, replace

FOLLOWS_M_S: Final = 0.35
"""Somebody behind the robot who is no faster than this follows it, and stops where it stops."""

LED_M_S: Final = 0.05
LED_FOR_S: Final = 3.0
"""The robot has led somebody when it drove forwards faster than the first, and for so long after that."""

MOST_FOR_GOAL_M: Final = 4.0
"""On the way to one goal the robot evades people for so much of its way, and stands for them then."""


CALM_S = 3.0
"""After so long without an evasion the next one is counted from its own start."""


class Evasion(Record, frozen=True):
    """Whether the robot evades now, when it last did, and from where (in the grid's frame); how far for this goal.

    ``led`` is the robot's pose when it last drove forwards, and ``led_s`` when that was. ``who`` is where the person is
    (x, y of the grid's frame) whom the robot evades, or would evade if it had not ``evaded_m`` enough for this goal.
    """

    is_active: bool = False
    last_s: float = -math.inf
    grid_from_start: Pose2D | None = None
    evaded_m: float = 0.0
    led: Pose2D | None = None
    led_s: float = -math.inf
    who: tuple[float, float] | None = None

    @property
    def is_used_up(self) -> bool:
        """Whether the robot has evaded far enough on the way to this goal."""
        return self.evaded_m >= MOST_FOR_GOAL_M


def evade(
    params: NavigationParameters,
    evasion: Evasion,
    now: StepInput,
    near: Surroundings,
    twist: Twist2D | None,
    *,
    is_blocked: bool,
    arrives: bool = False,
    waits: bool = False,
) -> tuple[Evasion, Twist2D | None]:
    """Evade who comes nearer while the robot stands, or brakes because it ``is_blocked``; else drive ``twist``.

    None is standing, which is best where a person would touch the moving robot at once. A robot that ``arrives`` at its
    goal evades nobody who is slow. Who stands where the robot ``waits`` for him has not stopped for it: he is evaded
    when he walks.
    """
    here, start = near.grid_from_base, evasion.grid_from_start
    evasion = _count_evasion(evasion, now, here)
    near = _without_followers(params.outline, near, evasion, now.now_s, arrives=arrives)
    goes = twist is not None and twist.linear_m_s > 0.0 and not is_blocked
    if goes and not evasion.is_active:
        evasion = replace(evasion, is_active=False, who=None)
        return evasion, safest(params.outline, near, now.last, twist)
    moves = goes or (not evasion.is_active and now.last.linear_m_s > 0.01)
    if start is None or now.now_s - evasion.last_s > CALM_S:
        start = here
    away_m = math.hypot(here.x_m - start.x_m, here.y_m - start.y_m)
    is_stuck = (evasion.is_active or twist is None or abs(twist.angular_rad_s) < 0.05) and not waits
    evading = evading_twist(params.outline, near, now.last, away_m, is_stuck=is_stuck, only_touch=moves)
    who = None if evading is None else _nearest_walker(near)
    if evasion.is_used_up:
        evading = None
    last_s = evasion.last_s if evading is None else now.now_s
    evasion = replace(evasion, is_active=evading is not None, last_s=last_s, grid_from_start=start, who=who)
    if evading is not None:
        twist = limit_change(params.follower, now.last, evading, now.dt_s)
    return evasion, safest(params.outline, near, now.last, twist)


def _count_evasion(evasion: Evasion, now: StepInput, here: Pose2D) -> Evasion:
    """The same with the way of the last step, if that was driven to evade, and with whom it may have led."""
    if evasion.is_active:
        return replace(evasion, evaded_m=evasion.evaded_m + abs(now.last.linear_m_s) * now.dt_s)
    if now.last.linear_m_s > LED_M_S:
        return replace(evasion, led=here, led_s=now.now_s)
    return evasion


def _without_followers(
    outline: Footprint, near: Surroundings, evasion: Evasion, now_s: float, *, arrives: bool
) -> Surroundings:
    """The same without slow people who follow the robot, or come to it at its goal, and are not near yet."""
    led = evasion.led if now_s - evasion.led_s <= LED_FOR_S else None
    if led is None and not arrives:
        return near
    velocity = near.velocity_m_s if near.intent_m_s is None else near.intent_m_s
    speed_m_s = np.hypot(velocity[:, 0], velocity[:, 1])
    apart_m = clearances_m(outline.hull, outline.pad_m, near.points_m)
    follows = (speed_m_s > 0) & (speed_m_s <= FOLLOWS_M_S) & (apart_m >= ROOM_M)
    if not arrives and led is not None:
        turn = near.grid_from_base.heading_rad - led.heading_rad
        direction = np.array([math.cos(turn), -math.sin(turn)])  # in which it drove, in its present frame
        follows &= (near.points_m @ direction < 0) & (velocity @ direction > 0)
    if not follows.any():
        return near
    kept = ~follows
    intent = None if near.intent_m_s is None else near.intent_m_s[kept]
    walks = None if near.is_walker is None else near.is_walker[kept]
    return replace(
        near,
        points_m=near.points_m[kept],
        velocity_m_s=near.velocity_m_s[kept],
        margin_m=near.margin_m[kept],
        intent_m_s=intent,
        is_walker=walks,
    )


def _nearest_walker(near: Surroundings) -> tuple[float, float] | None:
    """Where in the grid the nearest point is that belongs to somebody who walks, or will."""
    intent = near.velocity_m_s if near.intent_m_s is None else near.intent_m_s
    walks = np.flatnonzero(intent.any(axis=1) | near.velocity_m_s.any(axis=1))
    if not len(walks):
        return None
    points = near.points_m[walks]
    x_m, y_m = points[int(np.argmin(np.hypot(points[:, 0], points[:, 1])))]
    place = near.grid_from_base.compose(Pose2D(float(x_m), float(y_m)))
    return place.x_m, place.y_m
