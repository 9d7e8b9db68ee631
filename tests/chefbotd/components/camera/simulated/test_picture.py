"""What a simulated camera draws."""

import math

import numpy as np

from chefbotd.components.camera.algorithms.jpeg import read_picture
from chefbotd.components.camera.simulated.picture import (
    FIELD_OF_VIEW_RAD,
    HEIGHT_PX,
    WIDTH_PX,
    PictureRenderer,
    encode_jpeg,
)
from chefbotd.components.simulation.scene import of_walls
from chefbotd.core.geometry import ORIGIN, Pose2D

NOBODY = np.zeros((0, 3))
WALL_AHEAD = of_walls(np.array([[2.0, 5.0, 2.0, -5.0]]))
HEIGHT_M = 0.35


def bottom_row(image: object) -> int:
    """The last row of the wall in the middle column: below it is the floor, which is darker."""
    column = np.asarray(image)[:, WIDTH_PX // 2].astype(int).sum(axis=1)
    return int(np.flatnonzero(np.diff(column[HEIGHT_PX // 2 :]))[0]) + HEIGHT_PX // 2


def test_a_wall_meets_the_floor_where_a_pinhole_camera_sees_it() -> None:
    """2 m ahead of a camera 0.35 m above the floor: f * 0.35 / 2 below the middle."""
    image = PictureRenderer(WALL_AHEAD, 0.0, HEIGHT_M).draw(ORIGIN, NOBODY)
    focal_px = WIDTH_PX / 2 / math.tan(FIELD_OF_VIEW_RAD / 2)
    assert abs(bottom_row(image) - (HEIGHT_PX / 2 + focal_px * HEIGHT_M / 2.0)) <= 1.5


def test_a_nearer_wall_reaches_lower() -> None:
    """The robot has driven 1 m towards it."""
    renderer = PictureRenderer(WALL_AHEAD, 0.0, HEIGHT_M)
    assert (
        bottom_row(renderer.draw(Pose2D(1.0, 0.0, 0.0), NOBODY))
        > bottom_row(renderer.draw(ORIGIN, NOBODY)) + 20
    )


def test_a_person_to_the_left_is_in_the_left_half_and_hides_the_wall() -> None:
    """0.3 m to the left and 1 m ahead, before a wall 2 m ahead; one behind the wall is hidden."""
    renderer = PictureRenderer(WALL_AHEAD, 0.0, HEIGHT_M)
    empty = renderer.draw(ORIGIN, NOBODY)
    changed = (renderer.draw(ORIGIN, np.array([[1.0, 0.3, 0.15]])) != empty).any(axis=(0, 2))
    columns = np.flatnonzero(changed)
    assert columns.size > 20
    assert columns[-1] < WIDTH_PX // 2
    assert (renderer.draw(ORIGIN, np.array([[3.0, 0.3, 0.15]])) == empty).all()


def test_the_picture_is_a_jpeg_of_its_size() -> None:
    """As a real camera sends it."""
    read = read_picture(encode_jpeg(PictureRenderer(WALL_AHEAD, 0.1, HEIGHT_M).draw(ORIGIN, NOBODY)), 100_000)
    assert (read.width_px, read.height_px) == (WIDTH_PX, HEIGHT_PX)
