"""Planar poses as arrays (x in m, y in m, heading in rad, counter-clockwise positive), one or many rows."""

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.geometry import Pose2D

Floats: TypeAlias = NDArray[np.float64]


def row_of(pose: Pose2D) -> Floats:
    """A pose as an array (x, y, heading)."""
    return np.array([pose.x_m, pose.y_m, pose.heading_rad])


def wrap(angle_rad: Floats) -> Floats:
    """The same angles in [-pi, pi)."""
    wrapped: Floats = (angle_rad + math.pi) % math.tau - math.pi
    return wrapped


def compose(a: Floats, b: Floats) -> Floats:
    """``a_from_c`` of ``a_from_b`` and ``b_from_c``, row by row; either may be a single pose."""
    if a.ndim == b.ndim == 1:
        return _compose(*a.tolist(), *b.tolist())
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = a[..., 0] + cos * b[..., 0] - sin * b[..., 1]
    y = a[..., 1] + sin * b[..., 0] + cos * b[..., 1]
    return np.stack([x, y, wrap(a[..., 2] + b[..., 2])], axis=-1)


def between(a: Floats, b: Floats) -> Floats:
    """Pose ``b`` as seen from pose ``a``: the inverse of ``compose``."""
    if a.ndim == b.ndim == 1:
        return _between(*a.tolist(), *b.tolist())
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx, wrap(b[..., 2] - a[..., 2])], axis=-1)


def _compose(ax: float, ay: float, a_rad: float, bx: float, by: float, b_rad: float) -> Floats:
    """The same of two single poses, as numbers: that takes a fifth of the time of six arrays of one element."""
    cos, sin = math.cos(a_rad), math.sin(a_rad)
    return np.array([ax + cos * bx - sin * by, ay + sin * bx + cos * by, _wrap(a_rad + b_rad)])


def _between(ax: float, ay: float, a_rad: float, bx: float, by: float, b_rad: float) -> Floats:
    cos, sin, dx, dy = math.cos(a_rad), math.sin(a_rad), bx - ax, by - ay
    return np.array([cos * dx + sin * dy, cos * dy - sin * dx, _wrap(b_rad - a_rad)])


def _wrap(angle_rad: float) -> float:
    return (angle_rad + math.pi) % math.tau - math.pi


def invert(matrix: Floats) -> Floats:
    """The inverse of a square matrix."""
    return np.linalg.inv(matrix).astype(np.float64)


def turn_covariance(covariance: Floats, turn_rad: float) -> Floats:
    """A covariance (or information) over x, y and heading, in axes that are turned by so much clockwise.

    So an uncertainty ahead of the robot becomes one along x of the frame in which its heading is ``turn_rad``.
    """
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    by = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    result: Floats = by @ covariance @ by.T
    return result


def inverse(a: Floats) -> Floats:
    """``b_from_a`` of ``a_from_b``."""
    return between(a, np.zeros(3))


def transform(pose: Floats, points: NDArray[np.floating[Any]]) -> Floats:
    """Points (n, 2) of the pose's frame in the frame in which the pose is given."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    moved: Floats = points @ np.array([[cos, sin], [-sin, cos]]) + pose[:2]
    return moved


def carried_covariance(covariance: Floats, dx_m: float, dy_m: float) -> Floats:
    """What is uncertain about a pose, at a place that lies (dx, dy) from it."""
    by = np.array([[1.0, 0.0, -dy_m], [0.0, 1.0, dx_m], [0.0, 0.0, 1.0]])
    result: Floats = by @ covariance @ by.T
    return result


ROUNDING = 1e-9
"""Of a difference of covariances, in their units."""


def motion_covariance(
    before: Floats, before_covariance: Floats, after: Floats, after_covariance: Floats
) -> Floats | None:
    """What odometry's covariance grew by between two poses, in the frame of the first: that of the motion alone.

    None where it has shrunk: odometry began again, or another sensor has corrected it.
    """
    carried = carried_covariance(before_covariance, after[0] - before[0], after[1] - before[1])
    grown = turn_covariance(after_covariance - carried, -float(before[2]))
    variances, axes = np.linalg.eigh(grown)
    if not variances[0] >= -ROUNDING:  # neither where it is not a number
        return None
    noise: Floats = (
        axes * np.maximum(variances, 0.0)
    ) @ axes.T  # no variance is below 0, whatever was rounded
    return noise
