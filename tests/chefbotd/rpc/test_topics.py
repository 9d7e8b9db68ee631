"""Each topic's data, from the events behind it."""

from typing import Any

import pytest
from msgspec.structs import replace

from chefbotd.core import events
from chefbotd.core.events import BatteryLevelStatus, Direction, RangeStatus
from chefbotd.core.geometry import Pose2D, PoseCovariance, Twist2D
from chefbotd.driving.board.models import link_data
from chefbotd.driving.models import safety_data
from chefbotd.rpc.encoding import plain
from tests.fakes.robot import STATS, topics_of

TABLE = topics_of(simulated=True)

BEAM = events.RangeMeasured(
    stamp_s=5.0,
    arrival_s=5.25,
    sensor="front",
    status=RangeStatus.OK,
    range_m=1.25,
    min_range_m=0.02,
    max_range_m=4.0,
    field_of_view_rad=0.5,
)


def data_of(name: str, *seen: Any) -> dict[str, Any]:
    """A topic's data as JSON values after these events."""
    topic, state = TABLE[name], None
    for event in seen:
        state = event if topic.join is None else topic.join(state, event)
    return plain(topic.data(state))


def test_no_topic_has_lost_its_name() -> None:
    """Programs subscribe to these; the truth only where it is simulated, the rest only where there are lidars."""
    contract = (
        "odometry wheels imu ranges battery link safety reset text raw stats worker localization mapping map map_pose "
        "navigation path costmap obstacles recording log"
    )
    everywhere = set(topics_of(simulated=False))
    assert everywhere >= set(contract.split())
    assert set(TABLE) - everywhere == {"sim", "scan", "lidars", "depth_cameras"}


def test_odometry() -> None:
    """Pose, twist, and the covariance row by row over x, y, heading."""
    covariance = PoseCovariance(xx=1.0, xy=2.0, xh=3.0, yy=4.0, yh=5.0, hh=6.0)
    event = events.OdometryUpdated(1.0, 1.5, Pose2D(1.0, 2.0, 0.5), Twist2D(0.3, -0.1), covariance)
    assert data_of("odometry", event) == {
        "x_m": 1.0,
        "y_m": 2.0,
        "heading_rad": 0.5,
        "linear_m_s": 0.3,
        "angular_rad_s": -0.1,
        "covariance": [1.0, 2.0, 3.0, 2.0, 4.0, 5.0, 3.0, 5.0, 6.0],
        "frame_id": "odom",
        "child_frame_id": "base_footprint",
    }


def test_wheels() -> None:
    """A joint state: names and values in the same order; a wheel that is left out is named."""
    event = events.WheelsDriven(1.0, (1.0, 2.0), (3.0, 4.0), (5.0, 6.0), (100, -100), excluded=(1,))
    assert data_of("wheels", event) == {
        "name": ["left_wheel", "right_wheel"],
        "position_rad": [1.0, 2.0],
        "velocity_rad_s": [3.0, 4.0],
        "target_rad_s": [5.0, 6.0],
        "duty": [100, -100],
        "excluded": ["right_wheel"],
    }


def test_imu_variants() -> None:
    """What a variant does not measure is null."""
    oriented = events.ImuMeasured(
        stamp_s=1.0, arrival_s=1.5, orientation=(0.0, 0.0, 0.0, 1.0), heading_rad=0.0
    )
    inertial = events.ImuMeasured(
        stamp_s=1.0,
        arrival_s=1.5,
        angular_velocity_rad_s=(0.1, 0.2, 0.3),
        linear_acceleration_m_s2=(0.0, 0.0, 9.8),
    )
    assert data_of("imu", oriented) == {
        "orientation": [0.0, 0.0, 0.0, 1.0],
        "heading_rad": 0.0,
        "angular_velocity_rad_s": None,
        "linear_acceleration_m_s2": None,
    }
    assert data_of("imu", inertial)["linear_acceleration_m_s2"] == [0.0, 0.0, 9.8]


def test_ranges_hold_the_latest_beam_of_every_sensor() -> None:
    """A beam replaces its own sensor's and leaves the others'."""
    rear = replace(BEAM, sensor="rear", stamp_s=6.0)
    nearer = replace(BEAM, range_m=0.75, stamp_s=7.0)
    beams = data_of("ranges", BEAM, rear, nearer)["ranges"]
    assert [(b["sensor"], b["range_m"], b["stamp_s"]) for b in beams] == [
        ("front", 0.75, 7.0),
        ("rear", 1.25, 6.0),
    ]


@pytest.mark.parametrize("status", [RangeStatus.TOO_FAR, RangeStatus.TOO_NEAR, RangeStatus.NO_ECHO])
def test_a_range_out_of_range_is_null_with_its_status(status: RangeStatus) -> None:
    """No number stands in for a distance that was not measured."""
    (beam,) = data_of("ranges", replace(BEAM, status=status, range_m=None))["ranges"]
    assert (beam["range_m"], beam["status"]) == (None, status.value)


def test_battery() -> None:
    """Volts, percentage and urgency."""
    event = events.BatteryMeasured(11.9, 20.0, BatteryLevelStatus.LOW, stamp_s=1.0, arrival_s=1.5)
    assert data_of("battery", event) == {"voltage_v": 11.9, "percentage": 20.0, "status": "low"}


def test_link() -> None:
    """Up with its device, then healthy or not; down with the reason; down before anything was heard."""
    opened = events.LinkOpened(1.0, "/dev/ttyACM0")
    closed = events.LinkClosed(2.0, "/dev/ttyACM0", "unplugged")
    judged = events.LinkHealthChanged(1.5, "/dev/ttyACM0", False, "silent", "nothing heard")
    up = {"state": "up", "device": "/dev/ttyACM0"}
    assert data_of("link", opened) == {**up, "reason": "", "healthy": None, "condition": "unknown"}
    silent = {**up, "reason": "nothing heard", "healthy": False, "condition": "silent"}
    assert data_of("link", opened, judged) == silent
    assert data_of("link", opened, closed) == {
        "state": "down",
        "device": "/dev/ttyACM0",
        "reason": "unplugged",
        "healthy": False,
        "condition": "down",
    }
    absent = data_of("link", events.LinkNotOpened(0.5, "/dev/ttyACM0", "there is no such device"))
    assert absent == {
        "state": "down",
        "device": "/dev/ttyACM0",
        "reason": "there is no such device",
        "healthy": False,
        "condition": "down",
    }
    assert link_data(None).state == "down"


@pytest.mark.parametrize(
    ("mode", "armed"), [("armed", True), ("disarmed", False), ("estopped", False), ("some_new_mode", False)]
)
def test_safety_is_armed_in_one_mode_only(mode: str, armed: bool) -> None:
    """A mode that this table does not know is not called armed."""
    event = events.SafetyChanged(1.0, mode, "because", "teleop")
    assert data_of("safety", event) == {
        "mode": mode,
        "reason": "because",
        "source": "teleop",
        "armed": armed,
        "control": {},
        "fault": None,
        "limited_by": None,
        "latch": 0,
        "stop_number": 0,
        "guard_warning": "",
    }


def test_a_silent_gate_is_not_armed() -> None:
    """Before the gate has spoken nothing claims that the robot may move."""
    assert safety_data(None).armed is False


def test_text_and_raw() -> None:
    """Text as it is; a raw line with its direction, and odd bytes legible."""
    assert data_of("text", events.TextReceived(1.0, "Reset Done")) == {"text": "Reset Done"}
    assert data_of("raw", events.LineSeen(1.0, Direction.FROM_BOARD, b"e\t1\t\xff")) == {
        "direction": "in",
        "line": "e\t1\t\\xff",
    }


def test_stats_are_the_whole_sample() -> None:
    """Every figure as it is, also one that is not known; the stamp is the envelope's."""
    assert data_of("stats", STATS) == {
        "uptime_s": 60.0,
        "frames": {"encoders": 100},
        "lines_out": 50,
        "board_clock_skew_ppm": None,
    }


def test_sim() -> None:
    """The true pose, the true twist, contact, and who stands where."""
    discs = ((4.0, 5.0, 0.25),)
    event = events.TruthSimulated(1.0, Pose2D(1.0, 2.0, 3.0), Twist2D(0.1, 0.2), True, discs)
    assert data_of("sim", event) == {
        "x_m": 1.0,
        "y_m": 2.0,
        "heading_rad": 3.0,
        "linear_m_s": 0.1,
        "angular_rad_s": 0.2,
        "in_contact": True,
        "discs": [{"x_m": 4.0, "y_m": 5.0, "radius_m": 0.25}],
    }


def test_the_log_has_the_newest_fifty_lines_and_what_a_source_repeats_once() -> None:
    """A link that opens, 60 texts of the board, and the same text again: the texts 10 to 59, oldest first."""
    opened = events.LinkOpened(0.5, "/dev/ttyACM0")
    texts = [events.TextReceived(float(number), f"text {number}") for number in range(60)]
    lines = data_of("log", opened, *texts, events.TextReceived(99.0, "text 59"))["lines"]
    assert [(line["stamp_s"], line["text"]) for line in lines] == [
        (float(number), f"text {number}") for number in range(10, 60)
    ]
    (first,) = data_of("log", opened, opened)["lines"]
    said = {"text": {"id": "log.port_open", "arguments": {"device": "/dev/ttyACM0"}}}
    line = {"level": "info", "source": "link", "text": "open: /dev/ttyACM0", "stamp_s": 0.5}
    assert first == line | {"said": said}
