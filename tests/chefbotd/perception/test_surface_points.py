"""Points of a lidar are moved to the surface that they belong to; what stands alone stays where it is."""

import math

import numpy as np
import pytest

from chefbotd.perception.surface_points import MOST_M, Floats, smooth_points

LIDAR = np.zeros(2)
BEARINGS = math.tau / 450 * np.arange(450)


def seen(ranges: Floats, noise_m: float, seed: int = 1) -> Floats:
    """Points of an LD19's turn."""
    noisy = ranges + np.random.default_rng(seed).normal(0, noise_m, len(ranges))
    return np.stack([np.cos(BEARINGS), np.sin(BEARINGS)], axis=1) * noisy[:, None]


def corridor(half_m: float) -> Floats:
    """The ranges to two long walls, left and right."""
    return np.minimum(half_m / np.maximum(np.abs(np.sin(BEARINGS)), 1e-3), 8.0)


@pytest.mark.parametrize("seed", range(5))
def test_the_walls_beside_the_robot_are_three_times_as_exact(seed: int) -> None:
    """A noise of 1 cm on walls 0.21 m away: of the points beside the robot 1 % is 1 cm nearer, where 12 % were."""
    raw = seen(corridor(0.21), 0.01, seed)
    beside = np.abs(raw[:, 0]) < 0.2
    nearer_m = 0.21 - np.abs(smooth_points(raw, LIDAR)[beside, 1])
    assert (0.21 - np.abs(raw[beside, 1]) > 0.01).mean() > 0.08
    assert (nearer_m > 0.01).mean() < 0.015
    assert nearer_m.max() < 0.02
    assert nearer_m.std() < 0.004


def test_no_point_is_moved_farther_than_a_centimetre_and_a_half() -> None:
    """Whatever the noise."""
    raw = seen(corridor(0.3), 0.03)
    moved_m = np.hypot(*(smooth_points(raw, LIDAR) - raw).T)
    assert moved_m.max() <= MOST_M + 1e-9
    assert moved_m.max() > 0.01


@pytest.mark.parametrize("away_m", [0.25, 0.5, 1.0])
def test_a_leg_of_two_centimetres_before_a_wall_stays(away_m: float) -> None:
    """Without noise its points are where they were, to a centimetre that its own roundness makes."""
    ranges = np.full(450, 2.0)
    half = math.atan2(0.01, away_m)
    leg = np.abs(np.arange(450) * math.tau / 450 - math.pi) <= half
    ranges[leg] = away_m
    moved_m = np.hypot(*(smooth_points(seen(ranges, 0.0), LIDAR) - seen(ranges, 0.0)).T)
    assert leg.any()
    assert moved_m[leg].max() < 0.01


def test_a_corner_of_a_door_is_rounded_by_no_more_than_a_centimetre() -> None:
    """0.3 m ahead and 0.21 m to the left the wall across ends, and the jamb goes on ahead."""
    angle = np.arctan2(0.21, 0.3)
    across = 0.3 / np.maximum(np.cos(BEARINGS), 1e-3)
    jamb = 0.21 / np.maximum(np.sin(BEARINGS), 1e-3)
    ranges = np.where((angle <= BEARINGS) & (BEARINGS < 1.2), across, np.where(angle > BEARINGS, jamb, 4.0))
    raw = seen(np.minimum(ranges, 4.0), 0.0)
    corner = np.hypot(raw[:, 0] - 0.3, raw[:, 1] - 0.21) < 0.03
    moved = smooth_points(raw, LIDAR) - raw
    assert corner.sum() >= 5
    assert np.abs(moved[corner]).max() < 0.01


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_few_points_are_no_error(count: int) -> None:
    """As from a lidar that is nearly covered."""
    points = np.stack([np.full(count, 1.0), 0.01 * np.arange(count)], axis=1)
    assert smooth_points(points, LIDAR).shape == (count, 2)


def test_points_that_were_seen_from_two_places_are_smoothed_along_their_own_beams() -> None:
    """Two lidars: each point with the place of its own."""
    points = np.array([[0.5, 0.0], [0.5, 0.005], [-0.5, 0.0], [-0.5, 0.005]])
    sensors = np.array([[0.1, 0.0], [0.1, 0.0], [-0.1, 0.0], [-0.1, 0.0]])
    assert smooth_points(points, sensors)[:, 0] == pytest.approx(points[:, 0])


@pytest.mark.parametrize("beams", [360, 450, 720])
@pytest.mark.parametrize("range_m", [0.15, 0.2, 0.3, 0.5, 1.0])
def test_a_corner_that_points_at_the_robot_is_rounded_by_no_more_than_13_millimetres(
    beams: int, range_m: float
) -> None:
    """However it is turned: two walls of 1 m that meet at a right angle, seen without noise."""
    angles = np.arange(beams) * math.tau / beams - math.pi
    along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for turned_rad in np.linspace(-0.7, 0.7, 15).tolist():
        ranges = np.full(beams, np.inf)
        for wall_rad in (turned_rad + math.pi / 4, turned_rad - math.pi / 4):
            x, y = math.cos(wall_rad), math.sin(wall_rad)
            across = (
                along[:, 0] * y - along[:, 1] * x
            )  # where a beam meets the wall that begins at the corner
            hit_m = np.divide(range_m * y, across, out=np.full(beams, np.inf), where=np.abs(across) > 1e-9)
            wall_m = np.divide(
                range_m * along[:, 1], across, out=np.full(beams, np.inf), where=np.abs(across) > 1e-9
            )
            ranges = np.where((hit_m > 0) & (wall_m >= 0) & (wall_m <= 1), np.minimum(ranges, hit_m), ranges)
        points = (along * ranges[:, None])[np.isfinite(ranges)]
        nearer_m = np.hypot(*smooth_points(points, np.zeros(2)).T).min() - np.hypot(*points.T).min()
        assert nearer_m <= 0.013
