"""Kinematics of two and four wheels, by hand and there and back."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from chefbotd.core.geometry import Twist2D
from chefbotd.motion.kinematics import ChassisParameters, Kinematics, Side, WheelParameters, places_x_m
from tests.budget import examples
from tests.fakes.wheels import wheel_speeds_rad_s

CHEFBOT = ChassisParameters(
    track_width_m=0.3,
    wheels=(
        WheelParameters(name="left", side=Side.LEFT, radius_m=0.045),
        WheelParameters(name="right", side=Side.RIGHT, radius_m=0.045),
    ),
)
KHAN = ChassisParameters(
    track_width_m=0.189,
    wheels=tuple(
        WheelParameters(name=f"{end}_{side}_wheel", side=side, radius_m=0.03)
        for end in ("front", "rear")
        for side in (Side.LEFT, Side.RIGHT)
    ),
)


def test_driving_straight_turns_all_wheels_alike() -> None:
    """0.09 m/s on wheels of 0.045 m radius is 2 rad/s on both sides."""
    assert wheel_speeds_rad_s(Kinematics(CHEFBOT), Twist2D(0.09, 0.0)) == (2.0, 2.0)


def test_turning_left_rolls_the_right_side_forward() -> None:
    """2 rad/s about the middle of a 0.3 m track is 0.3 m/s at each rim, backward on the left."""
    assert Kinematics(CHEFBOT).rim_speeds_m_s(Twist2D(0.0, 2.0)) == (-0.3, 0.3)


def test_four_wheels_keep_their_configured_order() -> None:
    """KHAN turning at 2 rad/s: 2 * 0.0945 m / 0.03 m = 6.3 rad/s, left wheels backward, in their order."""
    assert wheel_speeds_rad_s(Kinematics(KHAN), Twist2D(0.0, 2.0)) == pytest.approx((-6.3, 6.3, -6.3, 6.3))


def test_a_side_is_the_mean_of_its_wheels() -> None:
    """Left wheels at 1 and 3 rad, right ones at 5 and 7 rad: 2 and 6 rad on 0.03 m are 0.06 and 0.18 m."""
    assert Kinematics(KHAN).side_travel_m((1.0, 5.0, 3.0, 7.0)) == pytest.approx((0.06, 0.18))


def test_wheels_left_out_do_not_count() -> None:
    """Without the first left and the last right one: 3 and 5 rad on 0.03 m are 0.09 and 0.15 m, and so for the twist."""
    kinematics, turned = Kinematics(KHAN), (1.0, 5.0, 3.0, 7.0)
    assert kinematics.side_travel_m(turned, (0, 3)) == pytest.approx((0.09, 0.15))
    twist = kinematics.twist(turned, (0, 3))
    assert (twist.linear_m_s, twist.angular_rad_s) == pytest.approx((0.12, 0.06 / 0.189))
    with pytest.raises(ValueError, match="excluded"):
        kinematics.side_travel_m(turned, (0, 2))


def test_multipliers_correct_a_whole_side() -> None:
    """A left side 10 % larger rolls 10 % further for the same angle."""
    chassis = CHEFBOT.model_copy(update={"left_radius_multiplier": 1.1})
    kinematics = Kinematics(chassis)
    assert kinematics.radii_m == pytest.approx((0.0495, 0.045))
    assert kinematics.side_travel_m((1.0, 1.0)) == pytest.approx((0.0495, 0.045))


@given(st.floats(-2, 2), st.floats(-5, 5), st.sampled_from([CHEFBOT, KHAN]))
@settings(max_examples=examples(60))
def test_wheel_speeds_lead_back_to_the_twist(
    linear_m_s: float, angular_rad_s: float, chassis: ChassisParameters
) -> None:
    """Twist to wheels to twist changes nothing."""
    kinematics = Kinematics(chassis)
    twist = kinematics.twist(wheel_speeds_rad_s(kinematics, Twist2D(linear_m_s, angular_rad_s)))
    assert twist.linear_m_s == pytest.approx(linear_m_s, abs=1e-12)
    assert twist.angular_rad_s == pytest.approx(angular_rad_s, abs=1e-12)


def test_a_twist_that_all_wheels_can_follow_is_left_alone() -> None:
    """Saturation below the limit is the identity."""
    twist = Twist2D(0.1, 0.5)
    assert Kinematics(CHEFBOT).saturate(twist, 0.377) is twist


def test_saturation_slows_the_whole_twist() -> None:
    """0.3 m/s and 2 rad/s need 0.6 m/s at the outer rim; at most 0.3 m/s halves both."""
    assert Kinematics(CHEFBOT).saturate(Twist2D(0.3, 2.0), 0.3) == Twist2D(0.15, 1.0)


@given(st.floats(-2, 2), st.floats(-20, 20), st.floats(0.01, 1))
@settings(max_examples=examples(60))
def test_saturation_keeps_the_curvature(linear_m_s: float, angular_rad_s: float, most_m_s: float) -> None:
    """No rim exceeds the limit, and angular to linear stays as asked."""
    kinematics = Kinematics(CHEFBOT)
    slowed = kinematics.saturate(Twist2D(linear_m_s, angular_rad_s), most_m_s)
    assert max(map(abs, kinematics.rim_speeds_m_s(slowed))) <= most_m_s * (1 + 1e-12)
    cross = slowed.linear_m_s * angular_rad_s - slowed.angular_rad_s * linear_m_s
    assert math.isclose(cross, 0.0, abs_tol=1e-12)


def test_a_chassis_needs_wheels_on_both_sides() -> None:
    """A robot without a right wheel is refused by name of the side."""
    with pytest.raises(ValidationError, match="at least one wheel on the right side"):
        ChassisParameters(track_width_m=0.3, wheels=CHEFBOT.wheels[:1])


def test_wheel_names_are_unique() -> None:
    """Two wheels of one name are refused, and the name is said."""
    twice = (*CHEFBOT.wheels, CHEFBOT.wheels[0])
    with pytest.raises(ValidationError, match="unique, repeated: left"):
        ChassisParameters(track_width_m=0.3, wheels=twice)


def test_the_number_of_angles_is_checked() -> None:
    """Three angles for two wheels are a bug, not a guess."""
    with pytest.raises(ValueError, match="too many values"):
        Kinematics(CHEFBOT).side_travel_m((1.0, 2.0, 3.0))


def test_a_skidding_robot_is_as_wide_as_it_turns() -> None:
    """At a multiplier of 1.5 the rims of a 0.2 m track go 0.15 m/s for 1 rad/s, and the way back agrees."""
    chassis = KHAN.model_copy(update={"track_width_m": 0.2, "track_multiplier": 1.5})
    skidding = Kinematics(chassis)
    turn = Twist2D(0.0, 1.0)
    assert skidding.rim_speeds_m_s(turn) == pytest.approx((-0.15, 0.15, -0.15, 0.15))
    assert skidding.twist(wheel_speeds_rad_s(skidding, turn)).angular_rad_s == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("order", "places_m"),
    [
        ("LR", (0.0, 0.0)),
        ("LRLR", (0.3, 0.3, -0.3, -0.3)),
        ("LLRR", (0.3, -0.3, 0.3, -0.3)),
        ("LRRLLR", (0.3, 0.3, 0.0, 0.0, -0.3, -0.3)),
        ("LRL", (0.3, 0.0, -0.3)),
        ("LRLRL", (0.3, 0.3, 0.0, -0.3, -0.3)),
    ],
)
def test_a_sides_wheels_are_spread_over_the_wheelbase(order: str, places_m: tuple[float, ...]) -> None:
    """The first listed of a side is in front, the last behind, an only one in the middle."""
    assert places_x_m([side == "L" for side in order], 0.6) == pytest.approx(places_m)
