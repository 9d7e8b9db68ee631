"""The IMU: unit quaternions, headings and SI units in the robot's own axes."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.core.events import InertialCounted, OrientationReported
from chefbotd.core.geometry import wrap_angle
from chefbotd.sensing.imu import ImuParameters, from_counts, from_quaternion
from tests.budget import examples

HALF = math.sqrt(0.5)


def test_a_quarter_turn_to_the_left() -> None:
    """(0, 0, sin 45, cos 45) is a heading of 90 degrees; rates and accelerations are not known."""
    measured = from_quaternion(ImuParameters(), OrientationReported(3.0, 4.0, 0.0, 0.0, HALF, HALF))
    assert measured.stamp_s == 3.0
    assert measured.heading_rad == pytest.approx(math.pi / 2)
    assert measured.angular_velocity_rad_s is None
    assert measured.linear_acceleration_m_s2 is None


def test_two_decimals_are_made_a_unit_quaternion() -> None:
    """The wire's (0, 0, 0.71, 0.71) has a length of 1.004; the direction is what counts."""
    measured = from_quaternion(ImuParameters(), OrientationReported(0.0, 4.0, 0.0, 0.0, 0.71, 0.71))
    assert measured.orientation == pytest.approx((0, 0, HALF, HALF))


def test_a_tilt_leaves_the_heading_alone() -> None:
    """Turned by 90 degrees and rolled by 90 about its own x axis, (0.5, 0.5, 0.5, 0.5), it heads 90."""
    measured = from_quaternion(ImuParameters(), OrientationReported(0.0, 4.0, 0.5, 0.5, 0.5, 0.5))
    assert measured.heading_rad == pytest.approx(math.pi / 2)


def test_a_mount_that_looks_left_is_turned_back() -> None:
    """A sensor mounted 90 degrees to the left that says 90 is on a robot that heads 0."""
    measured = from_quaternion(
        ImuParameters(mount_heading_rad=math.pi / 2), OrientationReported(0.0, 4.0, 0.0, 0.0, HALF, HALF)
    )
    assert measured.heading_rad == pytest.approx(0.0, abs=1e-15)
    assert measured.orientation == pytest.approx((0, 0, 0, 1), abs=1e-15)


def test_a_mount_turns_a_tilt_into_the_robots_axes() -> None:
    """A sensor looking left that rolls right side down by 90 degrees is on a robot with its nose down.

    The sensor's x axis is the robot's y axis, so a roll about the one is a pitch about the other:
    turn left (0, 0, h, h) times roll (h, 0, 0, h) is (0.5, 0.5, 0.5, 0.5), and the robot's own orientation
    is a pitch (0, h, 0, h).
    """
    measured = from_quaternion(
        ImuParameters(mount_heading_rad=math.pi / 2), OrientationReported(0.0, 4.0, 0.5, 0.5, 0.5, 0.5)
    )
    assert measured.orientation == pytest.approx((0, HALF, 0, HALF), abs=1e-15)


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi), st.floats(0.5, 2.0))
@settings(max_examples=examples(60))
def test_heading_is_what_was_turned(turned_rad: float, mount_rad: float, length: float) -> None:
    """On level ground the heading is the sensor's yaw less its mount, whatever the length or sign."""
    z, w = length * math.sin(turned_rad / 2), length * math.cos(turned_rad / 2)
    for sign in (1, -1):
        measured = from_quaternion(
            ImuParameters(mount_heading_rad=mount_rad),
            OrientationReported(0.0, 4.0, 0.0, 0.0, sign * z, sign * w),
        )
        assert measured.heading_rad is not None
        assert wrap_angle(measured.heading_rad - turned_rad + mount_rad) == pytest.approx(0, abs=1e-9)


def test_a_zero_quaternion_is_no_orientation() -> None:
    """Four zeros are refused instead of divided by."""
    with pytest.raises(ValueError, match="zero"):
        from_quaternion(ImuParameters(), OrientationReported(0.0, 4.0, 0.0, 0.0, 0.0, 0.0))


def test_counts_become_si_units() -> None:
    """At rest 16384 counts upwards are 9.80665 m/s2; 131 counts are a degree a second."""
    measured = from_counts(ImuParameters(), InertialCounted(2.0, 4.0, (0, 0, 16384), (131, -262, 1310)))
    degree = math.pi / 180
    assert measured.linear_acceleration_m_s2 == pytest.approx((0, 0, 9.80665))
    assert measured.angular_velocity_rad_s == pytest.approx((degree, -2 * degree, 10 * degree))
    assert measured.orientation is None
    assert measured.heading_rad is None


def test_counts_are_turned_into_the_robots_axes() -> None:
    """A sensor whose x axis points left feels a forward push along its own -y axis."""
    measured = from_counts(
        ImuParameters(mount_heading_rad=math.pi / 2), InertialCounted(0.0, 4.0, (0, -16384, 0), (0, 0, 0))
    )
    assert measured.linear_acceleration_m_s2 == pytest.approx((9.80665, 0, 0), abs=1e-12)


def test_a_calibrated_gyroscope_shows_the_true_rate() -> None:
    """It shows 1.02 times the rate and 0.01 rad/s at rest: 0.214 rad/s shown are 0.2 true."""
    params = ImuParameters(gyro_scale=1.02, gyro_bias_rad_s=0.01)
    counts = round(math.degrees(0.214) * 131)
    measured = from_counts(params, InertialCounted(0.0, 4.0, (0, 0, 0), (0, 0, counts)))
    assert measured.angular_velocity_rad_s is not None
    assert measured.angular_velocity_rad_s[2] == pytest.approx(0.2, abs=1e-4)


@pytest.mark.parametrize("turned_over", [False, True])
def test_a_sensor_that_is_mounted_upside_down_shows_the_robots_heading(turned_over: bool) -> None:
    """0.7 rad to the left: it shows -0.7 by its own z axis, or that it lies on its back."""
    sin, cos = math.sin(0.35), math.cos(0.35)
    shown = (cos, sin, 0.0, 0.0) if turned_over else (0.0, 0.0, -sin, cos)
    measured = from_quaternion(ImuParameters(upside_down=True), OrientationReported(1.0, 1.0, *shown))
    assert measured.heading_rad == pytest.approx(0.7)
    assert measured.orientation == pytest.approx((0.0, 0.0, sin, cos))


def test_the_rates_of_a_sensor_that_is_mounted_upside_down_are_the_robots() -> None:
    """Half a turn about its x axis: y and z change their signs."""
    counted = InertialCounted(1.0, 1.0, (0, 0, -16384), (131, 131, -131))
    measured = from_counts(ImuParameters(upside_down=True), counted)
    degree = math.radians(1)
    assert measured.angular_velocity_rad_s == pytest.approx((degree, -degree, degree))
    assert measured.linear_acceleration_m_s2 == pytest.approx((0.0, 0.0, 9.80665))
