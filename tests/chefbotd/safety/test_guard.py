"""The obstacle guard."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import astuple

from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D, WheelVelocities
from chefbotd.safety.guard import Beams, GuardParameters, closing_limit_m_s, from_mounts, limit, update
from tests.budget import examples

PARAMETERS = GuardParameters(stop_distance_m=0.15, deceleration_m_s2=0.5, reaction_s=0.1, max_age_s=0.5)
AHEAD, BACK, SPIN = Twist2D(0.3, 0.0), Twist2D(-0.3, 0.0), Twist2D(0.0, 1.0)
FRONT = {"front": Pose2D(0.15)}


def reading(
    sensor: str,
    range_m: float | None,
    status: RangeStatus = RangeStatus.OK,
    stamp_s: float = 10.0,
    arrival_s: float | None = None,
    min_range_m: float = 0.02,
) -> RangeMeasured:
    """A beam's reading."""
    return RangeMeasured(
        stamp_s, stamp_s if arrival_s is None else arrival_s, sensor, status, range_m, min_range_m, 4.0, 0.26
    )


def seeing(mounts: dict[str, Pose2D], **ranges_m: float) -> Beams:
    """Mounted sensors that have just seen these."""
    beams = from_mounts(mounts)
    for sensor, range_m in ranges_m.items():
        beams = update(PARAMETERS, beams, reading(sensor, range_m))
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
    assert limit(PARAMETERS, seeing(FRONT, front=0.05), twist, 10.0) == (twist, None)


def test_turning_away_while_driving_ahead_keeps_the_turn():
    """Only the way ahead is taken away."""
    assert limit(PARAMETERS, seeing(FRONT, front=0.05), Twist2D(0.3, 1.0), 10.0) == (SPIN, "front")


def test_far_away_nothing_is_limited():
    """At 2 m the limit is well above what is asked for."""
    assert limit(PARAMETERS, seeing(FRONT, front=2.0), AHEAD, 10.0) == (AHEAD, None)


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
    beams = update(PARAMETERS, from_mounts(FRONT), reading("front", None, status))
    assert limit(PARAMETERS, beams, AHEAD, 10.0) == expected


@pytest.mark.parametrize("now_s", [10.0, 10.51])
@pytest.mark.parametrize("heard", [True, False])
def test_a_silent_sensor_is_an_obstacle_only_when_configured_so(now_s: float, heard: bool):
    """Never heard or too old: free by default, a wall where ``silent_is_obstacle``."""
    beams = seeing(FRONT, front=4.0) if heard else from_mounts(FRONT)
    silent = now_s > 10.5 or not heard
    strict = PARAMETERS.model_copy(update={"silent_is_obstacle": True})
    assert limit(PARAMETERS, beams, AHEAD, now_s) == (AHEAD, None)
    assert limit(strict, beams, AHEAD, now_s) == ((STANDING, "front") if silent else (AHEAD, None))
    assert limit(strict, beams, BACK, now_s) == (BACK, None)


def test_a_reading_that_was_long_on_its_way_counts_from_when_it_was_measured():
    """0.24 m seen 0.2 s ago and read now: 0.185 m/s, where a fresh reading would allow 0.254.

    0.5 (sqrt(0.3^2 + 2 0.09 / 0.5) - 0.3) = 0.5 (0.6708204 - 0.3).
    """
    beams = update(PARAMETERS, from_mounts(FRONT), reading("front", 0.24, stamp_s=9.8, arrival_s=10.0))
    twist, sensor = limit(PARAMETERS, beams, AHEAD, 10.0)
    assert (twist.linear_m_s, sensor) == (pytest.approx(0.1854102, abs=1e-6), "front")


def test_a_sensor_is_silent_by_when_it_was_last_heard():
    """One whose readings take 0.6 s to arrive is not silent, however old they are; 0.5 s after the last it is."""
    strict = PARAMETERS.model_copy(update={"silent_is_obstacle": True})
    beams = update(PARAMETERS, from_mounts(FRONT), reading("front", 3.0, stamp_s=9.4, arrival_s=10.0))
    assert limit(strict, beams, AHEAD, 10.49) == (AHEAD, None)
    assert limit(strict, beams, AHEAD, 10.51) == (STANDING, "front")


def test_a_sensor_that_is_not_mounted_guards_nothing():
    """Its reading changes no beam."""
    assert update(PARAMETERS, from_mounts(FRONT), reading("rear", 0.01)) == from_mounts(FRONT)


def test_a_sensor_at_the_corner_limits_turning_into_the_wall():
    """0.2 m ahead, looking left: a left turn brings it closer at 0.2 m/rad, a right turn and driving do not."""
    beams = seeing({"left": Pose2D(0.2, 0.0, math.pi / 2)}, left=0.1)
    assert limit(PARAMETERS, beams, SPIN, 10.0) == (STANDING, "left")
    assert limit(PARAMETERS, beams, Twist2D(0.3, -1.0), 10.0) == (Twist2D(0.3, -1.0), None)


def test_between_two_obstacles_neither_is_approached():
    """A wall ahead and one behind: no driving either way, turning stays."""
    beams = seeing({"front": Pose2D(0.15), "rear": Pose2D(-0.15, 0.0, math.pi)}, front=0.1, rear=0.1)
    assert limit(PARAMETERS, beams, Twist2D(0.3, 1.0), 10.0) == (SPIN, "front")
    assert limit(PARAMETERS, beams, Twist2D(-0.3, 1.0), 10.0) == (SPIN, "rear")


def after(*ranges_m: float | None, min_range_m: float = 0.02) -> float:
    """How fast the robot may go ahead after these readings, in their order; None is one that is too near."""
    beams = from_mounts(FRONT)
    for range_m in ranges_m:
        status = RangeStatus.TOO_NEAR if range_m is None else RangeStatus.OK
        beams = update(PARAMETERS, beams, reading("front", range_m, status, min_range_m=min_range_m))
    motion, _ = limit(PARAMETERS, beams, AHEAD, 10.0)
    assert isinstance(motion, Twist2D)
    return motion.linear_m_s


@pytest.mark.parametrize("later_m", [(0.16,), (0.17,), (0.14, 0.16, 0.15, 0.17)])
def test_a_stand_does_not_end_with_the_noise_of_a_reading(later_m: tuple[float, ...]):
    """At 0.15 m it stands; up to 2 cm more, two steps of the ultrasonic, it stands on."""
    assert after(0.16, 0.15, *later_m) == 0.0


def test_a_stand_ends_when_the_way_is_free():
    """At once where the same thing moves off, as fast as it can brake: 0.5 (sqrt(0.01 + 0.12) - 0.1).

    A way that is free of a sudden, without an echo, is believed with the fifth reading that says so.
    """
    assert after(0.15, 0.16, 0.18) == pytest.approx(0.1302776, abs=1e-6)
    beams = seeing(FRONT, front=0.15)
    for number in range(5):
        assert limit(PARAMETERS, beams, AHEAD, 10.0) == (STANDING, "front"), number
        beams = update(PARAMETERS, beams, reading("front", None, RangeStatus.NO_ECHO))
    assert limit(PARAMETERS, beams, AHEAD, 10.0) == (AHEAD, None)


def test_before_a_stand_it_drives_up_to_the_stop_distance():
    """At 0.16 m, 1 cm before a stand: 0.5 (sqrt(0.01 + 0.04) - 0.1) = 0.0618 m/s. Once free it does so again."""
    assert after(0.2, 0.17, 0.16) == pytest.approx(0.0618034, abs=1e-6)
    assert after(0.15, 0.16, 0.18, 0.16) == pytest.approx(0.0618034, abs=1e-6)


@pytest.mark.parametrize("twist", [BACK, SPIN, Twist2D(-0.1, -2.0)])
def test_out_of_a_stand_it_backs_off_and_turns(twist: Twist2D):
    """Whatever does not bring it closer is as it was asked for, within the hysteresis as well."""
    beams = update(PARAMETERS, seeing(FRONT, front=0.15), reading("front", 0.16))
    assert limit(PARAMETERS, beams, twist, 10.0) == (twist, None)


def test_a_sensor_that_reads_nothing_nearer_stops_the_robot_there():
    """An infrared sensor's band begins at 0.2 m: too near, then 0.21 and 0.22 m are a stand, 0.23 m, agreed on, is not.

    Without a stand 0.21 m is a way: 0.5 (sqrt(0.01 + 0.24) - 0.1) = 0.2 m/s.
    """
    assert after(None, 0.21, 0.22, min_range_m=0.2) == 0.0
    assert after(None, 0.21, 0.23, min_range_m=0.2) == 0.0  # a thing nearer than 0.2 m does not jump
    assert after(None, 0.21, *[0.23] * 5, min_range_m=0.2) > 0.2
    assert after(0.21, min_range_m=0.2) == pytest.approx(0.2)


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
    twist, _ = limit(PARAMETERS, beams, wanted, 10.0)
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
    limited, sensor = limit(PARAMETERS, seeing(FRONT, front=0.24), wheels(8.0, 12.0), 10.0)
    assert isinstance(limited, WheelVelocities)
    assert sensor == "front"
    assert limited.rad_s == pytest.approx((8.0 * 0.5082763, 12.0 * 0.5082763))
    assert limited.twist.linear_m_s == pytest.approx(0.2541381)


@pytest.mark.parametrize("motion", [wheels(-8.0, -4.0), wheels(-5.0, 5.0), wheels(0.0, 0.0)])
def test_wheels_that_do_not_close_in_turn_as_asked(motion: WheelVelocities):
    """Backing off and turning on the spot with a wall at the bumper."""
    assert limit(PARAMETERS, seeing(FRONT, front=0.05), motion, 10.0) == (motion, None)


def test_of_two_beams_the_nearer_decides_for_wheels():
    """Both look ahead; the one that allows less is named."""
    beams = seeing({"low": Pose2D(0.15), "high": Pose2D(0.1), "spare": Pose2D(0.1)}, low=0.24, high=0.16)
    limited, sensor = limit(PARAMETERS, beams, wheels(8.0, 12.0), 10.0)
    assert sensor == "high"
    assert limited.twist.linear_m_s == pytest.approx(closing_limit_m_s(PARAMETERS, 0.16, 0.0))


SLANTED = {"nose": Pose2D(0.2, 0.05, math.atan2(3, 4))}
"""Cosine 0.8, sine 0.6: 0.8 m shorter a metre driven, 0.2 * 0.6 - 0.05 * 0.8 = 0.08 m shorter a radian turned left."""


@pytest.mark.parametrize(
    ("wanted", "allowed"),
    [
        ((0.5, 1.5), ((0.2541381 - 0.12) / 0.8, 1.5)),  # 0.40 + 0.12 m/s: the turn stays, the driving has the rest
        ((0.5, 4.0), (0.0, 0.2541381 / 0.08)),  # turning alone is 0.32 m/s: none is left for driving
        ((-0.1, 5.0), (-0.1, (0.2541381 + 0.08) / 0.08)),  # backing off takes 0.08 m/s away, which turning may have
        ((0.1, 2.0), (0.1, 2.0)),  # 0.24 m/s
        ((0.7, -2.0), ((0.2541381 + 0.16) / 0.8, -2.0)),  # turning away takes 0.16 m/s off
    ],
)  # fmt: skip
def test_a_slanted_beam_limits_driving_first_and_turning_then(
    wanted: tuple[float, float], allowed: tuple[float, float]
):
    """At 0.24 m a beam may shorten at 0.2541381 m/s; what is left is a motion, and no standstill."""
    twist, sensor = limit(PARAMETERS, seeing(SLANTED, nose=0.24), Twist2D(*wanted), 10.0)
    assert astuple(twist) == pytest.approx(allowed, abs=1e-6)
    assert sensor == (None if wanted == allowed else "nose")


@pytest.mark.parametrize(
    ("now_s", "allowed_m_s"),
    [
        (10.0, 0.2541381),
        (10.2, 0.1854102),  # 0.5 (sqrt(0.3^2 + 0.36) - 0.3) = 0.5 (0.6708204 - 0.3)
        (9.9, 0.2541381),  # a reading that comes from the future is no older than now
    ],
)
def test_an_older_reading_allows_less(now_s: float, allowed_m_s: float):
    """Its age adds to the 0.1 s in which the robot rolls on towards what was seen at 0.24 m."""
    twist, sensor = limit(PARAMETERS, seeing(FRONT, front=0.24), Twist2D(0.3, -0.7), now_s)
    assert (twist.linear_m_s, twist.angular_rad_s, sensor) == (
        pytest.approx(allowed_m_s, abs=1e-6),
        -0.7,
        "front",
    )


def test_a_motion_that_any_beam_forbids_after_two_rounds_is_none():
    """Two walls at the sensors, the robot backing and turning left: each limit gives the other beam less room.

    ``front`` shortens by v + 0.2 w, ``rear`` by -0.6 v - 0.08 w. From (-0.5, 4): (-0.5, 2.5), (-1/3, 2.5), (-1/3, 5/3);
    then ``front`` stays as it is, and ``rear`` still shortens at 0.2 - 0.1333 m/s.
    """
    mounts = {"rear": Pose2D(0.1, 0.0, math.atan2(-4, -3)), "front": Pose2D(0.2, -0.2, 0.0)}
    beams = seeing(mounts, rear=0.1, front=0.1)
    assert limit(PARAMETERS, beams, Twist2D(-0.5, 4.0), 10.0) == (STANDING, "front")
