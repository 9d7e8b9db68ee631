"""What a depth camera sees of a scene: faces and slabs drawn into a depth buffer, with the noise of structured light.

Noise and quantisation grow with the square of the depth (Khoshelham and Elberink, Sensors 2012, as in
``depth_camera.algorithms.depth_scan``). What is too near or too far, and a share of the rest, is no reading (assumed).
"""

import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from chefbotd.components.depth_camera.parameters import DepthCameraParameters
from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.scene import Scene
from chefbotd.components.simulation.worlds.building import CEILING_M, Material
from chefbotd.core.geometry import Pose2D

Depths: TypeAlias = npt.NDArray[np.float32]
Part: TypeAlias = tuple[slice, slice]

NEAR_M, FAR_M = 0.4, 9.0
LOST_SHARE = 0.01
CLIP_M = 0.05
DISC_SIDES, DISC_HEIGHT_M = 8, 1.5


class DepthRenderer:
    """Draws a scene as one camera sees it; it sees through glass."""

    def __init__(self, camera: DepthCameraParameters, scene: Scene) -> None:
        self._camera, self._slabs = camera, scene.slabs
        solid = scene.material != Material.GLASS
        self._edges, self._bottom_m, self._top_m = (
            values[solid] for values in (scene.edges, scene.bottom_m, scene.top_m)
        )
        self._level_from_camera = _rotation(camera)
        columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
        left = (camera.center_x_px - columns) / camera.focal_x_px
        up = (camera.center_y_px - rows) / camera.focal_y_px
        rays = np.stack((np.ones_like(left), left, up), axis=-1) @ self._level_from_camera.T
        self._forward, self._left, self._up = (
            np.ascontiguousarray(rays[..., axis], np.float32) for axis in range(3)
        )
        self._empty = self._floor_and_ceiling()

    def _floor_and_ceiling(self) -> Depths:
        height_m = self._camera.mount_height_m
        with np.errstate(divide="ignore"):
            to_floor, to_ceiling = -height_m / self._up, (CEILING_M - height_m) / self._up
        return np.where(self._up < 0, to_floor, to_ceiling).astype(np.float32)

    def depth_m(self, world_from_base: Pose2D, discs: Vector) -> Depths:
        """The true depth of each pixel, for this pose of the robot and these discs (D x 3: x, y, radius)."""
        eye = world_from_base.compose(self._camera.base_from_camera)
        depth = self._empty.copy()
        edges = np.vstack((self._edges, _sides(discs)))
        count = len(edges) - len(self._edges)
        bottom = np.concatenate((self._bottom_m, np.zeros(count)))
        top = np.concatenate((self._top_m, np.full(count, DISC_HEIGHT_M)))
        ends = _seen_from(eye, edges.reshape(-1, 2)).reshape(-1, 2, 2)
        for number in np.flatnonzero(self._is_near(ends)):
            self._draw_face(depth, ends[number], float(bottom[number]), float(top[number]))
        for slab in self._slabs:
            corners = _seen_from(eye, slab.corners)
            if self._is_near(corners[None])[0]:
                self._draw_slab(depth, corners, slab.height_m)
        return depth

    def image(
        self, world_from_base: Pose2D, discs: Vector, chance: np.random.Generator
    ) -> npt.NDArray[np.uint16]:
        """The image that the camera sends, in whole millimetres; 0 is no reading."""
        depth = self.depth_m(world_from_base, discs)
        noise = chance.standard_normal(depth.shape, np.float32) * np.float32(self._camera.depth_noise_per_m)
        depth_mm = (depth + noise * depth * depth) * np.float32(1000)
        lost = (depth < NEAR_M) | (depth > FAR_M) | (chance.random(depth.shape, np.float32) < LOST_SHARE)
        depth_mm[lost] = 0
        return np.rint(depth_mm).astype(np.uint16)

    def _is_near(self, corners: Vector) -> npt.NDArray[np.bool_]:
        """Which groups of corners (N x C x 2) may be in the image: not all behind, not all to one side, not too far."""
        half = max(self._camera.center_x_px, self._camera.width - self._camera.center_x_px)
        slope = math.tan(
            min(math.atan(half / self._camera.focal_x_px) + abs(self._camera.mount_pitch_rad) + 0.3, 1.5)
        )
        forward, left = corners[..., 0], corners[..., 1]
        is_in: Any = (forward > 0).any(axis=-1)
        is_in &= (left < slope * forward + 1e-9).any(axis=-1) & (left > -slope * forward - 1e-9).any(axis=-1)
        is_in &= (np.hypot(forward, left) < FAR_M).any(axis=-1) | (len(corners[0]) == 2)
        return np.asarray(is_in, np.bool_)

    def _part(self, corners: Vector) -> Part | None:
        """The rows and columns within which these corners (C x 3, level frame) are; None outside the image."""
        camera = self._camera
        seen = (corners - [0, 0, camera.mount_height_m]) @ self._level_from_camera
        if (seen[:, 0] < CLIP_M).all():
            return None
        if (seen[:, 0] < CLIP_M).any():
            return slice(0, camera.height), slice(0, camera.width)
        columns = camera.center_x_px - camera.focal_x_px * seen[:, 1] / seen[:, 0]
        rows = camera.center_y_px - camera.focal_y_px * seen[:, 2] / seen[:, 0]
        left, right = max(math.floor(columns.min()), 0), min(math.ceil(columns.max()) + 1, camera.width)
        upper, lower = max(math.floor(rows.min()), 0), min(math.ceil(rows.max()) + 1, camera.height)
        return (slice(upper, lower), slice(left, right)) if left < right and upper < lower else None

    def _draw_face(self, depth: Depths, ends: Vector, bottom_m: float, top_m: float) -> None:
        """Draw an upright rectangle where it is nearer than what the image has."""
        (ax, ay), (bx, by) = ends.tolist()
        part = self._part(np.array([[x, y, z] for x, y in ((ax, ay), (bx, by)) for z in (bottom_m, top_m)]))
        if part is None:
            return
        forward, left, up = self._forward[part], self._left[part], self._up[part]
        dx, dy = bx - ax, by - ay
        at = np.float32(dy * ax - dx * ay) / _not_zero(np.float32(dy) * forward - np.float32(dx) * left)
        along_x, along_y = at * forward - np.float32(ax), at * left - np.float32(ay)
        along = along_x * np.float32(dx) + along_y * np.float32(dy)
        height = self._camera.mount_height_m + at * up
        drawn = (at > CLIP_M) & (along >= 0) & (along <= dx * dx + dy * dy)
        drawn &= (height >= bottom_m) & (height <= top_m)
        self._keep_nearest(depth[part], at, drawn)

    def _draw_slab(self, depth: Depths, corners: Vector, height_m: float) -> None:
        """Draw a level polygon where it is nearer than what the image has."""
        part = self._part(np.column_stack((corners, np.full(len(corners), height_m))))
        if part is None:
            return
        forward, left = self._forward[part], self._left[part]
        at = np.float32(height_m - self._camera.mount_height_m) / _not_zero(self._up[part])
        x, y = at * forward, at * left
        drawn = at > CLIP_M
        for (ax, ay), (bx, by) in zip(corners.tolist(), np.roll(corners, -1, axis=0).tolist(), strict=True):
            drawn &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0
        self._keep_nearest(depth[part], at, drawn)

    @staticmethod
    def _keep_nearest(depth: Depths, at: npt.NDArray[Any], drawn: npt.NDArray[np.bool_]) -> None:
        np.minimum(depth, at, out=depth, where=drawn)


def _not_zero(values: Depths) -> Depths:
    """A ray parallel to a face meets it at this distance, which is out of range."""
    return np.where(values == 0, np.float32(1e-9), values)


def _rotation(camera: DepthCameraParameters) -> Vector:
    """From the camera's frame (forward, left, up) to the level one: first the roll, then the pitch."""
    cos, sin = math.cos(camera.mount_roll_rad), math.sin(camera.mount_roll_rad)
    roll = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    cos, sin = math.cos(camera.mount_pitch_rad), math.sin(camera.mount_pitch_rad)
    pitch = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    rotation: Vector = pitch @ roll
    return rotation


def _seen_from(eye: Pose2D, points: Vector) -> Vector:
    """Points of the world (N x 2) as forward and left of the eye."""
    cos, sin = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    seen: Vector = (points - [eye.x_m, eye.y_m]) @ np.array([[cos, -sin], [sin, cos]])
    return seen


def _sides(discs: Vector) -> Vector:
    """The sides of prisms that stand for discs (D x 3), one row each: x1, y1, x2, y2."""
    angles = np.arange(DISC_SIDES + 1) * (math.tau / DISC_SIDES)
    x = discs[:, :1] + discs[:, 2:] * np.cos(angles)
    y = discs[:, 1:2] + discs[:, 2:] * np.sin(angles)
    return np.stack((x[:, :-1], y[:, :-1], x[:, 1:], y[:, 1:]), axis=-1).reshape(-1, 4)
