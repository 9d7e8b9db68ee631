"""Navigation plans with what the robot's configured limits allow, where that is less than what it was tried with."""

import math
from pathlib import Path

import pytest

from chefbotd.components.navigation.algorithms.evade import Agility
from chefbotd.components.navigation.algorithms.steering import FollowerLimits
from chefbotd.components.navigation.build import navigation_skill_parameters
from chefbotd.components.navigation.robot_limits import agility_of, follower_limits
from chefbotd.components.navigation.skill_requests import NavigationSkillParameters
from chefbotd.settings import load


def parameters(**limits: float) -> NavigationSkillParameters:
    """What the skill is told of a robot with these linear limits, as the worker reads it; its guard counts on little."""
    overrides = {"safety.guard.deceleration_m_s2": 0.02}
    overrides |= {f"limits.linear.{key}": value for key, value in limits.items()}
    told = navigation_skill_parameters(load(overrides=overrides), Path("/nowhere"))
    return NavigationSkillParameters.model_validate_json(told.model_dump_json())


def test_a_robot_with_room_in_its_limits_is_driven_as_it_was_tried() -> None:
    """ChefBot's 1 m/s² are more than the follower's 0.5; it turns with 1.8 of its 2 rad/s²."""
    assert follower_limits(parameters()) == FollowerLimits()
    assert agility_of(parameters().limits) == Agility(1.0, 1.0)


def test_tighter_limits_are_planned_with() -> None:
    """Each of them by itself; what was left out is as the configuration fills it in."""
    told = parameters(max_forward_m_s=0.2, acceleration_m_s2=0.4, deceleration_m_s2=0.3)
    follower = follower_limits(told)
    assert (follower.max_speed_m_s, follower.acceleration_m_s2, follower.deceleration_m_s2) == (0.2, 0.4, 0.3)
    assert agility_of(told.limits) == Agility(0.4, 0.3)
    backward = agility_of(parameters(reverse_deceleration_m_s2=0.1).limits)
    assert backward == Agility(1.0, 0.1)


def test_a_limited_jerk_makes_a_change_of_speed_take_longer() -> None:
    """To 0.25 m/s with 1 m/s²: 0.25 s, and a / j = 0.1 s more with 10 m/s³; 1 s with 1 m/s³, which reaches 0.5 m/s²."""
    assert agility_of(parameters(jerk_m_s3=10.0).limits).deceleration_m_s2 == pytest.approx(0.25 / 0.35)
    assert agility_of(parameters(jerk_m_s3=1.0).limits).deceleration_m_s2 == pytest.approx(0.25)
    assert math.isclose(agility_of(parameters(jerk_m_s3=4.0).limits).acceleration_m_s2, 0.5)  # both are 0.5 s
