"""A map of a ROS 2 bag, against the map of the recording that the bag was exported from."""

from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chefbot_ros2.from_bag import map_events
from chefbot_ros2.messages import TYPESTORE
from click.testing import CliRunner, Result
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from test_bag import ODOMETRY, export, recording

from chefbotd.cli.programs.chefbotctl import main
from chefbotd.components.maps.storage.contents import read_grid, read_slam
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.occupancy_grid import OccupancyGrid
from tests.chefbotd.components.worker.skills.drives import measured, measured_by_two

SCANS = 60


@pytest.fixture(scope="module")
def drive() -> list[Any]:
    """Six seconds in the simulated flat."""
    return list(measured(0, SCANS))


@pytest.fixture(scope="module")
def bag(drive: list[Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its recording, exported."""
    folder = tmp_path_factory.mktemp("drive")
    result = export(recording(folder, drive), folder / "bag")
    assert result.exit_code == 0, result.output
    return folder / "bag"


def from_bag(bag: Path, folder: Path, *words: str) -> Result:
    """``chefbotctl map from-bag``."""
    return CliRunner().invoke(main, ["map", "from-bag", str(bag), "flat", "--folder", str(folder), *words])


def stored(folder: Path) -> OccupancyGrid:
    """The map."""
    return read_grid(MapStore(folder, 3), "flat")


def share_of_equal_cells(one: OccupancyGrid, other: OccupancyGrid) -> float:
    """Of the cells that either knows."""
    assert one.percent.shape == other.percent.shape
    assert one.map_from_grid == other.map_from_grid
    known = (one.percent >= 0) | (other.percent >= 0)
    assert known.sum() > 1000
    return float((one.percent == other.percent)[known].mean())


def without(bag: Path, prefix: str, folder: Path) -> Path:
    """A copy without the topics of a prefix."""
    with Reader(bag) as reader, Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kept = [each for each in reader.connections if not each.topic.startswith(prefix)]
        copies = {
            each.id: writer.add_connection(each.topic, each.msgtype, typestore=TYPESTORE) for each in kept
        }
        for connection, stamp_ns, data in reader.messages(kept):
            writer.write(copies[connection.id], stamp_ns, data)
    return folder


def test_a_bag_gives_the_map_of_its_recording(drive: list[Any], bag: Path, tmp_path: Path) -> None:
    """Cell for cell, with SLAM's state to go on from; a second time it is the next version."""
    saved = map_events(drive, tmp_path / "own", "flat").saved
    result = from_bag(bag, tmp_path / "maps")
    assert result.exit_code == 0, result.output
    assert result.output == f"Saved flat, version 1: {saved.keyframes} scans on {saved.path_m:.0f} m.\n"
    assert share_of_equal_cells(stored(tmp_path / "own"), stored(tmp_path / "maps")) == 1.0
    states = [read_slam(MapStore(tmp_path / folder, 3), "flat") for folder in ("own", "maps")]
    assert states[0] is not None
    assert states[1] is not None
    assert states[0].keys() == states[1].keys()
    assert "version 2" in from_bag(bag, tmp_path / "maps").output


def test_laser_scans_of_any_robot_are_enough(drive: list[Any], bag: Path, tmp_path: Path) -> None:
    """With 32-bit ranges on even bearings a cell here and there differs."""
    map_events(drive, tmp_path / "own", "flat")
    result = from_bag(
        without(bag, "/points/", tmp_path / "foreign"), tmp_path / "maps", "--scans", "/scan/top"
    )
    assert result.exit_code == 0, result.output
    assert share_of_equal_cells(stored(tmp_path / "own"), stored(tmp_path / "maps")) > 0.98


def test_what_is_missing_in_a_bag_is_said(drive: list[Any], bag: Path, tmp_path: Path) -> None:
    """Odometry, scans, a topic, the lidar's place, the bag itself; no map is left behind."""
    folder = tmp_path / "maps"
    blind = export(recording(tmp_path / "blind", [ODOMETRY]), tmp_path / "blind_bag")
    assert blind.exit_code == 0
    scans = list(takewhile(lambda event: isinstance(event, ScanMeasured), drive[1:]))
    deaf = export(recording(tmp_path / "deaf", scans), tmp_path / "deaf_bag")
    assert deaf.exit_code == 0
    cases = {
        "no nav_msgs/msg/Odometry": (tmp_path / "deaf_bag",),
        "no sensor_msgs/msg/LaserScan": (tmp_path / "blind_bag",),
        "no scans on /scan/front": (bag, "--scans", "/scan/front"),
        "no transform from base_footprint to top_link": (without(bag, "/tf_static", tmp_path / "frameless"),),
        "there is no such file or folder": (tmp_path / "nowhere",),
    }
    for message, (path, *words) in cases.items():
        result = from_bag(path, folder, *words)
        assert result.exit_code == 1, message
        assert message in result.stderr
    assert not list(folder.glob("flat*"))


def test_each_lidar_of_a_drive_is_used(tmp_path: Path) -> None:
    """Two that see one half each give one map: with one alone, less is known."""
    events = list(measured_by_two(0, 30))
    map_events(events, tmp_path / "both", "flat")
    map_events([each for each in events if getattr(each, "lidar", "") != "rear"], tmp_path / "one", "flat")
    known = [int(np.count_nonzero(stored(tmp_path / folder).percent >= 0)) for folder in ("both", "one")]
    assert known[0] > 1.2 * known[1]
