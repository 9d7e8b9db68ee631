"""What viewers draw, against numbers worked out by hand."""

import base64
import json
import math
import zlib
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader

from chefbotd.components.maps.events import MapChanged, MapLoaded
from chefbotd.components.navigation.events import PathChanged
from chefbotd.core.events import OdometryUpdated, SafetyChanged
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import MapPoseUpdated
from chefbotd.core.geometry import CERTAIN, Pose2D, Twist2D
from chefbotd.core.scan import LaserScan
from tests.chefbotd.components.recording.events import START_S, WALL_S, SyncRecorder, fault, recorder

HALF = math.sqrt(0.5)


def drawn(folder: Path, *events: Any, made: SyncRecorder | None = None) -> dict[str, list[Any]]:
    """The messages of these events by topic, each held against its schema."""
    made = made or recorder(folder)
    made.start("drawn", START_S)
    made.record(events, START_S)
    made.stop(START_S + 1.0)
    found: dict[str, list[Any]] = {}
    with next(folder.glob("*.mcap")).open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
            assert schema is not None
            value = json.loads(message.data)
            jsonschema.validate(value, json.loads(schema.data))
            found.setdefault(f"{channel.topic} {schema.name}", []).append(value)
    return found


def odometry(stamp_s: float, pose: Pose2D) -> OdometryUpdated:
    """Dead reckoning."""
    return OdometryUpdated(stamp_s, stamp_s, pose, Twist2D(0.2, 0.0), CERTAIN)


def test_the_robot_is_drawn_in_odom_and_once_it_knows_the_map_in_it(tmp_path: Path) -> None:
    """map_from_odom turns left by 90 degrees at (2, 1): (1, 0.5) in odom is (2 - 0.5, 1 + 1) in the map."""
    found = drawn(
        tmp_path,
        odometry(START_S, Pose2D(1.0, 0.5, 0.0)),
        MapPoseUpdated(START_S + 0.1, Pose2D(), Pose2D(2.0, 1.0, math.pi / 2), CERTAIN, 0.9, "localized"),
        odometry(START_S + 0.1, Pose2D(1.0, 0.5, 0.0)),
    )
    first, second = found["/pose foxglove.PoseInFrame"]
    assert (first["frame_id"], first["pose"]["position"]) == ("odom", {"x": 1.0, "y": 0.5, "z": 0.0})
    assert second["frame_id"] == "map"
    assert second["pose"]["position"] == pytest.approx({"x": 1.5, "y": 2.0, "z": 0.0})
    assert second["pose"]["orientation"] == pytest.approx({"x": 0.0, "y": 0.0, "z": HALF, "w": HALF})
    (alone,), both = (each["transforms"] for each in found["/tf foxglove.FrameTransforms"])
    assert (alone["parent_frame_id"], alone["child_frame_id"]) == ("odom", "base_footprint")
    assert [(each["parent_frame_id"], each["child_frame_id"]) for each in both] == [
        ("map", "odom"),
        ("odom", "base_footprint"),
    ]
    assert both[0]["translation"] == {"x": 2.0, "y": 1.0, "z": 0.0}
    stamp = first["timestamp"]
    assert stamp["sec"] + stamp["nsec"] / 1e9 == pytest.approx(WALL_S, abs=1e-6)


def test_transforms_are_thinned_and_events_are_not(tmp_path: Path) -> None:
    """Of 100 poses in a second about 20 are drawn, and all are in the events."""
    found = drawn(tmp_path, *(odometry(START_S + k / 100, Pose2D(k / 100)) for k in range(100)))
    assert len(found["/events/OdometryUpdated chefbotd.OdometryUpdated"]) == 100
    assert 18 <= len(found["/tf foxglove.FrameTransforms"]) <= 23


def test_a_scan_is_drawn_at_even_steps(tmp_path: Path) -> None:
    """Clockwise beams at 0.3, 0.1, -0.1 rad come in ascending order; what was not read is 0, and so is the infinite."""
    scan = LaserScan(
        START_S, np.array([0.3, 0.1, -0.1]), np.array([1.5, np.inf, 2.5]), np.array([-0.02, -0.01, 0.0])
    )
    found = drawn(tmp_path, ScanMeasured(START_S, "top", Pose2D(0.05, -0.02, 0.25), scan))
    (told,) = found["/scan/top foxglove.LaserScan"]
    assert told["frame_id"] == "base_footprint"
    assert told["pose"]["position"] == {"x": 0.05, "y": -0.02, "z": 0.0}
    assert told["pose"]["orientation"]["z"] == pytest.approx(math.sin(0.125))
    assert (told["start_angle"], told["end_angle"]) == pytest.approx((-0.1, 0.3))
    assert told["ranges"] == [2.5, 0.0, 1.5]
    (event,) = found["/events/ScanMeasured chefbotd.ScanMeasured"]
    assert event["scan"]["range_m"] == [1.5, None, 2.5]


def test_a_growing_map_is_put_together(tmp_path: Path) -> None:
    """A whole map of 2 rows by 3 columns, then its upper right corner: the cells from the lowest y up."""

    def change(
        revision: int, row: int, column: int, rows: int, columns: int, cells: list[int], *, whole: bool
    ) -> MapChanged:
        data = zlib.compress(np.array(cells, np.int8).tobytes())
        origin = Pose2D(-1.0, 0.5, 0.1)
        return MapChanged(START_S, revision, 0.05, origin, 3, 2, column, row, columns, rows, data, whole)

    found = drawn(
        tmp_path,
        change(1, 1, 2, 1, 1, [77], whole=False),
        change(2, 0, 0, 2, 3, [-1, 0, 100, 5, 6, 7], whole=True),
        change(3, 1, 2, 1, 1, [99], whole=False),
    )
    first, second = found["/map foxglove.Grid"]
    assert np.frombuffer(base64.b64decode(first["data"]), np.int8).tolist() == [-1, 0, 100, 5, 6, 7]
    assert np.frombuffer(base64.b64decode(second["data"]), np.int8).tolist() == [-1, 0, 100, 5, 6, 99]
    assert (second["column_count"], second["row_stride"], second["cell_stride"]) == (3, 3, 1)
    assert second["cell_size"] == {"x": 0.05, "y": 0.05}
    assert second["pose"]["position"] == {"x": -1.0, "y": 0.5, "z": 0.0}
    assert second["fields"] == [{"name": "percent", "offset": 0, "type": 2}]


def test_the_map_in_use_is_drawn_and_told_again_in_the_next_file(tmp_path: Path) -> None:
    """Its cells are read once; another file begins with them, and with the path that is followed."""
    asked: list[str] = []

    def read_map(event: MapLoaded) -> tuple[float, Pose2D, int, bytes]:
        asked.append(event.name)
        return 0.1, Pose2D(1.0, 2.0, 0.0), 2, b"\x00\x64\xff\x05"

    made = recorder(tmp_path, read_map=read_map)
    made.record(
        [
            MapLoaded(START_S, "/maps", "flat", 3),
            PathChanged((0.0, 3.0, 3.0), (0.0, 0.0, 4.0), stamp_s=START_S),
        ],
        START_S,
    )
    found = drawn(tmp_path, odometry(START_S, Pose2D()), made=made)
    (told,) = found["/map foxglove.Grid"]
    assert base64.b64decode(told["data"]) == b"\x00\x64\xff\x05"
    assert asked == ["flat"]
    (path,) = found["/path foxglove.PosesInFrame"]
    headings = [2 * math.atan2(each["orientation"]["z"], each["orientation"]["w"]) for each in path["poses"]]
    assert headings == pytest.approx([0.0, math.pi / 2, math.pi / 2])
    assert [each["position"]["y"] for each in path["poses"]] == [0.0, 0.0, 4.0]


def test_the_log_says_what_people_want_to_read(tmp_path: Path) -> None:
    """A fault is an error with its name; what appears twice is written once."""
    armed = SafetyChanged(START_S, "armed", "started", None)
    limited = SafetyChanged(START_S, "armed", "started", "teleop", limited_by="obstacle:front")
    found = drawn(tmp_path, armed, armed, limited, fault(START_S))
    rows = found["/log foxglove.Log"]
    assert [(row["level"], row["name"], row["message"]) for row in rows] == [
        (2, "safety", "armed: started"),
        (2, "safety", "armed: started (limited by obstacle:front)"),
        (4, "safety", "disarmed: the left wheel stands [stalled]"),
    ]
