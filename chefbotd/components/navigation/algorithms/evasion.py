"""Decides whether the robot drives on or evades a person, and for how far on the way to one goal.

Who follows the robot, or comes to it at its goal, is not evaded as long as he is no faster and keeps his distance.
"""

import math
from typing import Final

import numpy as np

from chefbotd.components.navigation.algorithms.evade import ROOM_M, evading_twist, safest, will_be_touched
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, StepInput
from chefbotd.components.navigation.algorithms.outline import Footprint, clearances_m
from chefbotd.components.navigation.algorithms.steering import limit_change
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence

FOLLOWS_M_S: Final = 0.35
"""Somebody behind the robot who is no faster than this follows it, and stops where it stops."""

LED_M_S: Final = 0.05
LED_FOR_S: Final = 3.0
"""The robot has led somebody when it drove forwards faster than the first, and for so long after that."""

MOST_FOR_GOAL_M: Final = 4.0
"""On the way to one goal the robot evades people for so much of its way, and stands for them then."""


EVADES_M_S2: Final = 1.0
"""It makes way so fast from a stand, which is what ChefBot's limits allow, or as its own limits allow."""

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
    inputs: StepInput,
    surroundings: Surroundings,
    twist: Twist2D | None,
    *,
    is_blocked: bool,
    arrives: bool = False,
    waits: bool = False,
) -> tuple[Evasion, Twist2D | None]:
    """Evade who comes nearer while the robot stands, or brakes because it ``is_blocked``; else drive ``twist``.

    A robot that drives evades who would touch it, both where it drives on and where it stands.

    None is standing, which is best where a person would touch the moving robot at once. A robot that ``arrives`` at its
    goal evades nobody who is slow. Who stands where the robot ``waits`` for him has not stopped for it: he is evaded
    when he walks.
    """
    pose, start, agility = surroundings.grid_from_base, evasion.grid_from_start, params.agility
    evasion = _count_evasion(evasion, inputs, pose)
    surroundings = _without_followers(params.outline, surroundings, evasion, inputs.now_s, arrives=arrives)
    goes = twist is not None and twist.linear_m_s > 0.0 and not is_blocked
    is_safe = twist is not None and not will_be_touched(
        params.outline, surroundings, inputs.last, twist, agility
    )
    if goes and is_safe and not evasion.is_active:
        evasion = replace(evasion, is_active=False, who=None)
        return evasion, safest(params.outline, surroundings, inputs.last, twist, agility)
    moves = goes or (not evasion.is_active and inputs.last.linear_m_s > 0.01)
    if start is None or inputs.now_s - evasion.last_s > CALM_S:
        start = pose
    away_m = math.hypot(pose.x_m - start.x_m, pose.y_m - start.y_m)
    is_stuck = (evasion.is_active or twist is None or abs(twist.angular_rad_s) < 0.05) and not waits
    evading = evading_twist(
        params.outline,
        surroundings,
        inputs.last,
        away_m,
        is_stuck=is_stuck,
        only_touch=moves,
        agility=agility,
    )
    who = None if evading is None else _nearest_walker(surroundings)
    if evasion.is_used_up:
        evading = None
    last_s = evasion.last_s if evading is None else inputs.now_s
    evasion = replace(evasion, is_active=evading is not None, last_s=last_s, grid_from_start=start, who=who)
    if evading is not None:
        fastest_m_s2 = min(EVADES_M_S2, agility.acceleration_m_s2)
        hurried = replace(params.follower, acceleration_m_s2=fastest_m_s2)
        twist = limit_change(hurried, inputs.last, evading, inputs.dt_s)
    return evasion, safest(params.outline, surroundings, inputs.last, twist, agility)


def evasion_sentence(evasion: Evasion, place: Pose2D) -> str:
    """What the robot does for somebody at a place of the map."""
    if not evasion.is_used_up:
        return Sentence(
            "navigation.makes_way",
            "makes way for somebody at ({x_m:.2f}, {y_m:.2f})",
            x_m=place.x_m,
            y_m=place.y_m,
        )
    return Sentence(
        "navigation.stands_for",
        "stands for somebody at ({x_m:.2f}, {y_m:.2f}): it has made way for {evaded_m:.0f} m on the way to this goal",
        x_m=place.x_m,
        y_m=place.y_m,
        evaded_m=evasion.evaded_m,
    )


def _count_evasion(evasion: Evasion, inputs: StepInput, pose: Pose2D) -> Evasion:
    """The same with the way of the last step, if that was driven to evade, and with whom it may have led."""
    if evasion.is_active:
        return replace(evasion, evaded_m=evasion.evaded_m + abs(inputs.last.linear_m_s) * inputs.dt_s)
    if inputs.last.linear_m_s > LED_M_S:
        return replace(evasion, led=pose, led_s=inputs.now_s)
    return evasion


def _without_followers(
    outline: Footprint, surroundings: Surroundings, evasion: Evasion, now_s: float, *, arrives: bool
) -> Surroundings:
    """The same without slow people who follow the robot, or come to it at its goal, and are not near yet."""
    led = evasion.led if now_s - evasion.led_s <= LED_FOR_S else None
    if led is None and not arrives:
        return surroundings
    velocity = surroundings.velocity_m_s if surroundings.intent_m_s is None else surroundings.intent_m_s
    speed_m_s = np.hypot(velocity[:, 0], velocity[:, 1])
    apart_m = clearances_m(outline.hull, outline.pad_m, surroundings.points_m)
    follows = (speed_m_s > 0) & (speed_m_s <= FOLLOWS_M_S) & (apart_m >= ROOM_M)
    if not arrives and led is not None:
        turn = surroundings.grid_from_base.heading_rad - led.heading_rad
        direction = np.array([math.cos(turn), -math.sin(turn)])  # in which it drove, in its present frame
        follows &= (surroundings.points_m @ direction < 0) & (velocity @ direction > 0)
    if not follows.any():
        return surroundings
    kept = ~follows
    intent = None if surroundings.intent_m_s is None else surroundings.intent_m_s[kept]
    walks = None if surroundings.is_walker is None else surroundings.is_walker[kept]
    return replace(
        surroundings,
        points_m=surroundings.points_m[kept],
        velocity_m_s=surroundings.velocity_m_s[kept],
        margin_m=surroundings.margin_m[kept],
        intent_m_s=intent,
        is_walker=walks,
    )


def _nearest_walker(surroundings: Surroundings) -> tuple[float, float] | None:
    """Where in the grid the nearest point is that belongs to somebody who walks, or will."""
    intent = surroundings.velocity_m_s if surroundings.intent_m_s is None else surroundings.intent_m_s
    walks = np.flatnonzero(intent.any(axis=1) | surroundings.velocity_m_s.any(axis=1))
    if not len(walks):
        return None
    points = surroundings.points_m[walks]
    x_m, y_m = points[int(np.argmin(np.hypot(points[:, 0], points[:, 1])))]
    place = surroundings.grid_from_base.compose(Pose2D(float(x_m), float(y_m)))
    return place.x_m, place.y_m
