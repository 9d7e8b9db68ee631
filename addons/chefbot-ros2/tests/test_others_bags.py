"""Bags as other people have them: frames that are missing or named otherwise, lidars that hang, drivers' own numbers."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from chefbot_ros2.bag_frames import CannotPlaceError, Frames
from chefbot_ros2.bag_scans import no_return_m, scan_of
from chefbot_ros2.messages import TYPESTORE
from click.testing import CliRunner, Result
from rosbags.rosbag2 import StoragePlugin, Writer

from chefbotd.cli.programs.chefbotctl import main

# frames


def turned(roll: float, pitch: float, yaw: float) -> SimpleNamespace:
    """A quaternion of turns about the fixed axes x, y and z, in this order."""
    sr, cr = math.sin(roll / 2), math.cos(roll / 2)
    sp, cp = math.sin(pitch / 2), math.cos(pitch / 2)
    sy, cy = math.sin(yaw / 2), math.cos(yaw / 2)
    return SimpleNamespace(
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
        w=cr * cp * cy + sr * sp * sy,
    )


def frames(*rows: tuple[str, str, tuple[float, float, float], tuple[float, float, float]]) -> Frames:
    """Parent, child, where it is, and how it is turned (roll, pitch, yaw)."""
    tree = Frames()
    transforms = [
        SimpleNamespace(
            child_frame_id=child,
            header=SimpleNamespace(frame_id=parent),
            transform=SimpleNamespace(
                translation=SimpleNamespace(x=at[0], y=at[1], z=at[2]), rotation=turned(*angles)
            ),
        )
        for parent, child, at, angles in rows
    ]
    tree.add(SimpleNamespace(transforms=transforms))
    return tree


LEVEL = (0.0, 0.0, 0.0)
MOVING = ("odom", "base_link", (3.0, 4.0, 0.0), (0.0, 0.0, 1.0))


def test_a_lidar_sits_where_its_chain_says() -> None:
    """Two transforms, the first turned by a quarter: 0.1 m ahead of the plate is 0.1 m to the left of the base."""
    tree = frames(
        MOVING,
        ("base_link", "plate", (0.2, 0.0, 0.1), (0.0, 0.0, math.pi / 2)),
        ("plate", "laser", (0.1, 0.0, 0.0), LEVEL),
    )
    mount = tree.mount("base_link", "laser", "odom")
    assert (mount.place.x_m, mount.place.y_m) == pytest.approx((0.2, 0.1))
    assert mount.place.heading_rad == pytest.approx(math.pi / 2)
    assert not mount.upside_down


def test_a_footprint_below_the_base_is_joined_above_it() -> None:
    """``base_footprint`` is the child of ``base_link``, 5 cm below it, and the lidar another child."""
    tree = frames(
        MOVING,
        ("base_link", "base_footprint", (0.02, 0.0, -0.05), LEVEL),
        ("base_link", "laser", (0.1, 0.0, 0.1), LEVEL),
    )
    place = tree.mount("base_footprint", "laser", "odom").place
    assert (place.x_m, place.y_m) == pytest.approx((0.08, 0.0))


def test_slashes_before_names_are_those_of_ros_1() -> None:
    """They name the same frames."""
    tree = frames(
        ("/odom", "/base_link", (0.0, 0.0, 0.0), LEVEL), ("/base_link", "/laser", (0.1, 0.0, 0.0), LEVEL)
    )
    assert tree.mount("base_link", "laser", "odom").place.x_m == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("named", "base"), [("base_link", "base_link"), ("", "base_link"), ("base_footprint", "base_link")]
)
def test_the_robot_s_frame_is_odometry_s_child(named: str, base: str) -> None:
    """As odometry names it; where it names none, or one that no transform knows, as tf has it."""
    assert frames(MOVING, ("base_link", "laser", (0.1, 0.0, 0.0), LEVEL)).base_of("odom", named) == base


@pytest.mark.parametrize("roll", [math.pi, -math.pi, math.pi - 0.05])
def test_a_lidar_that_hangs_is_upside_down(roll: float) -> None:
    """Rolled by half a turn about its own x axis, which still points ahead."""
    mount = frames(MOVING, ("base_link", "laser", (0.1, 0.0, 0.2), (roll, 0.0, 0.0))).mount(
        "base_link", "laser", "odom"
    )
    assert mount.upside_down
    assert mount.place.heading_rad == pytest.approx(0.0, abs=1e-6)


def test_a_lidar_pitched_over_backwards_is_upside_down_and_looks_behind() -> None:
    """Half a turn about y: x points backwards."""
    mount = frames(MOVING, ("base_link", "laser", (0.1, 0.0, 0.2), (0.0, math.pi, 0.0))).mount(
        "base_link", "laser", "odom"
    )
    assert mount.upside_down
    assert abs(mount.place.heading_rad) == pytest.approx(math.pi)


@pytest.mark.parametrize("tilt", [(0.2, 0.0, 0.0), (0.0, -0.3, 1.0), (math.pi / 2, 0.0, 0.0)])
def test_a_tilted_lidar_is_refused(tilt: tuple[float, float, float]) -> None:
    """Its scans are no plan of the floor; the message has the angle."""
    tree = frames(MOVING, ("base_link", "laser", (0.1, 0.0, 0.2), tilt))
    with pytest.raises(CannotPlaceError, match=r"tilted by (11|17|90) degrees"):
        tree.mount("base_link", "laser", "odom")


def test_frames_in_a_circle_end() -> None:
    """A broken tree is no endless loop: it does not join."""
    tree = frames(("a", "b", (0.0, 0.0, 0.0), LEVEL), ("b", "a", (0.0, 0.0, 0.0), LEVEL))
    with pytest.raises(CannotPlaceError, match="no transform"):
        tree.mount("base_link", "a", "odom")


# readings


def message(ranges: list[float], range_max: float, range_min: float = 0.1) -> SimpleNamespace:
    """A LaserScan of four beams a quarter apart, and more."""
    return SimpleNamespace(
        ranges=np.array(ranges, dtype=np.float32),
        angle_min=0.0,
        angle_increment=math.pi / 2,
        time_increment=0.0,
        range_min=range_min,
        range_max=range_max,
    )


def read(scan: SimpleNamespace, **options: Any) -> list[float]:
    """The ranges that are readings; 0: none."""
    return [
        round(float(value), 3)
        for value in scan_of(scan, 0.0, **{"upside_down": False, "no_return": None, **options}).range_m
    ]


def test_what_is_no_reading_is_none() -> None:
    """At range_max, above it, infinite, none, negative, below range_min, and no number."""
    ranges = [1.0, 5.0, 65.535, math.inf, 0.0, -1.0, 0.05, math.nan, 4.99]
    assert read(message(ranges, 5.0)) == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.99]


@pytest.mark.parametrize("range_max", [0.0, math.inf, math.nan, -1.0, 0.05])
def test_a_limit_that_makes_no_sense_is_none(range_max: float) -> None:
    """A driver that leaves range_max at 0 has readings all the same."""
    assert read(message([1.0, 70.0, math.inf], range_max)) == [1.0, 70.0, 0.0]


def test_bearings_of_a_hanging_lidar_turn_the_other_way() -> None:
    """Its second beam, a quarter to the left for itself, is one to the right."""
    scan = scan_of(message([1.0, 2.0, 3.0, 4.0], 5.0), 0.0, upside_down=True, no_return=None)
    assert list(scan.bearing_rad) == pytest.approx([0.0, -math.pi / 2, -math.pi, -1.5 * math.pi])


def test_a_scan_that_runs_clockwise_is_read_by_its_increment() -> None:
    """angle_max below angle_min, as an RPLIDAR's driver wrote it: the second beam is a quarter to the right."""
    clockwise = message([1.0, 2.0, 3.0, 4.0], 5.0)
    clockwise.angle_min, clockwise.angle_increment = math.pi, -math.pi / 2
    scan = scan_of(clockwise, 0.0, upside_down=False, no_return=None)
    assert list(scan.bearing_rad) == pytest.approx([math.pi, math.pi / 2, 0.0, -math.pi / 2])
    assert list(scan.range_m) == [1.0, 2.0, 3.0, 4.0]


def test_the_same_number_just_below_range_max_again_and_again_is_no_return() -> None:
    """A third of the beams see nothing, and the driver writes 11.99 of 12 m for each."""
    noise = np.random.default_rng(1)
    scans = [message([*noise.uniform(0.5, 8.0, 200), *[11.99] * 100], 12.0) for _ in range(20)]
    found = no_return_m(scans)
    assert found == float(np.float32(11.99))
    assert read(message([1.0, 11.99, 11.95], 12.0), no_return=found) == [1.0, 0.0, 11.95]


def test_a_wall_just_below_range_max_is_a_wall() -> None:
    """Its readings scatter by millimetres; nor is it "no return" where a lidar counts whole centimetres."""
    noise = np.random.default_rng(1)
    far = [message(list(noise.normal(11.9, 0.01, 300).clip(0, 11.999)), 12.0) for _ in range(20)]
    coarse = [
        message(list(np.round(noise.normal(11.9, 0.02, 300), 2).clip(0, 11.99)), 12.0) for _ in range(20)
    ]
    assert no_return_m(far) is None
    assert no_return_m(coarse) is None


# whole bags


def bag(folder: Path, *, topics: dict[str, str]) -> Path:
    """A bag with topics, and no message in them."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, kind in topics.items():
            writer.add_connection(topic, kind, typestore=TYPESTORE)
    return folder


def from_bag(path: Path, folder: Path, *words: str) -> Result:
    """``chefbotctl map from-bag``."""
    return CliRunner().invoke(main, ["map", "from-bag", str(path), "room", "--folder", str(folder), *words])


SCAN, ODOMETRY = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"


@pytest.mark.parametrize(
    ("topics", "told"),
    [
        ({}, "the bag has no sensor_msgs/msg/LaserScan: it is empty"),
        ({"/odom": ODOMETRY}, "the bag has no sensor_msgs/msg/LaserScan: it has /odom"),
        ({"/scan": SCAN}, "the bag has no nav_msgs/msg/Odometry: it has /scan"),
        ({"/scan": SCAN, "/odom": ODOMETRY}, "there is no scan with odometry"),
    ],
)
def test_what_a_bag_lacks_is_told_with_what_it_has(tmp_path: Path, topics: dict[str, str], told: str) -> None:
    """One sentence, exit code 1, and no traceback."""
    result = from_bag(bag(tmp_path / "bag", topics=topics), tmp_path / "maps")
    assert result.exit_code == 1
    assert told in result.output
    assert "Traceback" not in result.output


def test_a_damaged_bag_is_told(tmp_path: Path) -> None:
    """Whatever the reader's library raises."""
    path = bag(tmp_path / "bag", topics={"/scan": SCAN, "/odom": ODOMETRY})
    for file in path.glob("*.mcap"):
        file.write_bytes(file.read_bytes()[:40] + b"\xff" * 60)
    result = from_bag(path, tmp_path / "maps")
    assert result.exit_code == 1
    assert "cannot be read" in result.output
    assert "Traceback" not in result.output


def test_upside_down_needs_a_mount(tmp_path: Path) -> None:
    """Alone it would say half of a place."""
    result = from_bag(bag(tmp_path / "bag", topics={}), tmp_path / "maps", "--upside-down")
    assert result.exit_code == 2
    assert "--mount" in result.output
