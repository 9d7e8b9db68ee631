"""Robots drawn at random within their bounds."""

import math

import pytest

from chefbotd.components.simulation.parameters.true import (
    BOUNDS,
    Drawn,
    TrueImu,
    TrueLidar,
    TrueParameters,
    TrueWheel,
    resolve_true,
)

CONFIGURED = TrueParameters(
    track_width_m=0.3,
    wheels={"left_wheel": TrueWheel(radius_m=0.045), "right_wheel": TrueWheel(radius_m=0.045)},
    imu=TrueImu(mount_heading_rad=0.1),
    lidars={"lidar": TrueLidar(mount_x_m=0.05, mount_y_m=0.0, mount_yaw_rad=1.0)},
    divider_ratio=5.0,
)


def robot(seed: int, drawn: Drawn = Drawn.IMPERFECT, **given: object) -> TrueParameters:
    """The robot of a seed."""
    return resolve_true(TrueParameters.model_validate({"drawn": drawn, **given}), CONFIGURED, seed)


def test_a_robot_is_as_configured_unless_told_otherwise() -> None:
    """Nothing given, nothing drawn: every value is the configured one."""
    assert resolve_true(TrueParameters(), CONFIGURED, 1) == CONFIGURED


def test_a_seed_draws_the_same_robot_again() -> None:
    """The robot's own seed comes before the simulation's."""
    assert robot(3) == robot(3) != robot(4)
    own = resolve_true(TrueParameters(drawn=Drawn.IMPERFECT, seed=3), CONFIGURED, 4)
    assert own == robot(3)


def test_a_given_value_stays_among_drawn_ones() -> None:
    """A gain of 0.8 and a track of 0.31 are as given; the same wheel's radius is drawn as without them."""
    wheels = {"left_wheel": {"forward": {"gain": 0.8}}}
    given = robot(3, wheels=wheels, track_width_m=0.31)
    assert (given.wheels["left_wheel"].forward.gain, given.track_width_m) == (0.8, 0.31)
    assert given.wheels["left_wheel"].radius_m == robot(3).wheels["left_wheel"].radius_m


@pytest.mark.parametrize("drawn", [Drawn.PLAUSIBLE, Drawn.IMPERFECT])
def test_drawn_values_fill_their_bounds_to_both_sides(drawn: Drawn) -> None:
    """Of 200 seeds no value is out of bounds, and the largest and the least are beyond nine tenths of them."""
    bounds, robots = BOUNDS[drawn], [robot(seed, drawn) for seed in range(200)]
    lefts = [each.wheels["left_wheel"] for each in robots]
    fills([left.radius_m / 0.045 - 1 for left in lefts], bounds.radius_share)
    fills([left.reverse.gain - 1 for left in lefts], bounds.gain_share)
    fills([left.forward.dead_zone - 1 for left in lefts], bounds.dead_zone_share)
    fills([left.forward.time_constant - 1 for left in lefts], bounds.time_constant_share)
    fills([2 * left.backlash_rad - bounds.backlash_rad for left in lefts], bounds.backlash_rad)
    fills([each.track_width_m / 0.3 - 1 for each in robots], bounds.track_share)
    fills([each.imu.gyro_scale - 1 for each in robots], bounds.gyro_scale_share)
    fills([each.imu.mount_heading_rad - 0.1 for each in robots], bounds.mount_rad)
    fills([each.lidars["lidar"].mount_x_m - 0.05 for each in robots], bounds.lidar_mount_m)
    fills([each.lidars["lidar"].mount_yaw_rad - 1.0 for each in robots], bounds.lidar_mount_rad)
    fills([each.ultrasonic_offset_m for each in robots], bounds.range_offset_m)
    fills([each.divider_ratio / 5.0 - 1 for each in robots], bounds.divider_share)


def fills(errors: list[float], bound: float) -> None:
    """Check that errors are within a bound, and reach it nearly on both sides."""
    assert -bound - 1e-12 <= min(errors) < -0.9 * bound
    assert 0.9 * bound < max(errors) <= bound + 1e-12


def test_the_imperfect_robot_has_the_stated_bounds() -> None:
    """1 % of the radii, 3 % of the track, 10 % of the gain, 1.5 degrees of play, 15 mm and 2 degrees of a lidar."""
    bounds = BOUNDS[Drawn.IMPERFECT]
    assert (bounds.radius_share, bounds.track_share, bounds.gain_share) == (0.01, 0.03, 0.1)
    assert (bounds.backlash_rad, bounds.lidar_mount_rad) == (math.radians(1.5), math.radians(2))
    assert bounds.lidar_mount_m == 0.015
