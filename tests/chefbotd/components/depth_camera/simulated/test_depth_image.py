"""What the simulated depth camera sees."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chefbotd.components.depth_camera.algorithms.depth_scan import DepthToScan
from chefbotd.components.depth_camera.parameters import DepthCameraParameters
from chefbotd.components.depth_camera.simulated.depth_image import DepthRenderer
from chefbotd.components.simulation import scene
from chefbotd.components.simulation.rooms import scene_of
from chefbotd.components.simulation.worlds.building import Material, Placement, box, table
from chefbotd.core.geometry import Pose2D

NOBODY = np.zeros((0, 3))
HERE = Pose2D()
FAR_WALL = np.array([[8.0, -20.0, 8.0, 20.0]])


def camera(**values: Any) -> DepthCameraParameters:
    """A quarter of a Kinect's pixels, 0.6 m up."""
    small = {"width": 160, "height": 120, "beams": 80, "focal_x_px": 146.0, "focal_y_px": 146.0}
    middle = {"center_x_px": 80.0, "center_y_px": 60.0, "mount_height_m": 0.6}
    return DepthCameraParameters.model_validate({**small, **middle, **values})


def drawn(
    what: scene.Scene,
    pose: Pose2D = HERE,
    discs: np.ndarray = NOBODY,
    **values: Any,
) -> np.ndarray:
    """The true depths from a pose."""
    return DepthRenderer(camera(**values), what).depth_m(pose, discs)


def test_a_wall_the_floor_and_the_ceiling_are_where_they_are() -> None:
    """A wall 2 m ahead of a robot that looks along y: its depth is 2 everywhere; the floor is 0.6 / slope away."""
    wall = scene.of_walls(np.array([[5.0, 3.0, -5.0, 3.0]]))
    depth = drawn(wall, Pose2D(0.4, 0.9, math.pi / 2), mount_x_m=0.1)
    assert depth[60, 5] == pytest.approx(2.0)
    assert depth[60, 150] == pytest.approx(2.0)
    assert depth[115, 80] == pytest.approx(0.6 / (55 / 146))
    steep = drawn(wall, Pose2D(0.4, 0.9, math.pi / 2), mount_pitch_rad=-0.9)
    assert steep[60, 80] == pytest.approx(1.9 / math.sin(0.9))


def test_a_corner_is_drawn_where_it_projects_to_from_a_tilted_camera() -> None:
    """The top's near right corner (2, -0.3, 0.72) of a table, from (0.2, 0.1), yaw -0.2, pitch 0.25, roll 0.1: by hand.

    Level: forward and left of the eye. Then the pitch (nose down) and the roll (right side down) are undone.
    """
    furniture = scene.of_solids(table("table", Placement(2.0, -0.3), 0.8, 1.2))
    tilt = {"mount_pitch_rad": 0.25, "mount_roll_rad": 0.1}
    depth = drawn(furniture, Pose2D(0.2, 0.1, -0.2), **tilt)
    ahead, aside, above = 2.02 - 0.2, -0.28 - 0.1, 0.72 - 0.6
    forward, left = (
        math.cos(0.2) * ahead - math.sin(0.2) * aside,
        math.cos(0.2) * aside + math.sin(0.2) * ahead,
    )
    x = math.cos(0.25) * forward - math.sin(0.25) * above
    up = math.sin(0.25) * forward + math.cos(0.25) * above
    left, up = math.cos(0.1) * left + math.sin(0.1) * up, math.cos(0.1) * up - math.sin(0.1) * left
    column, row = round(80 - 146 * left / x), round(60 - 146 * up / x)
    assert depth[row, column] == pytest.approx(x, abs=0.03)
    assert depth[row - 4, column] > x + 0.1
    assert depth[row, column + 5] > x + 0.2


def test_tables_have_tops_legs_and_nothing_between() -> None:
    """From 1 m before it: the top's edge at 0.71 m, a leg below it, and the wall behind between the legs."""
    room = scene.of_solids(
        [*table("table", Placement(1.0, -0.6), 0.8, 1.2), box("wall", Placement(3.0, -9.0), 0.1, 18.0, 2.4)]
    )
    depth = drawn(room)
    edge_row, between_row = 60 - round(146 * 0.105), 60 - round(146 * 0.02)
    assert depth[edge_row, 80] == pytest.approx(1.0, abs=0.02)
    assert depth[between_row, 80] == pytest.approx(3.0)
    leg_column = 80 - round(146 * 0.57)
    assert depth[between_row, max(leg_column, 0)] == pytest.approx(1.0, abs=0.02)


def test_a_table_in_the_flat_is_met_by_the_camera_and_not_by_a_lidar() -> None:
    """From (2.2, 1.5) eastwards the dining table's edge is 1.0 m ahead of the camera; a lidar at 0.2 m sees beneath."""
    flat, pose = scene_of(Path("flat")), Pose2D(2.2, 1.5, 0.0)
    p = camera(mount_x_m=0.1, mount_pitch_rad=0.15)
    image = DepthRenderer(p, flat).image(pose, NOBODY, np.random.default_rng(1))
    scan = DepthToScan(p).scan(image)
    middle = np.abs(scan.bearing_rad) < 0.08
    assert np.median(scan.range_m[middle]) == pytest.approx(1.0, abs=0.03)
    beam = flat.below(0.35).first_hits_m((2.3, 1.5), np.array([0.0, 0.05, -0.05]))
    assert beam.min() > 2.5


def test_people_are_seen_and_glass_is_not() -> None:
    """A person's near side 1 m ahead; a pane before the wall is looked through."""
    pane = box("pane", Placement(2.0, -3.0), 0.04, 6.0, 2.0, material=Material.GLASS)
    room = scene.of_solids([pane, box("wall", Placement(4.0, -9.0), 0.1, 18.0, 2.4)])
    assert drawn(room)[60, 80] == pytest.approx(4.0)
    with_person = drawn(room, discs=np.array([[1.25, 0.0, 0.25]]))
    assert with_person[60, 80] == pytest.approx(1.0, abs=0.02)
    assert with_person[60, 5] == pytest.approx(4.0)


def test_what_is_behind_or_beside_the_camera_is_not_drawn() -> None:
    """A box around the robot's back and left: the wall ahead alone."""
    around = scene.of_solids(
        [
            box("wall", Placement(3.0, -9.0), 0.1, 18.0, 2.4),
            box("behind", Placement(-1.0, -1.0), 0.5, 2.0, 1.0),
            box("left", Placement(-0.2, 0.4), 0.6, 0.3, 1.0),
        ]
    )
    assert drawn(around)[60, :] == pytest.approx(np.full(160, 3.0))


def test_noise_grows_with_the_square_of_the_depth_and_some_pixels_are_lost() -> None:
    """1.425e-3 z^2: 6 mm at 2 m, 23 mm at 4 m; one pixel of a hundred is 0; beyond 9 m nothing."""
    for distance_m in (2.0, 4.0):
        wall = scene.of_walls(np.array([[distance_m, -20.0, distance_m, 20.0]]))
        image = DepthRenderer(camera(mount_height_m=1.2), wall).image(
            Pose2D(), NOBODY, np.random.default_rng(2)
        )
        depth_m = image[40:70].astype(float) / 1000
        assert (depth_m == 0).mean() == pytest.approx(0.01, abs=0.004)
        assert depth_m[depth_m > 0].std() == pytest.approx(1.425e-3 * distance_m**2, rel=0.1)
    far = DepthRenderer(camera(), scene.of_walls(np.array([[9.5, -30.0, 9.5, 30.0]])))
    assert (far.image(Pose2D(), NOBODY, np.random.default_rng(2))[60] == 0).all()
