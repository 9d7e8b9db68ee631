"""Odometry by wheels and IMU: what it believes, and what it says of sensors that lie."""

import math
import random
from collections.abc import Callable

import pytest

from chefbotd.core.events.robot import ImuMeasured, ImuTrust, MotionAnomaly, WheelsDriven
from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.motion.fused_odometry import FusedOdometry
from chefbotd.motion.odometry import FusionParameters

TRACK_M, CYCLE_S = 0.3, 0.05
ZERO = (0.0, 0.0)


def rate(stamp_s: float, rad_s: float) -> ImuMeasured:
    """A gyroscope's rate about z."""
    return ImuMeasured(stamp_s=stamp_s, arrival_s=stamp_s, angular_velocity_rad_s=(0.0, 0.0, rad_s))


def heading(stamp_s: float, rad: float) -> ImuMeasured:
    """A board's own heading."""
    orientation = 0.0, 0.0, math.sin(rad / 2), math.cos(rad / 2)
    return ImuMeasured(
        stamp_s=stamp_s, arrival_s=stamp_s, orientation=orientation, heading_rad=wrap_angle(rad)
    )


class Drive:
    """A robot that drives by its own wheels; ``imu`` makes a reading of the time, the true heading and the true rate."""

    def __init__(
        self,
        imu: Callable[[float, float, float], ImuMeasured | None],
        *,
        skid: bool = False,
        lag_s: float = 0.0,
    ) -> None:
        self.imu, self.true_rad, self.now_s = imu, 0.0, 100.0
        self.odometry = FusedOdometry(
            FusionParameters(),
            track_width_m=TRACK_M,
            travel_variance=1e-6,
            turn_variance=1e-5,
            is_skid_steer=skid,
            imu_lag_s=lag_s,
        )

    def go(
        self, seconds: float, speed_m_s: float, rad_s: float, *, by_wheels_rad_s: float | None = None
    ) -> None:
        """Drive; ``by_wheels_rad_s`` is what the wheels make of the rate, where that is not true."""
        wheels_rad_s = rad_s if by_wheels_rad_s is None else by_wheels_rad_s
        duty = (80, 80) if speed_m_s or wheels_rad_s else (0, 0)
        for _ in range(round(seconds / CYCLE_S)):
            self.now_s += CYCLE_S
            self.true_rad += rad_s * CYCLE_S
            reading = self.imu(self.now_s, self.true_rad, rad_s)
            if reading is not None:
                self.odometry.add_imu(reading)
            self.odometry.add_driven(WheelsDriven(self.now_s, ZERO, ZERO, ZERO, duty))
            half_m_s = wheels_rad_s * TRACK_M / 2
            self.odometry.add_travel(
                self.now_s, (speed_m_s - half_m_s) * CYCLE_S, (speed_m_s + half_m_s) * CYCLE_S
            )

    @property
    def off_rad(self) -> float:
        """How far the estimated heading is from the true one."""
        return wrap_angle(self.odometry.estimate.heading_rad - self.true_rad)


def by_rate(now_s: float, _: float, rad_s: float) -> ImuMeasured:
    """A perfect gyroscope, but for the noise that a real one has."""
    return rate(now_s, rad_s + 1e-4 * math.sin(now_s * 37))


def by_heading(now_s: float, true_rad: float, _: float) -> ImuMeasured:
    """A perfect heading that began at 1 rad."""
    return heading(now_s, true_rad + 1.0)


@pytest.mark.parametrize("imu", [by_rate, by_heading])
def test_the_imu_tells_the_turn_and_the_wheels_the_travel(
    imu: Callable[[float, float, float], ImuMeasured],
) -> None:
    """Wheels that show 3 % too much of a turn: after ten radians the heading is off by less than a quarter of that."""
    drive = Drive(imu)
    drive.go(2.0, 0.0, 0.0)
    for _ in range(10):
        drive.go(2.0, 0.2, 0.5, by_wheels_rad_s=0.515)
    drive.go(1.0, 0.0, 0.0)
    assert abs(drive.off_rad) < 0.3 / 4
    assert drive.odometry.imu_trust is ImuTrust.OK
    assert drive.odometry.anomaly is MotionAnomaly.NONE


def test_a_robot_at_rest_shows_the_bias() -> None:
    """Five seconds at rest with 10 mrad/s of bias: it is known to 0.5 mrad/s, and the robot has not turned."""
    drive = Drive(lambda now_s, _, rad_s: by_rate(now_s, 0.0, rad_s + 0.01))
    drive.go(5.0, 0.0, 0.0)
    assert drive.odometry.estimate.bias_rad_s == pytest.approx(0.01, abs=5e-4)
    drive.go(10.0, 0.2, 0.0)
    assert abs(drive.off_rad) < 0.01


def test_wheels_that_stand_are_no_rest_while_the_motors_have_duty() -> None:
    """A skid steer turns at 44 mrad/s while its wheels stand, and its motors push: that is a turn, and no bias."""
    drive = Drive(by_rate, skid=True)
    for _ in range(100):
        drive.now_s += CYCLE_S
        drive.true_rad += 0.044 * CYCLE_S
        drive.odometry.add_imu(by_rate(drive.now_s, 0.0, 0.044))
        drive.odometry.add_driven(WheelsDriven(drive.now_s, ZERO, ZERO, ZERO, (40, -40)))
        drive.odometry.add_travel(drive.now_s, 0.0, 0.0)
    assert drive.odometry.estimate.heading_rad == pytest.approx(drive.true_rad, abs=0.01)
    assert abs(drive.odometry.estimate.bias_rad_s) < 1e-3


def test_a_constant_lag_is_found() -> None:
    """Headings that come 0.2 s late: after a few turns the lag is known to 30 ms, and the heading is right."""
    past: list[tuple[float, float]] = []

    def late(now_s: float, true_rad: float, _: float) -> ImuMeasured:
        past.append((now_s, true_rad))
        return heading(now_s, past[max(len(past) - 5, 0)][1] + 1.0)

    drive = Drive(late)
    drive.go(1.0, 0.0, 0.0)
    for k in range(6):
        drive.go(1.0, 0.2, 0.8 if k % 2 else -0.8)
    assert drive.odometry.lag_s == pytest.approx(0.2, abs=0.03)
    drive.go(0.5, 0.2, 0.0)
    assert abs(drive.off_rad) < 0.03


def test_a_lag_that_is_known_is_taken_off() -> None:
    """The same with the lag configured: nothing is left to be found."""
    past: list[float] = []

    def late(now_s: float, true_rad: float, _: float) -> ImuMeasured:
        past.append(true_rad)
        return heading(now_s, past[max(len(past) - 5, 0)] + 1.0)

    drive = Drive(late, lag_s=0.2)
    drive.go(1.0, 0.0, 0.0)
    for k in range(6):
        drive.go(1.0, 0.2, 0.8 if k % 2 else -0.8)
    assert drive.odometry.lag_s == 0.0
    assert abs(drive.off_rad) < 0.01


def test_outliers_are_refused_and_said() -> None:
    """Every twelfth heading is off by a radian: the estimate is not, and the IMU is said to have outliers."""
    count = iter(range(10_000))

    def lying(now_s: float, true_rad: float, _: float) -> ImuMeasured:
        return heading(now_s, true_rad + (1.0 if next(count) % 12 == 11 else 0.0))

    drive = Drive(lying)
    for k in range(10):
        drive.go(2.0, 0.2, 0.4 if k % 2 else -0.4)
    assert abs(drive.off_rad) < 0.02
    assert drive.odometry.imu_trust is ImuTrust.OUTLIERS


def test_a_good_sensor_is_not_shut_out() -> None:
    """The robot is turned by 0.5 rad while its IMU is silent: a second later the IMU's heading is believed."""
    silent = False
    drive = Drive(lambda now_s, true_rad, _: None if silent else by_heading(now_s, true_rad, 0.0))
    drive.go(3.0, 0.2, 0.2)
    silent = True
    drive.go(0.25, 0.2, 2.0, by_wheels_rad_s=0.0)
    silent = False
    drive.go(1.0, 0.2, 0.2)
    assert abs(drive.off_rad) < 0.05


def test_a_frozen_imu_is_said_and_not_used() -> None:
    """An IMU whose heading stays, however the wheels turn: the wheels' turn counts."""
    frozen = False
    drive = Drive(lambda now_s, true_rad, _: heading(now_s, 0.5 if frozen else true_rad))
    drive.go(2.0, 0.2, 0.25)
    frozen = True
    drive.go(1.5, 0.2, 0.0)
    assert drive.odometry.imu_trust is not ImuTrust.FROZEN  # it may: the robot drives straight
    drive.go(3.0, 0.2, 0.5)
    assert drive.odometry.imu_trust is ImuTrust.FROZEN
    assert abs(drive.off_rad) < 0.35


@pytest.mark.parametrize("every", [8, 20, 100])
def test_a_frozen_imu_that_once_moves_a_little_is_still_frozen(every: int) -> None:
    """One reading in so many is another by a hundredth: that ends nothing. Of 6 rad the first 0.6 are lost at most."""
    count, frozen = iter(range(100_000)), False

    def stuck(now_s: float, true_rad: float, _: float) -> ImuMeasured:
        if not frozen:
            return heading(now_s, true_rad)
        return heading(now_s, 0.5 + 0.01 * (next(count) % every == every - 1))

    drive = Drive(stuck)
    drive.go(2.0, 0.2, 0.25)
    frozen = True
    drive.go(2.0, 0.2, 0.5)
    for _ in range(20):
        drive.go(0.5, 0.2, 0.5)
        assert drive.odometry.imu_trust is ImuTrust.FROZEN
    assert abs(drive.off_rad) < 0.65


def test_an_imu_that_wakes_up_is_used_again_with_its_third_reading() -> None:
    """Frozen for 3 s of turning; then each reading is another: it is not frozen any more 0.15 s later."""
    frozen = True
    drive = Drive(lambda now_s, true_rad, _: heading(now_s, 0.5 if frozen else true_rad))
    drive.go(3.0, 0.2, 0.5)
    assert drive.odometry.imu_trust is ImuTrust.FROZEN
    frozen = False
    drive.go(0.15, 0.2, 0.5)
    assert drive.odometry.imu_trust is not ImuTrust.FROZEN


def test_an_imu_of_coarse_readings_is_not_frozen_however_slowly_the_robot_turns() -> None:
    """A hundredth of a radian a step at 0.02 rad/s repeats each reading many times, for half a turn."""
    drive = Drive(lambda now_s, true_rad, _: heading(now_s, round(true_rad, 2)))
    for _ in range(50):
        drive.go(3.0, 0.1, 0.02)
        assert drive.odometry.imu_trust is not ImuTrust.FROZEN


def test_an_imu_that_is_lost_is_said() -> None:
    """After half a second without a word the IMU is lost, and the wheels go on alone."""
    lost = False
    drive = Drive(lambda now_s, true_rad, _: None if lost else by_heading(now_s, true_rad, 0.0))
    drive.go(2.0, 0.2, 0.2)
    lost = True
    drive.go(1.0, 0.2, 0.2)
    assert drive.odometry.imu_trust is ImuTrust.LOST
    assert abs(drive.off_rad) < 0.01


def test_after_a_silence_of_the_board_headings_are_dropped_until_its_queue_is_empty() -> None:
    """The board is silent for a second: the headings that follow are old, until cycles last as long as usual."""
    drive = Drive(by_heading)
    drive.go(3.0, 0.2, 0.4)
    old_rad, odometry = drive.true_rad, drive.odometry
    drive.now_s += 1.0
    drive.true_rad += 0.4
    odometry.add_travel(drive.now_s, 0.14, 0.26)
    for k in range(20):  # the queue is read: a sample a cycle, and the cycles are short
        drive.now_s += 0.02
        drive.true_rad += 0.008
        odometry.add_imu(heading(drive.now_s, old_rad + 1.0 + k * 0.02))
        odometry.add_travel(drive.now_s, 0.0028, 0.0052)
        assert odometry.imu_trust is ImuTrust.LATE
    assert abs(drive.off_rad) < 0.01
    drive.go(1.0, 0.2, 0.4)
    assert odometry.imu_trust is ImuTrust.OK


@pytest.mark.parametrize("imu", [by_rate, by_heading])
def test_a_slipping_wheel_is_said_and_makes_the_pose_less_certain(
    imu: Callable[[float, float, float], ImuMeasured],
) -> None:
    """The right wheel loses all of 0.2 m/s: the wheels show straight on, the robot turns right; seen within 0.3 s."""
    drive = Drive(imu)
    drive.go(3.0, 0.2, 0.0)
    before = drive.odometry.estimate.pose_covariance
    drive.go(0.3, 0.2, -0.2 / TRACK_M, by_wheels_rad_s=0.0)
    assert drive.odometry.anomaly is MotionAnomaly.SLIP
    drive.go(1.0, 0.2, 0.0)
    assert drive.odometry.anomaly is MotionAnomaly.NONE
    assert drive.odometry.estimate.pose_covariance.xx > 3 * before.xx
    assert abs(drive.off_rad) < 0.05


def test_a_robot_that_is_pushed_round_is_said() -> None:
    """Turned by hand at 1 rad/s while its wheels stand: it was pushed, and its heading follows."""
    drive = Drive(by_heading)
    drive.go(3.0, 0.2, 0.1)
    drive.go(1.0, 0.0, 0.0)
    drive.go(0.6, 0.0, 1.0, by_wheels_rad_s=0.0)
    assert drive.odometry.anomaly is MotionAnomaly.PUSHED
    drive.go(1.0, 0.0, 0.0)
    assert abs(drive.off_rad) < 0.05


def test_a_robot_that_is_tilted_is_lifted() -> None:
    """Rolled by 30 degrees, no ChefBot stands on its wheels."""
    drive = Drive(by_heading)
    drive.go(1.0, 0.1, 0.0)
    tilted = ImuMeasured(
        stamp_s=drive.now_s, arrival_s=drive.now_s, orientation=(math.sin(0.26), 0.0, 0.0, math.cos(0.26))
    )
    drive.odometry.add_imu(tilted)
    assert drive.odometry.anomaly is MotionAnomaly.LIFTED


def test_a_wheel_that_is_driven_and_stands_is_stalled() -> None:
    """Told to turn at 4 rad/s with duty, and still for half a second."""
    odometry = Drive(by_rate).odometry
    for k in range(12):
        odometry.add_driven(WheelsDriven(1 + k * CYCLE_S, ZERO, (4.0, 0.0), (4.0, 4.0), (90, 90)))
        odometry.add_travel(1 + k * CYCLE_S, 0.01, 0.0)
    assert odometry.anomaly is MotionAnomaly.STALLED


def test_a_board_that_restarts_begins_its_heading_anew() -> None:
    """Its heading is 0 again: the robot has not turned."""
    drive = Drive(by_heading)
    drive.go(3.0, 0.2, 0.3)
    drive.odometry.forget_imu()
    turned_rad = drive.true_rad
    drive.imu = lambda now_s, true_rad, _: heading(now_s, true_rad - turned_rad)
    drive.go(2.0, 0.2, 0.3)
    assert abs(drive.off_rad) < 0.01


def test_a_declared_pose_is_where_it_goes_on() -> None:
    """Placed at (1, 2) and 90 degrees, a metre ahead is (1, 3)."""
    drive = Drive(by_heading)
    drive.go(2.0, 0.2, 0.3)
    drive.odometry.move_to(Pose2D(1.0, 2.0, math.pi / 2))
    drive.go(5.0, 0.2, 0.0)
    estimate = drive.odometry.estimate
    assert (estimate.x_m, estimate.y_m) == pytest.approx((1.0, 3.0), abs=0.02)


def test_its_state_goes_on_elsewhere() -> None:
    """Two that go on from the same state say the same, bit for bit."""
    chance = random.Random(1)
    drive = Drive(lambda now_s, true_rad, _: heading(now_s, round(true_rad + chance.gauss(0, 0.01), 2)))
    drive.go(5.0, 0.2, 0.3)
    other = Drive(drive.imu)
    other.odometry.restore(drive.odometry.state())
    assert other.odometry.estimate == drive.odometry.estimate


def mirrored(stamp_s: float, rad: float, rad_s: float) -> ImuMeasured:
    """A board's heading that turns the other way, as one mounted with its z axis down."""
    return heading(stamp_s, -rad)


def w_first(stamp_s: float, rad: float, rad_s: float) -> ImuMeasured:
    """A quaternion printed as w x y z and read as x y z w: no heading comes of it."""
    orientation = math.cos(rad / 2), 0.0, 0.0, math.sin(rad / 2)
    x, y, z, w = orientation
    read_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return ImuMeasured(stamp_s=stamp_s, arrival_s=stamp_s, orientation=orientation, heading_rad=read_rad)


@pytest.mark.parametrize(
    ("imu", "word"),
    [
        (mirrored, "its z axis points down"),
        (lambda at_s, rad, rad_s: rate(at_s, -rad_s), "its z axis points down"),
        (w_first, "w x y z"),
    ],
)
def test_an_imu_that_never_agrees_with_the_wheels_is_left_out_and_named(
    imu: Callable[[float, float, float], ImuMeasured], word: str
) -> None:
    """Three rad at 0.5 rad/s: the pose is never mirrored for long, and the wheels' in the end."""
    drive = Drive(imu)
    drive.go(1.0, 0.0, 0.0)
    drive.go(6.0, 0.1, 0.5)
    assert drive.odometry.imu_trust is ImuTrust.DISAGREES
    assert word in drive.odometry.imu_reason
    estimate = drive.odometry.estimate
    assert wrap_angle(estimate.heading_rad - 3.0) == pytest.approx(0.0, abs=0.05)
    assert (estimate.x_m, estimate.y_m) == pytest.approx(
        (0.2 * math.sin(3.0), 0.2 * (1 - math.cos(3.0))), abs=0.03
    )
    assert math.sqrt(estimate.pose_covariance.row_by_row[8]) > 0.01


def test_an_imu_of_another_scale_is_left_out_and_named() -> None:
    """It shows twice of every turn."""
    drive = Drive(lambda at_s, rad, rad_s: heading(at_s, 2 * rad))
    for rad_s in (0.5, -0.6, 0.7, -0.5):
        drive.go(4.0, 0.1, rad_s)
    assert drive.odometry.imu_trust is ImuTrust.DISAGREES
    assert "scale" in drive.odometry.imu_reason


def test_a_blocked_robot_whose_wheels_spin_does_not_lose_its_imu() -> None:
    """The wheels turn by twenty rad, the robot does not: its heading stays within 0.3 rad."""
    drive = Drive(lambda at_s, rad, rad_s: heading(at_s, rad + 0.002 * math.sin(37 * at_s)))
    drive.go(2.0, 0.1, 0.5)
    drive.go(20.0, 0.0, 0.0, by_wheels_rad_s=1.0)
    assert drive.odometry.imu_trust is not ImuTrust.DISAGREES
    assert wrap_angle(drive.odometry.estimate.heading_rad - 1.0) == pytest.approx(0.0, abs=0.3)


@pytest.mark.parametrize("drift_rad_s", [0.005, 0.052, -0.052, 0.064])
def test_a_heading_that_settles_turns_no_robot_that_rests(drift_rad_s: float) -> None:
    """0.3 to 3.7 degrees a second for 8 s: the heading holds, and the drift is learned."""
    drive = Drive(lambda at_s, rad, rad_s: heading(at_s, rad + drift_rad_s * (at_s - 100.0)))
    drive.go(8.0, 0.0, 0.0)
    assert drive.odometry.estimate.heading_rad == pytest.approx(0.0, abs=0.02)
    assert drive.odometry.estimate.bias_rad_s == pytest.approx(drift_rad_s, abs=0.01)
    drive.go(4.0, 0.1, 0.5)
    assert drive.odometry.estimate.heading_rad == pytest.approx(2.0, abs=0.08)


def test_a_robot_that_is_turned_by_hand_at_rest_turns() -> None:
    """Its wheels stand, and the IMU shows 0.3 rad/s for 3 s."""
    drive = Drive(lambda at_s, rad, rad_s: heading(at_s, rad))
    drive.go(3.0, 0.0, 0.0)
    drive.go(3.0, 0.0, 0.3, by_wheels_rad_s=0.0)
    assert drive.odometry.estimate.heading_rad == pytest.approx(0.9, abs=0.1)
