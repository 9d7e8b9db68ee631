"""Converts a depth image to a scan: the nearest obstacle between the floor and the robot's top, for each bearing.

A pixel's ray has a fixed bearing, and its height and horizontal range grow with the depth alone. So all that depends on
the camera's mount is worked out once: between which two depths a pixel's reading counts as an obstacle. An image then
costs two comparisons a pixel and one minimum a beam.

The floor is told from an obstacle by height, with a margin that grows with distance. The depth noise of a camera with
structured light grows with the square of the depth (Khoshelham and Elberink, "Accuracy and Resolution of Kinect Depth
Data for Indoor Mapping Applications", Sensors 2012: 1.425e-3 per metre). A mount whose tilt is not quite as configured
lifts the whole floor.
"""

import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from chefbotd.components.depth_camera.parameters import DepthCameraParameters
from chefbotd.core.record import Record

INVALID_MM = 65535
"""Some drivers' mark for no reading; 0 is everybody's."""
MM_PER_M = 1000.0

Floats: TypeAlias = npt.NDArray[np.floating[Any]]


class DepthScan(Record, frozen=True):
    """What an image shows, in the level frame below the camera; arrays of one entry a beam, from right to left.

    ``range_m`` is the horizontal distance to the nearest obstacle, infinite where none was seen. ``clear_m`` tells how
    far the beam was seen to be free: up to the obstacle, or up to the farthest floor; 0 where nothing was read.
    """

    bearing_rad: npt.NDArray[np.float32]
    range_m: npt.NDArray[np.float32]
    clear_m: npt.NDArray[np.float32]


class DepthToScan:
    """Makes scans from the images of one camera, as it is mounted. Of two rows one is read, and the other backs it."""

    def __init__(self, parameters: DepthCameraParameters) -> None:
        self._shape = (parameters.height, parameters.width)
        self._neighbour_share = parameters.neighbour_share
        forward, left, up = _rays(parameters)
        horizontal = np.hypot(forward, left)
        nearest, farthest, top = _depth_bounds(parameters, horizontal, up)
        beam, self._bearing_rad = _beams(parameters, np.arctan2(left, forward))
        # Pixels in the order of their beams: a beam is then a run of the array.
        self._order = np.argsort(beam, axis=None, kind="stable")
        self._nearest, self._farthest, self._top = (
            _as_mm(depth_m)[self._order] for depth_m in (nearest, farthest, top)
        )
        self._m_per_mm = (horizontal.ravel() / MM_PER_M).astype(np.float32)[self._order]
        pixels = np.bincount(beam.ravel(), minlength=parameters.beams)
        self._filled = np.flatnonzero(pixels)
        self._starts = (np.cumsum(pixels) - pixels)[self._filled]

    def scan(self, depth_mm: npt.NDArray[np.uint16]) -> DepthScan:
        """The scan of one image, in millimetres along the optical axis.

        Raises:
            ValueError: the image has another size or another type than the camera's.
        """
        if depth_mm.shape != self._shape or depth_mm.dtype != np.uint16:
            height, width = self._shape
            raise ValueError(
                f"a depth image has {height} rows and {width} columns of uint16, "
                f"got {depth_mm.shape} of {depth_mm.dtype}"
            )
        read = depth_mm[:-1:2].take(self._order)
        range_m = read * self._m_per_mm
        obstacle = self._backed(depth_mm).take(self._order)
        obstacle &= read >= self._nearest
        obstacle &= read <= self._farthest
        clear_m = self._by_beam(np.maximum, range_m * (read <= self._top), 0.0)
        np.copyto(range_m, np.inf, where=~obstacle)
        nearest_m = self._by_beam(np.minimum, range_m, np.inf)
        return DepthScan(self._bearing_rad, nearest_m, np.minimum(clear_m, nearest_m))

    def _by_beam(
        self, choice: np.ufunc, values: npt.NDArray[np.float32], empty: float
    ) -> npt.NDArray[np.float32]:
        chosen = np.full(len(self._bearing_rad), empty, np.float32)
        chosen[self._filled] = choice.reduceat(values, self._starts)
        return chosen

    def _backed(self, depth_mm: npt.NDArray[np.uint16]) -> npt.NDArray[np.bool_]:
        """Which readings the row below agrees with: a flying pixel at an edge, or a speck of noise, has no such row."""
        upper, lower = depth_mm[:-1:2].astype(np.float32), depth_mm[1::2]
        backed: npt.NDArray[np.bool_] = np.abs(upper - lower) <= upper * np.float32(self._neighbour_share)
        return backed


def _rays(p: DepthCameraParameters) -> tuple[Floats, ...]:
    """The ray of each pixel that is read, for a metre of depth: forward, left and up in the level frame."""
    columns, rows = np.meshgrid(np.arange(p.width), np.arange(0, p.height - 1, 2))
    left, up = (p.center_x_px - columns) / p.focal_x_px, (p.center_y_px - rows) / p.focal_y_px
    cos, sin = math.cos(p.mount_roll_rad), math.sin(p.mount_roll_rad)
    left, up = cos * left - sin * up, sin * left + cos * up
    cos, sin = math.cos(p.mount_pitch_rad), math.sin(p.mount_pitch_rad)
    return cos + sin * up, left, cos * up - sin


def _depth_bounds(p: DepthCameraParameters, horizontal: Floats, up: Floats) -> tuple[Floats, ...]:
    """For each pixel: the depths between which a reading is an obstacle, and the depth up to which it is below the top.

    A reading is above the floor where ``height - min_height > tilt * range + sigmas * noise * depth^2 * |up|``. Both
    sides are at most quadratic in the depth.
    """
    nearest, farthest = p.min_range_m / horizontal, p.max_range_m / horizontal
    with np.errstate(divide="ignore"):
        to_top = (p.max_height_m - p.mount_height_m) / up
    below_top = np.where(up > 0, to_top, np.inf)
    if p.mount_height_m >= p.max_height_m:  # it looks down into the band
        nearest, below_top = np.maximum(nearest, to_top), np.where(up < 0, np.inf, 0.0)
    noise = p.floor_sigmas * p.depth_noise_per_m * np.abs(up)
    slope = up - p.tilt_error_rad * horizontal
    clearance_m = p.mount_height_m - p.min_height_m
    with np.errstate(divide="ignore"):
        to_floor = 2 * clearance_m / (np.sqrt(slope**2 + 4 * noise * clearance_m) - slope)
    return nearest, np.minimum(np.minimum(farthest, below_top), to_floor), np.minimum(below_top, farthest)


def _beams(
    p: DepthCameraParameters, bearing: Floats
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float32]]:
    """Each pixel's beam, and each beam's bearing: even steps from the rightmost pixel to the leftmost."""
    rightmost, leftmost = float(bearing.min()), float(bearing.max())
    step = (leftmost - rightmost) / p.beams
    beam = np.clip(((bearing - rightmost) / step).astype(np.int64), 0, p.beams - 1)
    return beam, (rightmost + step * (np.arange(p.beams) + 0.5)).astype(np.float32)


def _as_mm(depth_m: Floats) -> npt.NDArray[np.uint16]:
    """Whole millimetres, as an image has them; a depth beyond them is never reached."""
    whole_mm: npt.NDArray[np.uint16] = np.clip(np.rint(depth_m.ravel() * MM_PER_M), 1, INVALID_MM - 1).astype(
        np.uint16
    )
    return whole_mm
