"""The step ``imu`` on a robot that turns as it is told, with an IMU that is wrong in a way that is known."""

import math
from collections.abc import Mapping

import numpy as np
import pytest

from chefbotd.components.calibration.algorithms import wheel_views
from chefbotd.components.calibration.algorithms.imu import IMU
from chefbotd.components.calibration.algorithms.imu_fit import _reference
from chefbotd.components.calibration.algorithms.rolling import Rolling
from chefbotd.components.calibration.algorithms.scan_motion import Matched
from chefbotd.components.calibration.algorithms.step import ConfiguredRobot, Measurements, Status, StepResult
from chefbotd.components.calibration.algorithms.wheel_fit import RecordedDrive
from chefbotd.components.calibration.algorithms.wheel_views import LidarView, _drive
from chefbotd.core.events import ImuMeasured, WheelsDriven
from chefbotd.core.record import replace
from chefbotd.sensing.imu import ImuParameters
from tests.chefbotd.components.calibration.algorithms.synthetic import CONFIG, Truth, World, configured

SEEN = configured(CONFIG)
ROBOT = replace(SEEN, lidars=())
SCALE, BIAS_RAD_S, LAG_S, MOUNT_RAD = 1.012, 0.013, 0.07, 0.03
ZERO = (0.0, 0.0)


@pytest.fixture(scope="module")
def world() -> tuple[World, Measurements]:
    """A robot that has done what the step asks for."""
    done = World(SEEN, Truth())
    return done, replace(done.perform(IMU.procedure(ROBOT)), scans=())


def with_rates(world: World, measured: Measurements, bias_rad_s: float = BIAS_RAD_S) -> Measurements:
    """The IMU's raw readings of the drive, 20 Hz, and no duty where the robot stands."""
    chance, trail = np.random.default_rng(1), np.array(world.trail)
    stamps, heading = trail[:, 0], trail[:, 3]
    at_s = stamps[2:-4]
    rate = np.interp(at_s - LAG_S + 0.01, stamps, heading) - np.interp(at_s - LAG_S - 0.01, stamps, heading)
    way = np.concatenate([[0.0], np.cumsum(_ahead(trail))])
    speed = [np.interp(at_s - LAG_S + d, stamps, way) for d in (-0.05, 0.0, 0.05)]
    ahead = (speed[2] - 2 * speed[1] + speed[0]) / 0.05**2
    readings = tuple(
        ImuMeasured(
            stamp_s=float(t),
            arrival_s=float(t),
            angular_velocity_rad_s=(0.0, 0.0, float(r / 0.02 * SCALE + bias_rad_s + chance.normal(0, 0.001))),
            linear_acceleration_m_s2=(
                float(a * math.cos(MOUNT_RAD) + 0.1 + chance.normal(0, 0.04)),
                float(-a * math.sin(MOUNT_RAD) - 0.05 + chance.normal(0, 0.04)),
                9.8,
            ),
        )
        for t, r, a in zip(at_s.tolist(), rate.tolist(), ahead.tolist(), strict=True)
    )
    return replace(measured, imu=readings, driven=duties(measured))


def _ahead(trail: np.ndarray) -> np.ndarray:
    steps = np.diff(trail[:, 1:3], axis=0)
    middle = (trail[1:, 3] + trail[:-1, 3]) / 2
    return np.asarray(steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle))


def duties(measured: Measurements) -> tuple[WheelsDriven, ...]:
    """Duty wherever the wheels turn."""
    return tuple(
        WheelsDriven(
            w.stamp_s, ZERO, ZERO, ZERO, (80, 80) if any(np.abs(w.velocity_rad_s) > 1e-6) else (0, 0)
        )
        for w in measured.wheels
    )


def with_headings(world: World, measured: Measurements) -> Measurements:
    """A board's headings with two decimals of their quaternion."""
    trail = np.array(world.trail)
    readings = []
    for at_s in trail[2:-4, 0]:
        heading = float(np.interp(at_s - LAG_S, trail[:, 0], trail[:, 3])) * SCALE + 1e-4 * at_s
        z, w = round(math.sin(heading / 2), 2), round(math.cos(heading / 2), 2)
        readings.append(ImuMeasured(stamp_s=at_s, arrival_s=at_s, heading_rad=2 * math.atan2(z, w)))
    return replace(measured, imu=tuple(readings), driven=duties(measured))


def values(result: StepResult, truth: Mapping[str, float]) -> None:
    """Each estimate is the truth, within three and a half of its standard deviations."""
    assert result.status is Status.PASSED, result.reason
    estimates = {one.key: one for one in result.estimates}
    assert set(estimates) == {*truth, "odometry.fusion.gyro_scale_sigma"}
    for key, value in truth.items():
        one = estimates[key]
        assert abs(one.after - value) < 3.5 * one.sigma, (one, value)


def test_scale_bias_lag_and_mount_of_rates(world: tuple[World, Measurements]) -> None:
    """All four, of a raw IMU, against the wheels alone; the scale to 0.3 %."""
    result = IMU.fit(ROBOT, with_rates(*world))
    values(
        result,
        {
            "imu.gyro_scale": SCALE,
            "imu.gyro_bias_rad_s": BIAS_RAD_S,
            "imu.lag_s": LAG_S,
            "imu.mount_heading_rad": MOUNT_RAD,
        },
    )
    assert result.estimates[0].after == pytest.approx(SCALE, abs=3e-3)


def test_scale_and_lag_of_headings(world: tuple[World, Measurements]) -> None:
    """A board that sends its orientation only: its heading's scale and its lag, to 10 ms."""
    result = IMU.fit(ROBOT, with_headings(*world))
    values(result, {"imu.gyro_scale": SCALE, "imu.lag_s": LAG_S})
    assert result.estimates[1].after == pytest.approx(LAG_S, abs=0.01)


def test_a_second_run_finds_no_more(world: tuple[World, Measurements]) -> None:
    """Measured with the right parameters in force, the rates are corrected: the fit returns the same parameters."""
    imu = ImuParameters(gyro_scale=SCALE, gyro_bias_rad_s=BIAS_RAD_S, lag_s=LAG_S)
    measured = with_rates(*world)
    corrected = tuple(
        replace(m, angular_velocity_rad_s=(0.0, 0.0, (m.angular_velocity_rad_s[2] - BIAS_RAD_S) / SCALE))
        for m in measured.imu
        if m.angular_velocity_rad_s is not None
    )
    result = IMU.fit(replace(ROBOT, imu=imu), replace(measured, imu=corrected))
    estimates = {one.key: one for one in result.estimates}
    assert estimates["imu.gyro_scale"].after == pytest.approx(SCALE, abs=3e-3)
    assert estimates["imu.gyro_bias_rad_s"].after == pytest.approx(BIAS_RAD_S, abs=3e-4)


def test_a_robot_that_is_turned_at_rest_is_refused_or_not_at_rest(world: tuple[World, Measurements]) -> None:
    """In the second half of its rests it is turned by 44 mrad/s, slowly and evenly: two biases are none."""
    done, measured = world
    imu = with_rates(done, measured)
    middle_s = imu.imu[len(imu.imu) // 2].stamp_s
    turned = tuple(
        m
        if m.stamp_s < middle_s or m.angular_velocity_rad_s is None
        else replace(m, angular_velocity_rad_s=(0.0, 0.0, m.angular_velocity_rad_s[2] + 0.044))
        for m in imu.imu
    )
    result = IMU.fit(ROBOT, replace(imu, imu=turned))
    assert result.status is Status.REFUSED
    assert "at rest" in result.reason


def test_motors_with_duty_are_no_rest(world: tuple[World, Measurements]) -> None:
    """The wheels stand, and the motors push: nothing is known of the bias."""
    imu = with_rates(*world)
    pushing = tuple(replace(one, duty=(30, -30)) for one in imu.driven)
    result = IMU.fit(ROBOT, replace(imu, driven=pushing))
    assert (result.status, result.estimates) == (Status.NOT_ENOUGH, ())
    assert "rested for 0.0 s" in result.reason


def test_an_imu_that_turns_the_other_way_is_refused(world: tuple[World, Measurements]) -> None:
    """Wheels and IMU with different signs: no negative scale."""
    imu = with_headings(*world)
    wrong = tuple(replace(m, heading_rad=-(m.heading_rad or 0.0)) for m in imu.imu)
    result = IMU.fit(ROBOT, replace(imu, imu=wrong))
    assert (result.status, result.estimates) == (Status.REFUSED, ())
    assert "the other way" in result.reason


def test_noise_is_no_result(world: tuple[World, Measurements]) -> None:
    """Headings at random are refused, and so is an IMU that stays at 0."""
    chance = np.random.default_rng(2)
    imu = with_headings(*world)
    noise = tuple(replace(m, heading_rad=float(chance.uniform(-3, 3))) for m in imu.imu)
    still = tuple(replace(m, heading_rad=0.0) for m in imu.imu)
    for readings in (noise, still):
        result = IMU.fit(ROBOT, replace(imu, imu=readings))
        assert (result.status, result.estimates) == (Status.REFUSED, ())


def test_what_is_missing_is_named(world: tuple[World, Measurements]) -> None:
    """No wheels, no IMU, no turn."""
    imu = with_headings(*world)
    for lacking, reason in (
        (replace(imu, wheels=()), "wheels"),
        (replace(imu, imu=()), "IMU"),
        (replace(imu, wheels=imu.wheels[:100]), "turned by"),
    ):
        result = IMU.fit(ROBOT, lacking)
        assert (result.status, result.estimates) == (Status.NOT_ENOUGH, ())
        assert reason in result.reason
    robot: ConfiguredRobot = replace(ROBOT, imu=None)
    assert IMU.missing(robot) == "the robot has no IMU"


def test_a_lidar_puts_right_what_wheels_say_of_a_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each turn of the reference is the one that the lidar saw, in whatever order the motions come."""
    rolled = Rolling(np.arange(5.0), np.zeros(5), np.arange(5.0) * SEEN.chassis.effective_track_m)
    motion = np.array([[0.0, 0.0, 0.9], [0.0, 0.0, 1.0], [0.0, 0.0, 1.1], [0.0, 0.0, 1.2]])[::-1]
    rows = np.arange(4)[::-1]
    drive = RecordedDrive(
        "", "", np.zeros(4), np.ones(4), rows, rows + 1, motion, np.ones((4, 3)), np.ones(4)
    )
    matched = Matched(np.zeros((5, 3)), np.ones((5, 3)), np.ones(5, bool), 0.01)
    monkeypatch.setattr(
        wheel_views, "lidar_view", lambda *given: LidarView(drive, matched, is_stop_and_go=True)
    )
    seen = Measurements(scans=(World(SEEN, Truth())._look(),))
    heading_rad, by_lidar = _reference(SEEN, seen, rolled)
    assert by_lidar
    assert heading_rad == pytest.approx([0.0, 0.9, 1.9, 3.0, 4.2])


def test_every_motion_from_stop_to_stop_counts() -> None:
    """Of four stops there are three motions, the first one too."""
    rolled = Rolling(np.arange(4.0), np.arange(4.0), np.arange(4.0))
    seen = Matched(np.zeros((4, 3)), np.ones((4, 3)), np.ones(4, bool), 0.01)
    drive = _drive(rolled, np.arange(4), seen, is_stop_and_go=True)
    assert list(zip(drive.first.tolist(), drive.last.tolist(), strict=True)) == [(0, 1), (1, 2), (2, 3)]
