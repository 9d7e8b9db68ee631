"""What the sensors make of the truth."""

import math

import numpy as np
import pytest

from chefbotd.components.simulation.parameters.simulation import SimImuParameters, SimUltrasonicParameters
from chefbotd.components.simulation.parameters.true import TrueImu
from chefbotd.components.simulation.sensors import Imu, ImuMotion, Ultrasonic, UltrasonicMount
from chefbotd.components.simulation.world import World
from chefbotd.core.geometry import Pose2D

EAST_WALL = World([(2.0, -5.0, 2.0, 5.0)])
EXACT_IMU = SimImuParameters(
    heading_drift_rad_s=0,
    heading_noise_rad=0,
    gyro_bias_rad_s=0,
    gyro_noise_rad_s=0,
    acceleration_noise_m_s2=0,
)
AT_REST = ImuMotion(0.0, 0.0, 0.0, 0.0)


def chance() -> np.random.Generator:
    """A generator that is the same in every test."""
    return np.random.default_rng(7)


def exact(world: World, mount_x_m: float = 0.0, cone_rad: float = 0.26, **changes: float) -> Ultrasonic:
    """An ultrasonic sensor at the axle without noise."""
    parameters = SimUltrasonicParameters.model_validate({"noise_m": 0, **changes})
    return Ultrasonic(parameters, UltrasonicMount(Pose2D(mount_x_m), cone_rad), world)


def test_the_nearest_ray_is_the_echo() -> None:
    """Turned 30 degrees from a wall 2 m away, a cone of 60 degrees still meets it squarely: 2 m."""
    sensor = exact(EAST_WALL, cone_rad=math.pi / 3)
    assert sensor.distance_m(Pose2D(0, 0, math.pi / 6), chance()) == pytest.approx(2.0)


def test_a_single_ray_looks_straight_ahead() -> None:
    """One ray, turned 60 degrees from the wall 2 m away, runs 2 / cos(60) = 4 m."""
    sensor = exact(EAST_WALL, rays=1, max_range_m=5)
    assert sensor.distance_m(Pose2D(0, 0, math.pi / 3), chance()) == pytest.approx(4.0)


def test_the_sensor_sits_ahead_of_the_axle() -> None:
    """Mounted 0.15 m ahead it is that much nearer to what is ahead, whichever way the robot points."""
    sensor = exact(World([(-2.0, -5.0, -2.0, 5.0)]), mount_x_m=0.15)
    assert sensor.distance_m(Pose2D(0, 0, math.pi), chance()) == pytest.approx(1.85)


def test_beyond_its_range_nothing_echoes() -> None:
    """A wall at 2 m is not heard by a sensor that reaches 1.9 m, nor is empty space by any."""
    assert exact(EAST_WALL, max_range_m=1.9).distance_m(Pose2D(), chance()) is None
    assert exact(EAST_WALL).distance_m(Pose2D(0, 0, math.pi), chance()) is None


def test_too_near_reads_as_the_least_range() -> None:
    """At 5 mm the sensor says its minimum, 2 cm."""
    assert exact(EAST_WALL).distance_m(Pose2D(1.995), chance()) == 0.02


def test_echoes_are_lost_as_often_as_asked() -> None:
    """With half of the echoes lost, 400 pings lose 200, give or take 4 standard deviations (40)."""
    sensor, luck = exact(EAST_WALL, lost_echo_share=0.5), chance()
    lost = sum(sensor.distance_m(Pose2D(), luck) is None for _ in range(400))
    assert 160 <= lost <= 240


def test_heading_counts_from_boot() -> None:
    """Booted at 0.5 rad and now at 0.5 + pi/2, the quaternion is a left turn by 90 degrees."""
    imu = Imu(EXACT_IMU, booted_s=0, booted=ImuMotion(0.5, 0.0, 0.0, 0.0))
    turned = ImuMotion(0.5 + math.pi / 2, 0.0, 0.0, 0.0)
    half = math.sqrt(0.5)
    assert imu.orientation(turned, 10.0, chance()) == pytest.approx((0, 0, half, half))


def test_heading_drifts_from_boot_and_is_biased() -> None:
    """0.01 rad/s for 100 s since boot and a bias of 0.2 rad are 1.2 rad of error."""
    parameters = EXACT_IMU.model_copy(update={"heading_drift_rad_s": 0.01, "heading_bias_rad": 0.2})
    quaternion = Imu(parameters, booted_s=50, booted=AT_REST).orientation(AT_REST, 150.0, chance())
    assert quaternion == pytest.approx((0, 0, math.sin(0.6), math.cos(0.6)))


def test_raw_counts_are_those_of_the_data_sheet() -> None:
    """At rest the IMU feels 1 g upward = 16384; 2 rad/s are 114.6 degrees/s = 15012 counts."""
    turning = ImuMotion(0.0, 2.0, 9.80665 / 2, -9.80665 / 4)
    acceleration, rate = Imu(EXACT_IMU, 0, AT_REST).counts(turning, chance())
    assert acceleration == (8192, -4096, 16384)
    assert rate == (0, 0, round(math.degrees(2.0) * 131))


def test_raw_counts_saturate() -> None:
    """Beyond int16 the sensor shows its ends."""
    wild = ImuMotion(0.0, 100.0, -1000.0, 0.0)
    acceleration, rate = Imu(EXACT_IMU, 0, AT_REST).counts(wild, chance())
    assert acceleration[0] == -32768
    assert rate[2] == 32767


def test_an_ultrasonic_sensor_reads_by_its_offset_too_far() -> None:
    """A wall at 2 m is heard at 1.985 m by a sensor that is off by -15 mm."""
    sensor = Ultrasonic(
        SimUltrasonicParameters(noise_m=0), UltrasonicMount(Pose2D(), 0.26), EAST_WALL, offset_m=-0.015
    )
    assert sensor.distance_m(Pose2D(), chance()) == pytest.approx(1.985)


def test_a_gyroscopes_scale_grows_with_the_turn() -> None:
    """2 % too much of two whole turns are 0.08 pi; 2 rad/s are 15012 * 1.02 counts."""
    imu = Imu(EXACT_IMU, 0, AT_REST, TrueImu(gyro_scale=1.02))
    turned = ImuMotion(0.0, 2.0, 0.0, 0.0, turned_rad=4 * math.pi)
    half = 0.04 * math.pi
    assert imu.orientation(turned, 1.0, chance()) == pytest.approx((0, 0, math.sin(half), math.cos(half)))
    assert imu.counts(turned, chance())[1][2] == round(math.degrees(2.04) * 131)


def test_a_tilted_imu_feels_gravity_along_its_axes() -> None:
    """Nose down by 30 degrees its x axis feels -1 g * sin(30), its z axis 1 g * cos(30) and cos(30) of a turn."""
    imu = Imu(EXACT_IMU, 0, AT_REST, TrueImu(mount_pitch_rad=math.pi / 6))
    acceleration, rate = imu.counts(ImuMotion(0.0, 1.0, 0.0, 0.0), chance())
    assert acceleration == (-8192, 0, round(16384 * math.cos(math.pi / 6)))
    assert rate[2] == round(math.degrees(math.cos(math.pi / 6)) * 131)
    assert imu.orientation(AT_REST, 1.0, chance()) == pytest.approx(
        (0, math.sin(math.pi / 12), 0, math.cos(math.pi / 12))
    )


def test_an_imu_that_is_turned_and_biased_feels_in_its_own_axes() -> None:
    """Turned left by 90 degrees it feels 1 m/s2 ahead along -y, and 0.5 m/s2 of bias along x."""
    true = TrueImu(mount_heading_rad=math.pi / 2, acceleration_bias_m_s2=(0.5, 0.0, 0.0))
    acceleration, _ = Imu(EXACT_IMU, 0, AT_REST, true).counts(ImuMotion(0.0, 0.0, 1.0, 0.0), chance())
    assert acceleration == (round(0.5 / 9.80665 * 16384), round(-1 / 9.80665 * 16384), 16384)


def test_echoes_are_lost_in_bursts_and_by_turns() -> None:
    """Every third is lost; and once one is lost by chance, the burst's others follow it."""
    every = exact(EAST_WALL, lost_echo_every=3)
    luck = chance()
    assert [every.distance_m(Pose2D(), luck) is None for _ in range(6)] == [False, False, True] * 2
    burst = exact(EAST_WALL, lost_echo_share=0.1, lost_echo_burst=4)
    lost = "".join("x" if burst.distance_m(Pose2D(), luck) is None else " " for _ in range(400))
    assert lost.split()
    assert all(len(run) >= 4 for run in lost.rstrip("x").split())


def test_a_far_echo_is_farther_than_the_wall_and_within_the_range() -> None:
    """Half of the readings, from what is 2 m away up to 4 m."""
    far = exact(EAST_WALL, far_echo_share=0.5)
    luck = chance()
    readings = [far.distance_m(Pose2D(), luck) or 0.0 for _ in range(200)]
    assert 60 < sum(reading > 2.01 for reading in readings) < 140
    assert all(1.99 <= reading <= 4.0 for reading in readings)
