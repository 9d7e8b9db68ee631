"""A recording as a ROS 2 bag, read back by a decoder of others (mcap_ros2)."""

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from chefbotd.cli.programs.chefbotctl import main
from chefbotd.components.recording.chunk import Channels
from chefbotd.components.recording.chunk_encoder import ChunkEncoder
from chefbotd.components.recording.parameters import RecordingParameters
from chefbotd.components.recording.recorder import Recorder
from chefbotd.components.recording.status import About
from chefbotd.core.events import (
    BatteryLevelStatus,
    BatteryMeasured,
    ImuMeasured,
    OdometryReset,
    OdometryUpdated,
    RangeMeasured,
    WheelsMeasured,
)
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import RangeStatus
from chefbotd.core.geometry import Pose2D, PoseCovariance, Twist2D
from chefbotd.core.scan import LaserScan

OFFSET_NS = 1_700_000_000_250_000_000
STAMP_S = 5000.123456789
NS = 1e-9
CONFIGURATION = {"chassis": {"wheels": [{"name": "left_wheel"}, {"name": "right_wheel"}]}}

ODOMETRY = OdometryUpdated(
    STAMP_S,
    STAMP_S,
    Pose2D(1.234567890123, -0.1, math.pi / 2),
    Twist2D(0.2, -0.3),
    PoseCovariance(1e-4, 2e-5, 3e-5, 4e-4, 5e-5, 6e-4),
)
BEARINGS = np.array([-0.2, -0.1, 0.0, 0.1, 0.2])
RANGES = np.array([1.0, 0.0, 3.000000000001, np.inf, 2.0])
AFTER = np.array([-0.04, -0.03, -0.02, -0.01, 0.0])


def recording(folder: Path, events: list[Any]) -> Path:
    """A recording of these events."""
    encoder = ChunkEncoder(Channels(), OFFSET_NS, None, 1.0, STAMP_S)
    about = About({"configuration": {"json": json.dumps(CONFIGURATION)}}, None)
    recorder = Recorder(RecordingParameters(), folder, encoder.channels, OFFSET_NS, about=lambda: about)
    recorder.start("drive", STAMP_S)
    encoder.encode(events)
    chunk = encoder.cut(STAMP_S + 1.0)
    assert chunk is not None
    recorder.record(chunk, STAMP_S + 1.0)
    recorder.stop(STAMP_S + 1.0)
    (path,) = folder.glob("*.mcap")
    return path


def export(path: Path, bag: Path) -> Any:
    """``chefbotctl log export --ros2``."""
    return CliRunner().invoke(main, ["log", "export", str(path), "--ros2", str(bag)])


def read_back(bag: Path) -> dict[str, Any]:
    """The last message of each topic, by the other decoder."""
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}


@pytest.fixture
def bag(tmp_path: Path) -> dict[str, Any]:
    """One event of each kind, written as a bag and read back."""
    both = {"stamp_s": STAMP_S, "arrival_s": STAMP_S}
    events = [
        ODOMETRY,
        WheelsMeasured(STAMP_S, STAMP_S, 1.0, (0.125, -7.1), (0.01, 0.02), (3.3, -2.2)),
        ImuMeasured(angular_velocity_rad_s=(0.1, 0.2, 0.3), **both),
        RangeMeasured(STAMP_S, STAMP_S, "front", RangeStatus.OK, 1.25, 0.02, 4.0, 0.26),
        RangeMeasured(STAMP_S, STAMP_S, "infrared_left", RangeStatus.NO_ECHO, None, 0.2, 1.5, 0.1),
        BatteryMeasured(12.25, 80.0, BatteryLevelStatus.OK, **both),
        ScanMeasured(STAMP_S, "top", Pose2D(0.1, 0.0, math.pi), LaserScan(STAMP_S, BEARINGS, RANGES, AFTER)),
    ]
    result = export(recording(tmp_path, events), tmp_path / "bag")
    assert result.exit_code == 0, result.output
    assert "Wrote 10 messages on 10 topics" in result.output
    return read_back(tmp_path / "bag")


def stamp_ns(message: Any) -> int:
    """The header's stamp."""
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def test_odometry_and_its_transform_are_equal_to_the_recording_to_1e_9(bag: dict[str, Any]) -> None:
    """Pose, twist, covariance in the rows of x, y and the turn about z, frames of REP-105, and the stamp."""
    odom, (transform,) = bag["/odom"], bag["/tf"].transforms
    at = odom.pose.pose
    assert (at.position.x, at.position.y) == pytest.approx((1.234567890123, -0.1), abs=NS)
    assert (at.orientation.z, at.orientation.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)), abs=NS)
    matrix = np.reshape(odom.pose.covariance, (6, 6))
    assert (matrix[0, 0], matrix[0, 1], matrix[0, 5]) == pytest.approx((1e-4, 2e-5, 3e-5), abs=NS)
    assert (matrix[1, 1], matrix[1, 5], matrix[5, 5]) == pytest.approx((4e-4, 5e-5, 6e-4), abs=NS)
    assert np.array_equal(matrix, matrix.T)
    assert (odom.twist.twist.linear.x, odom.twist.twist.angular.z) == pytest.approx((0.2, -0.3), abs=NS)
    assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "base_footprint")
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_footprint")
    assert transform.transform.translation.x == at.position.x
    assert stamp_ns(odom) == OFFSET_NS + 5000_123_456_789


def test_joint_states_have_the_names_of_the_recorded_configuration(bag: dict[str, Any]) -> None:
    """Position in rad, velocity in rad/s."""
    joints = bag["/joint_states"]
    assert list(joints.name) == ["left_wheel", "right_wheel"]
    assert list(joints.position) == pytest.approx([0.125, -7.1], abs=NS)
    assert list(joints.velocity) == pytest.approx([3.3, -2.2], abs=NS)


def test_what_the_imu_does_not_measure_is_marked(bag: dict[str, Any]) -> None:
    """sensor_msgs/Imu: -1 in the first element of the covariance."""
    imu = bag["/imu"]
    assert (imu.angular_velocity.x, imu.angular_velocity.z) == pytest.approx((0.1, 0.3), abs=NS)
    unknown = imu.orientation_covariance[0], imu.linear_acceleration_covariance[0]
    assert unknown == (-1.0, -1.0)
    assert imu.angular_velocity_covariance[0] == 0.0


def test_ranges_and_battery_are_within_32_bit_floats(bag: dict[str, Any]) -> None:
    """No echo is infinite (REP-117)."""
    front, left = bag["/ranges/front"], bag["/ranges/infrared_left"]
    assert (front.range, front.radiation_type) == (1.25, 0)
    assert (left.range, left.radiation_type) == (math.inf, 1)
    assert bag["/battery"].voltage == 12.25
    assert bag["/battery"].percentage == pytest.approx(0.8, abs=1e-7)


def test_a_turn_is_there_as_it_was_measured_and_on_even_bearings(bag: dict[str, Any]) -> None:
    """The points hold x, y and time of the three readings to 1e-9; the scan has a place for each of the five beams."""
    points = bag["/points/top"]
    values = np.frombuffer(bytes(points.data), dtype="<f8").reshape(-1, 4)
    seen = np.array([0, 2, 4])
    assert values[:, 0] == pytest.approx(RANGES[seen] * np.cos(BEARINGS[seen]), abs=NS)
    assert values[:, 1] == pytest.approx(RANGES[seen] * np.sin(BEARINGS[seen]), abs=NS)
    assert values[:, 3] == pytest.approx(AFTER[seen], abs=NS)
    scan = bag["/scan/top"]
    assert list(scan.ranges) == [1.0, math.inf, 3.0, math.inf, 2.0]
    assert (scan.angle_min, scan.angle_increment) == pytest.approx((-0.2, 0.1), abs=1e-7)
    assert stamp_ns(scan) == stamp_ns(points) - 40_000_000
    (mount,) = bag["/tf_static"].transforms
    assert (mount.header.frame_id, mount.child_frame_id) == ("base_footprint", "top_link")
    assert mount.transform.rotation.z == pytest.approx(1.0, abs=NS)


def test_a_bag_that_is_there_is_not_overwritten(tmp_path: Path) -> None:
    """With its name."""
    (tmp_path / "bag").mkdir()
    result = export(recording(tmp_path, [ODOMETRY]), tmp_path / "bag")
    assert result.exit_code == 1
    assert "bag" in result.stderr


def test_a_recording_with_nothing_for_a_bag_is_said(tmp_path: Path) -> None:
    """No folder is left behind."""
    result = export(recording(tmp_path, [OdometryReset(STAMP_S, Pose2D(), Pose2D())]), tmp_path / "bag")
    assert result.exit_code == 1
    assert "has nothing that a bag holds" in result.stderr
    assert not (tmp_path / "bag").exists()


def test_one_kind_of_export_is_asked_for(tmp_path: Path) -> None:
    """Neither, or both, is a mistake."""
    path = recording(tmp_path, [ODOMETRY])
    for words in ([], ["--csv", "a", "--ros2", "b"]):
        result = CliRunner().invoke(main, ["log", "export", str(path), *words])
        assert result.exit_code == 2
        assert "expected one of --csv FOLDER and --ros2 FOLDER" in result.stderr


def test_without_the_package_its_installation_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 7, as for any missing part."""
    for name in [name for name in sys.modules if name.startswith("chefbot_ros2")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "chefbot_ros2", None)
    result = export(recording(tmp_path, [ODOMETRY]), tmp_path / "bag")
    assert result.exit_code == 7
    assert "pip install ./addons/chefbot-ros2" in result.stderr
