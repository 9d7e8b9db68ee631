"""Stops in a rectangular room with two boxes, whose walls are known: poses and range offset that come of the scans."""

import math

import numpy as np
import pytest

from chefbotd.components.calibration.algorithms.bundle import Adjusted, adjust_bundle
from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.scan_motion import Keyframe, keyframe
from chefbotd.components.calibration.algorithms.walls import wall_pieces
from chefbotd.core.poses import between

ROOM, BOXES = (-1.5, -2.2, 2.6, 1.6), ((1.2, 0.9, 1.9, 1.3), (-1.2, -1.9, -0.7, -1.2))
BEAMS, TURNS, NOISE_M = 450, 12, 0.01


def _stops(seed: int) -> Floats:
    """16 poses within half a metre of the middle, in all directions; the first is the origin."""
    chance = np.random.default_rng(seed)
    poses = np.column_stack([chance.uniform(-0.5, 0.5, (16, 2)), np.arange(16) * 1.1 % math.tau])
    poses[0] = 0.0
    return poses


def _ranges(pose: Floats, bearing_rad: Floats) -> Floats:
    """How far the nearest of all sides is in each direction."""
    along = np.stack([np.cos(bearing_rad + pose[2]), np.sin(bearing_rad + pose[2])], axis=1)
    nearest_m = np.full(len(along), np.inf)
    for low_x, low_y, high_x, high_y in (ROOM, *BOXES):
        low, high = np.array([low_x, low_y]), np.array([high_x, high_y])
        for axis in (0, 1):
            for side in (low, high):
                with np.errstate(divide="ignore", invalid="ignore"):
                    way_m = (side[axis] - pose[axis]) / along[:, axis]
                    across = pose[1 - axis] + way_m * along[:, 1 - axis]
                is_met = (way_m > 0) & (low[1 - axis] <= across) & (across <= high[1 - axis])
                nearest_m = np.where(is_met, np.minimum(nearest_m, way_m), nearest_m)
    return nearest_m


def _frames(poses: Floats, offset_m: float, chance: np.random.Generator) -> list[Keyframe]:
    """What a lidar with 1 cm of noise sees that reads ``offset_m`` too far."""
    frames = []
    for number, pose in enumerate(poses):
        scans = []
        for _ in range(TURNS):
            bearing_rad = (np.arange(BEAMS) + chance.uniform()) * math.tau / BEAMS
            read_m = _ranges(pose, bearing_rad) + offset_m + NOISE_M * chance.standard_normal(BEAMS)
            scans.append(np.stack([read_m * np.cos(bearing_rad), read_m * np.sin(bearing_rad)], axis=1))
        frame = keyframe(number, scans)
        assert frame is not None
        frames.append(frame)
    return frames


def _found(offset_m: float, seed: int) -> tuple[Adjusted, Floats]:
    """What came of it, from poses that are up to 3 mm and 3 mrad off, and the true poses."""
    chance, poses = np.random.default_rng(seed), _stops(seed)
    thought = poses + chance.uniform(-3e-3, 3e-3, poses.shape)
    found = adjust_bundle(_frames(poses, offset_m, chance), between(thought[0], thought))
    assert found is not None
    return found, poses


@pytest.mark.parametrize("offset_m", [-0.008, 0.006])
def test_poses_and_range_offset_are_found(offset_m: float) -> None:
    """By how much the lidar reads too far to 2 mm, every place to 1 mm and every heading to 1 mrad."""
    found, poses = _found(offset_m, seed=1)
    assert found.is_believed
    assert found.offset_m == pytest.approx(offset_m, abs=2e-3)
    off = between(poses, found.poses)
    assert np.abs(off[:, :2]).max() < 1e-3
    assert np.abs(off[:, 2]).max() < 1e-3


def test_a_lidar_without_an_error_has_none() -> None:
    """Of three rooms' scans none shows more than 1.5 mm, whether that is believed or not."""
    assert max(abs(_found(0.0, seed)[0].offset_m) for seed in (1, 2, 3)) < 1.5e-3


def test_clutter_says_nothing() -> None:
    """Where nothing is straight, there is no result in place of a wrong one."""
    chance, poses = np.random.default_rng(1), _stops(1)
    cloud = chance.uniform(-2.0, 2.0, (2000, 2))
    frames = [
        keyframe(number, [between(pose, np.column_stack([cloud, np.zeros(len(cloud))]))[:, :2]])
        for number, pose in enumerate(poses)
    ]
    assert adjust_bundle([frame for frame in frames if frame is not None], poses) is None


def test_the_two_sides_of_a_thin_wall_are_two_walls() -> None:
    """4 cm apart and with opposite normals: the points of each are pieces of their own, and a lone point is of none."""
    along_m = np.linspace(0.0, 0.9, 1000)
    near, far = (np.column_stack([along_m, np.full(1000, y_m)]) for y_m in (1.0, 1.04))
    down, up = np.tile([0.0, -1.0], (1000, 1)), np.tile([0.0, 1.0], (1000, 1))
    alone = np.array([[5.0, 5.0]])
    piece = wall_pieces(np.concatenate([near, far, alone]), np.concatenate([down, up, [[1.0, 0.0]]]))
    assert piece[-1] == -1
    first, second = set(piece[:1000].tolist()), set(piece[1000:2000].tolist())
    assert first.isdisjoint(second)
    assert -1 not in first | second
