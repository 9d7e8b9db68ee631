"""Depth images of planes and boxes, rendered ray by ray, against the ranges that geometry gives."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest
from pydantic import ValidationError

from chefbotd.components.depth_camera.algorithms.depth_scan import (
    INVALID_MM,
    DepthCameraParameters,
    DepthScan,
    DepthToScan,
)

Image = npt.NDArray[np.uint16]
SMALL = {
    "width": 160,
    "height": 120,
    "focal_x_px": 146.0,
    "focal_y_px": 146.0,
    "center_x_px": 80.0,
    "center_y_px": 60.0,
}
TILTED = {"mount_pitch_rad": 0.25, "mount_roll_rad": -0.08, "mount_height_m": 0.42}


@dataclass(frozen=True)
class Box:
    """A box on the level frame's axes: from one corner to the other, metres above the floor."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]


WALL = Box((2.0, -50.0, -1.0), (2.5, 50.0, 50.0))


def camera(**changes: float) -> DepthCameraParameters:
    """A small camera of the Kinect's opening, with 40 beams."""
    return DepthCameraParameters(**{**SMALL, "beams": 40, **changes})  # type: ignore[arg-type]


def render(p: DepthCameraParameters, boxes: Sequence[Box], floor: bool = True) -> npt.NDArray[np.float64]:
    """Depth in metres of each pixel by plane intersections, with rotations written as matrices; inf where nothing is."""
    cos, sin = math.cos(p.mount_pitch_rad), math.sin(p.mount_pitch_rad)
    pitch = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    cos, sin = math.cos(p.mount_roll_rad), math.sin(p.mount_roll_rad)
    roll = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    v, u = np.mgrid[0 : p.height, 0 : p.width]
    rays = np.stack(
        [np.ones(u.shape), (p.center_x_px - u) / p.focal_x_px, (p.center_y_px - v) / p.focal_y_px], axis=-1
    )
    rays = rays @ (pitch @ roll).T
    origin = np.array([0.0, 0.0, p.mount_height_m])
    depth = np.full(u.shape, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        if floor:
            depth = np.where(rays[..., 2] < 0, -p.mount_height_m / rays[..., 2], np.inf)
        for box in boxes:
            to_low, to_high = (np.array(box.low) - origin) / rays, (np.array(box.high) - origin) / rays
            enters = np.nanmax(np.minimum(to_low, to_high), axis=-1)
            leaves = np.nanmin(np.maximum(to_low, to_high), axis=-1)
            depth = np.where((enters <= leaves) & (enters > 0), np.minimum(depth, enters), depth)
    return depth


def image_of(depth_m: npt.NDArray[np.float64]) -> Image:
    """As the camera sends it: whole millimetres, 0 beyond 60 m."""
    return np.where(depth_m < 60, np.rint(np.minimum(depth_m, 60) * 1000), 0).astype(np.uint16)


def scan(p: DepthCameraParameters, *boxes: Box) -> DepthScan:
    """The scan of a rendered image."""
    return DepthToScan(p).scan(image_of(render(p, boxes)))


def test_a_wall_across_the_view_is_its_distance_over_the_cosine_of_the_bearing() -> None:
    """Two metres ahead: 2.00 m in the middle, 2.28 m at 28.7 degrees; a beam has the nearest of its pixels."""
    found = scan(camera(), WALL)
    half_beam = (found.bearing_rad[1] - found.bearing_rad[0]) / 2
    nearest = 2.0 / np.cos(np.maximum(np.abs(found.bearing_rad) - half_beam, 0))
    farthest = 2.0 / np.cos(np.abs(found.bearing_rad) + half_beam)
    assert np.all(found.range_m >= nearest - 0.002)
    assert np.all(found.range_m <= farthest + 0.002)
    assert found.clear_m == pytest.approx(found.range_m)
    assert found.bearing_rad[0] == pytest.approx(-0.497, abs=0.02)  # from right to left, CCW positive


def test_left_is_left() -> None:
    """A post between 0.5 and 0.7 m to the left at 1.5 m is seen at bearings of 18 to 25 degrees, and nowhere else."""
    found = scan(camera(**TILTED), Box((1.5, 0.5, 0.0), (1.52, 0.7, 1.2)))
    seen = np.flatnonzero(np.isfinite(found.range_m))
    bearings = np.degrees(found.bearing_rad[seen])
    assert bearings.min() == pytest.approx(math.degrees(math.atan2(0.5, 1.5)), abs=2)
    assert bearings.max() == pytest.approx(math.degrees(math.atan2(0.7, 1.5)), abs=2)
    expected = 1.5 / np.cos(found.bearing_rad[seen])
    assert found.range_m[seen] == pytest.approx(expected, abs=0.04)


@pytest.mark.parametrize("mount", [{}, TILTED, {"mount_pitch_rad": 0.5, "mount_roll_rad": 0.1}])
def test_the_floor_is_no_obstacle_and_tells_how_far_it_is_clear(mount: dict[str, float]) -> None:
    """Whatever the pitch and roll: no beam takes it for an obstacle. The outermost ones see the image's corners only."""
    found = scan(camera(**mount))
    assert np.all(np.isinf(found.range_m))
    assert np.all(found.clear_m[3:-6] > 1.0)


@pytest.mark.parametrize("seed", range(5))
def test_the_floor_stays_no_obstacle_through_noise_and_a_mount_that_is_slightly_off(seed: int) -> None:
    """Depth noise of 1.425e-3 z^2 and half a degree more pitch than configured; a wall behind it is still seen."""
    p = camera(**TILTED)
    real = p.model_copy(update={"mount_pitch_rad": p.mount_pitch_rad + 0.008})
    depth = render(real, [Box((3.0, -50.0, 0.0), (3.5, 50.0, 2.0))])
    noise = np.random.default_rng(seed).standard_normal(depth.shape) * 1.425e-3
    found = DepthToScan(p).scan(image_of(depth + noise * depth**2))
    assert np.all(found.range_m > 2.8)
    assert np.all(np.isfinite(found.range_m[4:-4]))


def test_a_table_s_top_is_an_obstacle_though_its_legs_are_not_in_view() -> None:
    """Its edge, at 1.4 m and 0.72 m high, is lower than the robot's top: a lidar at 0.2 m would pass beneath."""
    found = scan(camera(mount_height_m=0.6, mount_pitch_rad=0.1), Box((1.4, -0.6, 0.69), (2.2, 0.6, 0.72)))
    middle = np.abs(found.bearing_rad) < 0.3
    assert found.range_m[middle] == pytest.approx(1.4 / np.cos(found.bearing_rad[middle]), abs=0.03)


def test_what_is_above_the_robot_is_no_obstacle() -> None:
    """A lamp at 1.05 m over a robot whose band ends at 1 m; at 0.95 m it would hit."""
    hanging = scan(camera(mount_height_m=0.9), Box((1.5, -0.4, 1.05), (1.9, 0.4, 1.2)))
    low = scan(camera(mount_height_m=0.9), Box((1.5, -0.4, 0.95), (1.9, 0.4, 1.2)))
    assert np.all(np.isinf(hanging.range_m))
    assert low.range_m.min() == pytest.approx(1.5, abs=0.01)


def test_a_camera_above_the_band_looks_down_into_it() -> None:
    """Mounted at 1.3 m and pitched by 0.6 rad it sees a box of 0.4 m, and not the wall's part above the band."""
    p = camera(mount_height_m=1.3, mount_pitch_rad=0.6)
    found = scan(p, Box((1.5, -0.2, 0.0), (1.8, 0.2, 0.4)), Box((6.0, -50.0, 1.1), (6.5, 50.0, 3.0)))
    assert found.range_m.min() == pytest.approx(1.5, abs=0.02)
    assert np.isinf(found.range_m[:8]).all()


def test_a_threshold_is_passed_over_and_a_step_is_not() -> None:
    """At 1.2 m: 2 cm are below the band, 8 cm are in it."""
    p = camera(mount_height_m=0.3, mount_pitch_rad=0.2)
    assert np.all(np.isinf(scan(p, Box((1.2, -50.0, 0.0), (9.0, 50.0, 0.02))).range_m))
    step = scan(p, Box((1.2, -50.0, 0.0), (9.0, 50.0, 0.08)))
    assert step.range_m[20] == pytest.approx(1.2, abs=0.02)


def test_where_nothing_is_read_nothing_is_known() -> None:
    """Holes, and the mark of drivers that send 65535, are neither obstacle nor free."""
    p = camera()
    image = image_of(render(p, [WALL]))
    image[:, :40] = 0
    image[:, 40:80] = INVALID_MM
    found = DepthToScan(p).scan(image)
    assert np.all(np.isinf(found.range_m[21:]))
    assert np.all(found.clear_m[21:] == 0.0)
    assert np.all(np.isfinite(found.range_m[:19]))


def test_a_lone_near_pixel_is_noise() -> None:
    """A flying pixel at 0.7 m before a wall at 2 m does not stop the robot; two rows of a thin bar do."""
    p = camera()
    image = image_of(render(p, [WALL]))
    image[60, 80] = 700
    assert DepthToScan(p).scan(image).range_m.min() > 1.9
    image[60:62, 70:90] = 700
    assert DepthToScan(p).scan(image).range_m.min() == pytest.approx(0.7, abs=0.01)


def test_too_near_and_too_far_are_not_reported() -> None:
    """A wall at 0.38 m, below 0.45 m, and one at 4.5 m, beyond 4 m."""
    for distance_m in (0.38, 4.5):
        wall = Box((distance_m, -50.0, 0.0), (distance_m + 1, 50.0, 3.0))
        assert np.all(np.isinf(scan(camera(), wall).range_m))


@pytest.mark.parametrize(
    "image", [np.zeros((120, 161), np.uint16), np.zeros((120, 160), np.int32), np.zeros(19200, np.uint16)]
)
def test_another_camera_s_image_is_refused(image: npt.NDArray[np.uint16]) -> None:
    """The message tells what was expected, and what came."""
    with pytest.raises(ValueError, match=r"120 rows and 160 columns of uint16, got"):
        DepthToScan(camera()).scan(image)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"min_height_m": 1.2}, "min_height_m must be below max_height_m"),
        ({"min_range_m": 5.0}, "min_range_m must be below max_range_m"),
        ({"mount_height_m": 0.02}, "mounted above min_height_m"),
        ({"focal_x_px": 0.0}, "greater than 0"),
    ],
)
def test_parameters_that_make_no_scan_are_refused(changes: dict[str, float], told: str) -> None:
    """Each by what is wrong with it."""
    with pytest.raises(ValidationError, match=told):
        camera(**changes)
