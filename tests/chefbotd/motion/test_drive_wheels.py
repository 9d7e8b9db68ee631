"""Wheels that are each asked for a speed: the robot's limits hold for what they come to together."""

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.core.geometry import STANDING, Twist2D
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import DriveParameters
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.pid import PidParameters
from chefbotd.motion.ramp import AxisLimits
from tests.budget import examples
from tests.fakes.wheels import turned


def chassis_of(wheels: int) -> ChassisParameters:
    """Wheels of 0.05 m, half of them a side, on a track of 0.3 m."""
    sides = ("left", "right") * (wheels // 2)
    named = [{"name": f"{side}_{i}", "side": side, "radius_m": 0.05} for i, side in enumerate(sides)]
    return ChassisParameters.model_validate({"track_width_m": 0.3, "wheels": named})


CHASSIS, FOUR = chassis_of(2), chassis_of(4)
GAINS = PidParameters(kp=100.0, ki=50.0, ks=40.0, kv=1000.0, ka=10.0, output_limit=1023.0)
SLUGGISH = MotionLimits.model_validate(
    {
        "linear": {
            "max_forward_m_s": 1.0,
            "acceleration_m_s2": 1.0,
            "deceleration_m_s2": 1.5,
            "reverse_acceleration_m_s2": 0.5,
        },
        "angular": {"max_left_rad_s": 5.0, "acceleration_rad_s2": 2.0, "deceleration_rad_s2": 3.0},
    }
)
STORIES = st.lists(
    st.tuples(
        st.one_of(
            st.lists(st.floats(-12.0, 12.0), min_size=4, max_size=4),
            st.just([0.0] * 4),
            st.tuples(st.floats(-0.6, 0.6), st.floats(-4.0, 4.0)),
        ),
        st.lists(st.floats(0.001, 0.1), min_size=1, max_size=8),
        st.booleans(),
    ),
    min_size=1,
    max_size=6,
)


def seconds_needed(axis: AxisLimits, was: float, now: float) -> float:
    """How long a change takes at the limits: to zero at the one, from there at the other.

    With a jerk limit an axis cannot help braking on into reverse for a moment: then the higher of all counts.
    """
    if axis.jerk < math.inf:
        return abs(now - was) / max(axis.acceleration, axis.deceleration)
    if was * now < 0:
        return seconds_needed(axis, was, 0.0) + seconds_needed(axis, 0.0, now)
    faster = abs(now) > abs(was)
    if max(was, now) > 0:
        return abs(now - was) / (axis.acceleration if faster else axis.deceleration)
    return abs(now - was) / (axis.reverse_acceleration if faster else axis.reverse_deceleration)


@pytest.mark.parametrize("jerk", [None, 8.0], ids=["no jerk limit", "jerk limit"])
@pytest.mark.parametrize("chassis", [CHASSIS, FOUR], ids=["two wheels", "four wheels"])
@given(story=STORIES)
@settings(deadline=None, max_examples=examples(150))
def test_wheels_keep_the_acceleration_limits_of_the_robot(
    chassis: ChassisParameters, jerk: float | None, story: list[Any]
):
    """Whatever wheels and twists are asked for in turn, at whatever intervals: both axes of the twist keep theirs."""
    wheels = len(chassis.wheels)
    limits = MotionLimits.model_validate(
        {
            "linear": {**SLUGGISH.linear.model_dump(), "jerk_m_s3": jerk},
            "angular": {**SLUGGISH.angular.model_dump(), "jerk_rad_s3": jerk},
        }
    )
    controller = Drive(DriveParameters(max_rim_speed_m_s=0.5), chassis, limits, (GAINS,) * wheels)
    names = [wheel.name for wheel in chassis.wheels]
    kinematics, state, now_s = Kinematics(chassis), controller.at_rest, 0.0
    state = controller.retarget(state, STANDING, now_s)
    for asked, steps_s, axes_independent in story:
        target = (
            Twist2D(*asked)
            if isinstance(asked, tuple)
            else controller.wheel_velocities(dict(zip(names, asked, strict=False)))
        )
        for step_s in steps_s:
            was = kinematics.twist(turned(kinematics, state.setpoint_m_s))
            now_s += step_s
            state = controller.retarget(state, target, now_s, axes_independent=axes_independent)
            now = kinematics.twist(turned(kinematics, state.setpoint_m_s))
            allowed_s = step_s + 1e-6
            assert seconds_needed(limits.linear.axis, was.linear_m_s, now.linear_m_s) <= allowed_s
            assert seconds_needed(limits.angular.axis, was.angular_rad_s, now.angular_rad_s) <= allowed_s


@pytest.mark.parametrize("chassis", [CHASSIS, FOUR], ids=["two wheels", "four wheels"])
def test_wheels_at_zero_stop_the_robot_as_soon_as_a_stop_does(chassis: ChassisParameters):
    """Straight on at 0.4 m/s or on an arc: each axis brakes as hard as it may, whoever says that it is to."""
    wheels = len(chassis.wheels)
    controller = Drive(DriveParameters(max_rim_speed_m_s=0.5), chassis, SLUGGISH, (GAINS,) * wheels)
    for motion in (Twist2D(0.4, 0.0), Twist2D(0.2, 1.0), Twist2D(0.0, -1.5)):
        state = controller.retarget(controller.at_rest, STANDING, 0.0)
        for number in range(1, 60):
            state = controller.retarget(state, motion, number * 0.02)
        stopped = zeroed = state
        for number in range(60, 120):
            stopped = controller.retarget(stopped, STANDING, number * 0.02)
            zeroed = controller.retarget(zeroed, controller.wheel_velocities({}), number * 0.02)
            assert zeroed.setpoint_m_s == pytest.approx(stopped.setpoint_m_s)
        assert zeroed.duty == (0,) * wheels
