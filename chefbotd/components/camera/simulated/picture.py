"""Draws what a camera sees of a scene: walls, furniture and people, with light on them, over a tiled floor.

The camera looks straight ahead and level. Each upright face is drawn into a depth buffer, column by column; a person is
an upright cylinder. Colours, light and tiles are there for people who look, and stand for nothing real (assumed).
"""

import io
import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.scene import Scene
from chefbotd.components.simulation.worlds.building import CEILING_M, Material
from chefbotd.core.geometry import Pose2D

Image: TypeAlias = npt.NDArray[np.uint8]
Floats: TypeAlias = npt.NDArray[np.float32]

WIDTH_PX, HEIGHT_PX = 320, 240
FIELD_OF_VIEW_RAD = math.radians(62.0)
"""Across, as a Raspberry Pi camera of the second generation has."""
NEAR_M, FAR_M = 0.05, 15.0
PERSON_HEIGHT_M = 1.7
TILE_M = 0.5
QUALITY = 70
LIGHT_RAD = 0.6
"""Where the light comes from, in the world."""

WALL, FURNITURE, BLACK, PERSON = (226, 220, 205), (168, 128, 88), (58, 58, 64), (78, 112, 168)
TILES = np.array(((150, 141, 128), (132, 123, 111)), np.float32)
CEILING = (236, 236, 232)
FURNITURE_TOP_M = 2.2


class PictureRenderer:
    """Draws a scene as one camera sees it; it sees through glass."""

    def __init__(self, scene: Scene, mount_x_m: float, mount_height_m: float) -> None:
        solid = scene.material != Material.GLASS
        self._edges, self._bottom_m, self._top_m = (
            values[solid] for values in (scene.edges, scene.bottom_m, scene.top_m)
        )
        material = scene.material[solid]
        self._colours = np.array(
            [_colour(*face) for face in zip(material, self._top_m, strict=True)], np.float32
        )
        self._base_from_eye, self._height_m = Pose2D(mount_x_m, 0.0, 0.0), mount_height_m
        self._focal_px = 0.5 * WIDTH_PX / math.tan(0.5 * FIELD_OF_VIEW_RAD)
        columns = np.arange(WIDTH_PX, dtype=np.float32)
        self._left = (0.5 * (WIDTH_PX - 1) - columns) / np.float32(self._focal_px)
        self._rows = np.arange(HEIGHT_PX, dtype=np.float32)[:, None] - np.float32(0.5 * (HEIGHT_PX - 1))

    def draw(self, world_from_base: Pose2D, discs: Vector) -> Image:
        """The picture (rows x columns x 3) for this pose of the robot, and these people (D x 3: x, y, radius)."""
        eye = world_from_base.compose(self._base_from_eye)
        image, depth = self._empty_room(eye)
        ends = _seen_from(eye, self._edges.reshape(-1, 2)).reshape(-1, 2, 2)
        for number in np.flatnonzero(self._is_in_view(ends)):
            band = float(self._bottom_m[number]), float(self._top_m[number])
            light = _light_on(self._edges[number])
            self._draw_face(image, depth, ends[number], band, self._colours[number] * light)
        for x, y, radius_m in discs.tolist():
            ahead, left = _seen_from(eye, np.array([[x, y]]))[0].tolist()
            self._draw_person(image, depth, ahead, left, radius_m)
        return np.clip(image, 0, 255).astype(np.uint8)

    def _empty_room(self, eye: Pose2D) -> tuple[Floats, Floats]:
        """The floor and the ceiling, and how far ahead each pixel of them is."""
        with np.errstate(divide="ignore"):
            floor = self._height_m * self._focal_px / np.maximum(self._rows, 1e-6)
            ceiling = (CEILING_M - self._height_m) * self._focal_px / np.maximum(-self._rows, 1e-6)
        is_floor = self._rows > 0
        ahead = np.broadcast_to(np.where(is_floor, floor, ceiling), (HEIGHT_PX, WIDTH_PX)).astype(np.float32)
        left = ahead * self._left
        cos, sin = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
        near = np.minimum(ahead, np.float32(100.0))
        x = eye.x_m + cos * near - sin * np.minimum(np.abs(left), 100.0) * np.sign(left)
        y = eye.y_m + sin * near + cos * np.minimum(np.abs(left), 100.0) * np.sign(left)
        tile = (np.floor(x / TILE_M) + np.floor(y / TILE_M)).astype(np.int64) & 1
        image = np.where(is_floor[..., None], TILES[tile], np.array(CEILING, np.float32))
        return (image * _fade(ahead)[..., None]).astype(np.float32), ahead

    def _is_in_view(self, ends: Vector) -> npt.NDArray[np.bool_]:
        """Which faces (N x 2 x 2) may be in the picture: not all behind, not all to one side, not too far."""
        slope = math.tan(0.5 * FIELD_OF_VIEW_RAD)
        ahead, left = ends[..., 0], ends[..., 1]
        is_in: Any = (ahead > NEAR_M).any(axis=-1) & (ahead.min(axis=-1) < FAR_M)
        is_in &= (left < slope * ahead + 1e-9).any(axis=-1) & (left > -slope * ahead - 1e-9).any(axis=-1)
        return np.asarray(is_in, np.bool_)

    def _draw_face(
        self, image: Floats, depth: Floats, ends: Vector, band: tuple[float, float], colour: Floats
    ) -> None:
        """Draw an upright rectangle where it is nearer than what the picture has."""
        (ax, ay), (bx, by) = ends.tolist()
        dx, dy = bx - ax, by - ay
        across = np.where((across := dy - dx * self._left) == 0, 1e-9, across)
        ahead = ((dy * ax - dx * ay) / across).astype(np.float32)
        along = (ahead - ax) * dx + (ahead * self._left - ay) * dy
        met = np.flatnonzero((ahead > NEAR_M) & (along >= 0) & (along <= dx * dx + dy * dy))
        if met.size:
            self._draw_columns(image, depth, slice(met[0], met[-1] + 1), ahead, band, colour)

    def _draw_person(self, image: Floats, depth: Floats, ahead: float, left: float, radius_m: float) -> None:
        if ahead < radius_m + NEAR_M or ahead > FAR_M:
            return
        norm = np.hypot(1.0, self._left)
        middle = (ahead + left * self._left) / norm
        beside = (ahead * self._left - left) / norm
        inside = radius_m**2 - beside**2
        met = np.flatnonzero(inside > 0)
        if not met.size:
            return
        depth_of = ((middle - np.sqrt(np.maximum(inside, 0.0))) / norm).astype(np.float32)
        light = 0.6 + 0.4 * np.sqrt(np.maximum(inside, 0.0)) / radius_m
        part = slice(met[0], met[-1] + 1)
        colour = np.array(PERSON, np.float32) * light[part, None].astype(np.float32)
        self._draw_columns(image, depth, part, depth_of, (0.0, PERSON_HEIGHT_M), colour)

    def _draw_columns(
        self,
        image: Floats,
        depth: Floats,
        part: slice,
        ahead: Floats,
        band: tuple[float, float],
        colour: Floats,
    ) -> None:
        at = ahead[part]
        lowest, highest = (-(height - self._height_m) * self._focal_px / at for height in band)
        drawn = (self._rows >= highest) & (self._rows <= lowest) & (at < depth[:, part])
        shade = colour * _fade(at)[:, None]
        np.copyto(image[:, part], shade[None], where=drawn[..., None])
        np.copyto(depth[:, part], at[None], where=drawn)


def encode_jpeg(image: Image) -> bytes:
    """The picture as a camera sends it.

    Raises:
        ModuleNotFoundError: Pillow is not installed.
    """
    from PIL import Image as Pillow

    data = io.BytesIO()
    Pillow.fromarray(image).save(data, "JPEG", quality=QUALITY)
    return data.getvalue()


def _colour(material: int, top_m: float) -> tuple[int, int, int]:
    if material == Material.BLACK:
        return BLACK
    return FURNITURE if top_m < FURNITURE_TOP_M else WALL


def _light_on(edge: Vector) -> float:
    """How bright a face is, by its direction alone."""
    x1, y1, x2, y2 = edge.tolist()
    return 0.68 + 0.32 * abs(math.sin(math.atan2(y2 - y1, x2 - x1) - LIGHT_RAD))


def _fade(ahead: Floats) -> Floats:
    """What is farther is darker."""
    return np.float32(1.0) / (np.float32(1.0) + np.float32(0.06) * np.minimum(ahead, np.float32(FAR_M)))


def _seen_from(eye: Pose2D, points: Vector) -> Vector:
    """Points of the world (N x 2) as ahead and left of the eye."""
    cos, sin = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    seen: Vector = (points - [eye.x_m, eye.y_m]) @ np.array([[cos, -sin], [sin, cos]])
    return seen
