"""The obstacle guard."""

import math
from dataclasses import astuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D, WheelVelocities
from chefbotd.safety.guard import Beams, GuardParameters, closing_limit_m_s, mount, restrain, see
from tests.budget import examples

PARAMETERS = GuardParameters(stop_distance_m=0.15, deceleration_m_s2=0.5, reaction_s=0.1, max_age_s=0.5)
AHEAD, BACK, SPIN = Twist2D(0.3, 0.0), Twist2D(-0.3, 0.0), Twist2D(0.0, 1.0)
FRONT = {"front": Pose2D(0.15)}


def reading(
    sensor: str, range_m: float | None, status: RangeStatus = RangeStatus.OK, stamp_s: float = 10.0
) -> RangeMeasured:
    """A beam's reading."""
    return RangeMeasured(stamp_s, sensor, status, range_m, 0.02, 4.0, 0.26)


def seeing(mounts: dict[str, Pose2D], **ranges_m: float) -> Beams:
    """Mounted sensors that have just seen these."""
    beams = mount(mounts)
    for sensor, range_m in ranges_m.items():
        beams = see(beams, reading(sensor, range_m))
    return beams


@pytest.mark.parametrize(
    ("distance_m", "age_s", "speed_m_s"),
    [
        (0.15, 0.0, 0.0),  # no room
        (0.05, 0.0, 0.0),
        (0.24, 0.0, 0.2541381),  # 0.5 (sqrt(0.1^2 + 2 0.09 / 0.5) - 0.1) = 0.5 (0.6082763 - 0.1)
        (0.24, 0.1, 0.2162278),  # 0.5 (sqrt(0.2^2 + 0.36) - 0.2) = 0.5 (0.6324555 - 0.2)
    ],
)
def test_the_limit_is_the_speed_that_can_still_be_braked(distance_m: float, age_s: float, speed_m_s: float):
    """Reaction and age at that speed, and then braking at 0.5 m/s², use up what lies before the stop distance."""
    allowed_m_s = closing_limit_m_s(PARAMETERS, distance_m, age_s)
    assert allowed_m_s == pytest.approx(speed_m_s, abs=1e-6)
    used_m = allowed_m_s * (0.1 + age_s) + allowed_m_s**2 / (2 * 0.5)
    assert used_m == pytest.approx(max(distance_m - 0.15, 0.0), abs=1e-6)


@pytest.mark.parametrize("twist", [BACK, SPIN, Twist2D(-0.1, -2.0), STANDING])
def test_what_does_not_bring_it_closer_stays_allowed(twist: Twist2D):
    """With a wall at the bumper: backing off and turning on the spot are as they were asked for."""
    assert restrain(PARAMETERS, seeing(FRONT, front=0.05), twist, 10.0) == (twist, None)


def test_turning_away_while_driving_ahead_keeps_the_turn():
    """Only the way ahead is taken away."""
    assert restrain(PARAMETERS, seeing(FRONT, front=0.05), Twist2D(0.3, 1.0), 10.0) == (SPIN, "front")


def test_far_away_nothing_is_limited():
    """At 2 m the limit is well above what is asked for."""
    assert restrain(PARAMETERS, seeing(FRONT, front=2.0), AHEAD, 10.0) == (AHEAD, None)


@pytest.mark.parametrize(
    ("status", "expected"),
    [
        (RangeStatus.TOO_NEAR, (STANDING, "front")),
        (RangeStatus.AMBIGUOUS, (STANDING, "front")),
        (RangeStatus.TOO_FAR, (AHEAD, None)),
        (RangeStatus.NO_ECHO, (AHEAD, None)),
    ],
)
def test_a_reading_without_a_distance(status: RangeStatus, expected: tuple[Twist2D, str | None]):
    """Too near is no distance at all; too far and no echo are a free way."""
    beams = see(mount(FRONT), reading("front", None, status))
    assert restrain(PARAMETERS, beams, AHEAD, 10.0) == expected


@pytest.mark.parametrize("now_s", [10.0, 10.51])
@pytest.mark.parametrize("heard", [True, False])
def test_a_silent_sensor_is_an_obstacle_only_when_configured_so(now_s: float, heard: bool):
    """Never heard or too old: free by default, a wall where ``silent_is_obstacle``."""
    beams = seeing(FRONT, front=4.0) if heard else mount(FRONT)
    silent = now_s > 10.5 or not heard
    strict = PARAMETERS.model_copy(update={"silent_is_obstacle": True})
    assert restrain(PARAMETERS, beams, AHEAD, now_s) == (AHEAD, None)
    assert restrain(strict, beams, AHEAD, now_s) == ((STANDING, "front") if silent else (AHEAD, None))
    assert restrain(strict, beams, BACK, now_s) == (BACK, None)


def test_a_sensor_that_is_not_mounted_guards_nothing():
    """Its reading changes no beam."""
    assert see(mount(FRONT), reading("rear", 0.01)) == mount(FRONT)


def test_a_sensor_at_the_corner_limits_turning_into_the_wall():
    """0.2 m ahead, looking left: a left turn brings it closer at 0.2 m/rad, a right turn and driving do not."""
    beams = seeing({"left": Pose2D(0.2, 0.0, math.pi / 2)}, left=0.1)
    assert restrain(PARAMETERS, beams, SPIN, 10.0) == (STANDING, "left")
    assert restrain(PARAMETERS, beams, Twist2D(0.3, -1.0), 10.0) == (Twist2D(0.3, -1.0), None)


def test_between_two_obstacles_neither_is_approached():
    """A wall ahead and one behind: no driving either way, turning stays."""
    beams = seeing({"front": Pose2D(0.15), "rear": Pose2D(-0.15, 0.0, math.pi)}, front=0.1, rear=0.1)
    assert restrain(PARAMETERS, beams, Twist2D(0.3, 1.0), 10.0) == (SPIN, "front")
    assert restrain(PARAMETERS, beams, Twist2D(-0.3, 1.0), 10.0) == (SPIN, "rear")


coordinate = st.floats(-0.3, 0.3)
poses = st.builds(Pose2D, coordinate, coordinate, st.floats(-math.pi, math.pi))


@given(
    st.lists(st.tuples(poses, st.floats(0.02, 4.0)), min_size=1, max_size=4),
    st.builds(Twist2D, st.floats(-1.0, 1.0), st.floats(-5.0, 5.0)),
)
@settings(max_examples=examples(200))
def test_no_beam_is_ever_shortened_faster_than_it_may(sensors: list[tuple[Pose2D, float]], wanted: Twist2D):
    """However many sensors look wherever: each range shrinks no faster than its limit, and nothing turns round.

    The oracle moves the robot for a microsecond and sees how much nearer a far point on each beam has come.
    """
    mounts = {str(i): pose for i, (pose, _) in enumerate(sensors)}
    beams = seeing(mounts, **{str(i): range_m for i, (_, range_m) in enumerate(sensors)})
    twist, _ = restrain(PARAMETERS, beams, wanted, 10.0)
    for pose, range_m in sensors:
        dt_s = 1e-6
        moved = Pose2D(twist.linear_m_s * dt_s, 0.0, twist.angular_rad_s * dt_s).compose(pose)
        along_m = (moved.x_m - pose.x_m) * math.cos(pose.heading_rad)
        along_m += (moved.y_m - pose.y_m) * math.sin(pose.heading_rad)
        assert along_m / dt_s <= closing_limit_m_s(PARAMETERS, range_m, 0.0) + 1e-4
    for got, asked in zip(astuple(twist), astuple(wanted), strict=True):
        assert min(asked, 0.0) - 1e-12 <= got <= max(asked, 0.0) + 1e-12


def wheels(left_rad_s: float, right_rad_s: float) -> WheelVelocities:
    """Two wheels of 0.05 m radius, 0.25 m apart."""
    linear_m_s = 0.05 * (left_rad_s + right_rad_s) / 2
    return WheelVelocities(
        (left_rad_s, right_rad_s), Twist2D(linear_m_s, 0.05 * (right_rad_s - left_rad_s) / 0.25)
    )


def test_wheels_that_close_in_are_slowed_together():
    """At 0.24 m, 0.2541381 m/s is allowed; 8 and 12 rad/s make 0.5 m/s, so each wheel gets 0.5082763 of its own."""
    limited, sensor = restrain(PARAMETERS, seeing(FRONT, front=0.24), wheels(8.0, 12.0), 10.0)
    assert isinstance(limited, WheelVelocities)
    assert sensor == "front"
    assert limited.rad_s == pytest.approx((8.0 * 0.5082763, 12.0 * 0.5082763))
    assert limited.twist.linear_m_s == pytest.approx(0.2541381)


@pytest.mark.parametrize("motion", [wheels(-8.0, -4.0), wheels(-5.0, 5.0), wheels(0.0, 0.0)])
def test_wheels_that_do_not_close_in_turn_as_asked(motion: WheelVelocities):
    """Backing off and turning on the spot with a wall at the bumper."""
    assert restrain(PARAMETERS, seeing(FRONT, front=0.05), motion, 10.0) == (motion, None)


def test_of_two_beams_the_nearer_decides_for_wheels():
    """Both look ahead; the one that allows less is named."""
    beams = seeing({"low": Pose2D(0.15), "high": Pose2D(0.1), "spare": Pose2D(0.1)}, low=0.24, high=0.16)
    limited, sensor = restrain(PARAMETERS, beams, wheels(8.0, 12.0), 10.0)
    assert sensor == "high"
    assert limited.twist.linear_m_s == pytest.approx(closing_limit_m_s(PARAMETERS, 0.16, 0.0))
