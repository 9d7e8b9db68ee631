"""How fast the robot can change its motion: what navigation was tried with, or less where the robot's limits say so."""

import math

from chefbotd.components.navigation.algorithms.evade import AGILE, SPEED_M_S, Agility
from chefbotd.components.navigation.algorithms.steering import FollowerLimits
from chefbotd.components.navigation.skill_requests import NavigationSkillParameters
from chefbotd.core.record import replace
from chefbotd.motion.limits import MotionLimits


def follower_limits(parameters: NavigationSkillParameters) -> FollowerLimits:
    """The limits while a path is followed: the configured ones at the daemon's start, where they are tighter."""
    tried, limits = FollowerLimits(), parameters.limits
    agility = agility_of(limits)
    fastest_m_s = min(tried.max_speed_m_s, parameters.navigation.max_speed_m_s)
    if limits is None:
        return replace(tried, max_speed_m_s=fastest_m_s)
    turns = limits.angular.axis
    return replace(
        tried,
        max_speed_m_s=min(fastest_m_s, limits.linear.max_forward_m_s),
        acceleration_m_s2=min(tried.acceleration_m_s2, agility.acceleration_m_s2),
        deceleration_m_s2=min(tried.deceleration_m_s2, agility.deceleration_m_s2),
        turn_acceleration_rad_s2=min(
            tried.turn_acceleration_rad_s2, turns.acceleration, turns.deceleration,
            turns.reverse_acceleration, turns.reverse_deceleration,
        ),
    )  # fmt: skip


def agility_of(limits: MotionLimits | None) -> Agility:
    """The weaker of both directions, in m/s²; a limited jerk makes both less."""
    if limits is None:
        return AGILE
    axis = limits.linear.axis
    gains = min(axis.acceleration, axis.reverse_acceleration)
    brakes = min(axis.deceleration, axis.reverse_deceleration)
    return Agility(_with_jerk(gains, axis.jerk), _with_jerk(brakes, axis.jerk))


def _with_jerk(rate_m_s2: float, jerk_m_s3: float) -> float:
    """The constant rate that takes as long for a change by the speed at which people are evaded.

    The S-curve takes v / a + a / j where a is reached (v > a² / j), and 2 sqrt(v / j) where it is not.
    """
    if rate_m_s2**2 / jerk_m_s3 < SPEED_M_S:
        return SPEED_M_S / (SPEED_M_S / rate_m_s2 + rate_m_s2 / jerk_m_s3)
    return math.sqrt(SPEED_M_S * jerk_m_s3) / 2
