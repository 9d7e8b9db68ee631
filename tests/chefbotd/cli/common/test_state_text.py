"""The words for the robot's state, one by one where a state is rare."""

import pytest

from chefbotd.cli.common import state_text
from chefbotd.cli.common.state_text import Style
from chefbotd.components.localization import status_text as localization_text
from chefbotd.components.mapping import status_text as mapping_text
from chefbotd.components.navigation import status_text as navigation_text
from chefbotd.components.recording import status_text as recording_text
from chefbotd.components.simulation import status_text as simulation_text
from chefbotd.components.worker import status_text as worker_text

STATS = {
    "uptime_s": 9.6,
    "frames": {},
    "refused": {},
    "lines_out": 0,
    "clients": 1,
    "encoder_readings_refused": 0,
    "board_restarts": 0,
    "bus_dropped": {},
    "telemetry_dropped": 0,
}


def test_a_link_that_is_down_alarms() -> None:
    """The device, then the reason; none is named before there is one."""
    fact = state_text.link({"state": "down", "device": "/dev/ttyACM0", "reason": "unplugged"})
    assert (fact.text, fact.style) == ("down, /dev/ttyACM0: unplugged", Style.ALARM)
    nameless = state_text.link({"state": "down", "device": "", "reason": "not opened yet"})
    assert nameless.text == "down, not opened yet"


def test_a_link_that_is_up_and_not_healthy_alarms() -> None:
    """The condition, and the reason, which says what to do."""
    data = {"state": "up", "device": "/dev/ttyACM0", "reason": "set counts_per_turn"}
    fact = state_text.link({**data, "healthy": False, "condition": "counts_differ"})
    assert fact.text == "up on /dev/ttyACM0, counts differ: set counts_per_turn"
    assert fact.style is Style.ALARM
    for healthy in (True, None):
        fact = state_text.link({**data, "healthy": healthy, "condition": "healthy"})
        assert (fact.text, fact.style) == ("up on /dev/ttyACM0", Style.GOOD)


OWN = {"version": "0.1", "board": "tm4c123", "deadman_ms": 250, "crc_errors": 3, "refused": 1, "reason": ""}


@pytest.mark.parametrize(
    ("change", "told", "style"),
    [
        ({}, "0.1 on tm4c123, stops by itself after 250 ms, 3 lines damaged, 1 refused", Style.GOOD),
        (
            {"deadman_ms": None, "reason": "no answer"},
            "0.1 on tm4c123, does not stop by itself now, no answer",
            Style.NOTICE,
        ),
        (
            {"version": "", "board": ""},
            "unknown, stops by itself after 250 ms, 3 lines damaged, 1 refused",
            Style.GOOD,
        ),
    ],
)
def test_the_boards_firmware_is_told_with_its_dead_man(
    change: dict[str, object], told: str, style: Style
) -> None:
    """Its version and board, and how many lines came in damaged; or that it does not stop by itself, and why."""
    fact = state_text.firmware({**OWN, **change})
    assert (fact.text, fact.style) == (told, style)


@pytest.mark.parametrize(
    ("state", "topics", "told"),
    [
        ("up", {}, ["not chefbotd's own, not known to stop by itself"]),
        ("down", {}, []),
        (
            "up",
            {"firmware": {"data": OWN, "age_s": 0.1}},
            ["0.1 on tm4c123, stops by itself after 250 ms, 3 lines damaged, 1 refused"],
        ),
    ],
)
def test_a_board_that_has_not_named_itself_is_a_published_sketch(
    state: str, topics: dict[str, object], told: list[str]
) -> None:
    """Where there is a board at all."""
    link = {"state": state, "device": "/dev/ttyACM0", "reason": "", "healthy": None, "condition": "unknown"}
    safety = {"mode": "estopped", "reason": "smoke", "source": None, "armed": False}
    facts = state_text.of_state({"topics": topics, "link": link, "safety": safety})
    assert [fact.text for fact in facts if fact.label == "firmware"] == told


def test_a_locked_robot_alarms() -> None:
    """A robot that may not move says why."""
    fact = state_text.safety({"mode": "estopped", "reason": "smoke", "source": None, "armed": False})
    assert (fact.text, fact.style) == ("estopped: smoke", Style.ALARM)


def test_who_drives_is_named() -> None:
    """The source in force is part of the mode."""
    fact = state_text.safety(
        {"mode": "armed", "reason": "", "source": "teleop", "armed": True, "limited_by": None}
    )
    assert (fact.text, fact.style) == ("armed, driven by teleop", Style.GOOD)


@pytest.mark.parametrize(
    ("source", "control", "told"),
    [
        ("teleop", {"teleop": "Ann's joystick"}, "armed, driven by Ann's joystick as teleop"),
        ("navigation", {"teleop": "Ann's joystick"}, "armed, driven by navigation"),
        (None, {"teleop": "Ann's joystick"}, "armed, nobody drives (Ann's joystick has teleop)"),
        (None, {}, "armed, nobody drives"),
    ],
)
def test_the_driver_is_a_client_and_not_only_a_source(
    source: str | None, control: dict[str, str], told: str
) -> None:
    """By the name that it introduced itself with; who has control and does not drive is told as well."""
    data = {"mode": "armed", "reason": "", "source": source, "armed": True, "limited_by": None}
    assert state_text.safety({**data, "control": control}).text == told


def test_what_holds_the_robot_up_is_named() -> None:
    """An obstacle, or a driver that has said nothing for too long."""
    data = {"mode": "armed", "reason": "", "source": "teleop", "armed": True, "limited_by": "obstacle:front"}
    fact = state_text.safety(data)
    assert (fact.text, fact.style) == ("armed, driven by teleop, slowed by obstacle:front", Style.NOTICE)


@pytest.mark.parametrize(
    ("status", "style"), [("ok", Style.GOOD), ("low", Style.NOTICE), ("critical", Style.ALARM)]
)
def test_a_weak_battery_alarms(status: str, style: Style) -> None:
    """The lower the battery, the louder the fact."""
    assert state_text.battery({"voltage_v": 11.6, "percentage": 3.2, "status": status}).style is style


@pytest.mark.parametrize(
    ("heading_rad", "rates", "told"),
    [
        (0.5, None, "heading +28.6°"),
        (None, [0.0, 0.0, 0.25], "turning +0.250 rad/s"),
        (None, None, "no data"),
    ],
)
def test_each_kind_of_imu(heading_rad: float | None, rates: list[float] | None, told: str) -> None:
    """An IMU with a heading, one with rates only, and one with neither."""
    assert state_text.imu({"heading_rad": heading_rad, "angular_velocity_rad_s": rates}).text == told


def test_no_echo_is_no_distance() -> None:
    """A beam without a distance says why; without beams there are none."""
    beam = {"sensor": "front", "status": "no_echo", "range_m": None}
    assert state_text.ranges({"ranges": [beam]}).text == "front no echo"
    assert state_text.ranges({"ranges": []}).text == "none"


def test_contact_is_told() -> None:
    """A simulated robot at a wall says so."""
    truth = {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0, "in_contact": True}
    assert simulation_text.truth(truth).text.endswith("touching a wall")


def test_counters_without_a_fault_are_calm() -> None:
    """Only what went wrong is counted out, and then it is noticed."""
    assert state_text.counters(STATS).text == "up 10 s, 0 lines in, 0 out, 1 client"
    assert state_text.counters({**STATS, "clients": 2}).text.endswith(", 2 clients")
    assert state_text.counters(STATS).style is Style.PLAIN
    assert state_text.counters({**STATS, "bus_dropped": {"LineSeen": 2}}).style is Style.NOTICE


def test_what_moves_goes_stale() -> None:
    """An old reading is faint; a link that has not changed for an hour is not."""
    battery = {"voltage_v": 12.0, "percentage": 50.0, "status": "ok"}
    link = {"state": "up", "device": "x", "reason": "", "healthy": True, "condition": "healthy"}
    link_fact, battery_fact = state_text.of_topics(
        {"battery": {"data": battery, "age_s": 1.5}, "link": {"data": link, "age_s": 3600.0}}
    )
    assert (link_fact.style, link_fact.age_s) == (Style.GOOD, None)
    assert (battery_fact.style, battery_fact.age_s) == (Style.FAINT, 1.5)


def test_lidars_are_told_each_with_its_condition() -> None:
    """Green only where all of them are healthy."""
    top, low = {"lidar": "top", "condition": "healthy"}, {"lidar": "low", "condition": "motor_stalled"}
    fact = state_text.lidars({"lidars": [top, low]})
    assert (fact.text, fact.style) == ("top healthy, low motor stalled", Style.NOTICE)
    assert state_text.lidars({"lidars": [top]}).style is Style.GOOD


MAPPING = {"state": "mapping", "path_m": 12.34, "loops": 3, "reason": "no scan for 2 s", "unfinished": False}
RECORDING = {"name": "walk", "seconds": 61.2, "bytes_written": 2_500_000, "dropped": 0, "reason": ""}


@pytest.mark.parametrize(
    ("fact", "told", "style"),
    [
        (
            worker_text.worker({"state": "ready", "rss_mb": 127.4, "cpu": 0.046, "reason": ""}),
            "ready, 127 MB, 0.05 core",
            Style.GOOD,
        ),
        (
            worker_text.worker({"state": "restarting", "rss_mb": None, "cpu": None, "reason": "it hung"}),
            "restarting, it hung",
            Style.NOTICE,
        ),
        (
            localization_text.localization(
                {"state": "lost", "map": "flat", "fit": 0.314, "reason": "nothing fits"}
            ),
            "lost on flat, fit 31 %, nothing fits",
            Style.ALARM,
        ),
        (
            localization_text.localization({"state": "unknown", "map": None, "fit": 0.0, "reason": ""}),
            "no map is in use",
            Style.PLAIN,
        ),
        (
            navigation_text.navigation({"state": "driving", "distance_m": 3.27, "reason": ""}),
            "driving, 3.3 m left",
            Style.PLAIN,
        ),
        (
            navigation_text.navigation(
                {"state": "reached", "distance_m": None, "reason": "reached (1.25, 3.00)"}
            ),
            "reached (1.25, 3.00)",
            Style.PLAIN,
        ),
        (
            navigation_text.navigation(
                {"state": "paused", "distance_m": 1.0, "reason": "paused, because teleop drives"}
            ),
            "paused, because teleop drives, 1.0 m left",
            Style.PLAIN,
        ),
        (
            state_text.odometry({"x_m": 1.0, "y_m": -0.5, "heading_rad": 0.0}),
            "x +1.000 m  y -0.500 m  heading +0.0°, by odometry",
            Style.PLAIN,
        ),
        (
            state_text.map_pose({"x_m": 3.0, "y_m": 2.0, "heading_rad": 0.0, "state": "localized"}),
            "x +3.000 m  y +2.000 m  heading +0.0°",
            Style.PLAIN,
        ),
        (
            navigation_text.navigation({"state": "blocked", "distance_m": None, "reason": "a chair"}),
            "blocked, a chair",
            Style.NOTICE,
        ),
        (
            mapping_text.mapping(MAPPING),
            "mapping, 12.3 m driven, 3 loops closed, no scan for 2 s",
            Style.NOTICE,
        ),
        (
            mapping_text.mapping({**MAPPING, "state": "idle", "unfinished": True}),
            "one was never finished",
            Style.NOTICE,
        ),
        (
            recording_text.recording({**RECORDING, "state": "recording"}),
            "recording, walk, 61 s, 2.5 MB",
            Style.PLAIN,
        ),
        (
            recording_text.recording({**RECORDING, "state": "failed", "dropped": 4, "reason": "disk full"}),
            "failed, 4 events dropped, disk full",
            Style.NOTICE,
        ),
    ],
)
def test_each_feature_has_a_line(fact: state_text.Fact, told: str, style: Style) -> None:
    """Its state, its figures, and the reason if something is wrong."""
    assert (fact.text, fact.style) == (told, style)


def test_a_guard_that_is_off_alarms() -> None:
    """Sensors that see obstacles for nothing are named beside the mode, armed or not followed by anybody."""
    data = {"armed": True, "mode": "armed", "source": None, "limited_by": None}
    fact = state_text.safety({**data, "guard_warning": "a lidar (top), and the guard is off"})
    assert "a lidar (top), and the guard is off" in fact.text
    assert fact.style is Style.ALARM
    assert state_text.safety({**data, "guard_warning": ""}).style is Style.GOOD


@pytest.mark.parametrize(("topic", "label"), [("drive_warning", "wheels"), ("odometry_condition", "imu")])
def test_what_is_wrong_with_wheels_and_imu_is_shown_while_there_is_a_reason(topic: str, label: str) -> None:
    """Its sentence, in alarm; nothing while there is none."""
    (fact,) = state_text.of_topics({topic: {"data": {"reason": "turn a wheel by hand"}}})
    assert (fact.label, fact.text, fact.style) == (label, "turn a wheel by hand", Style.ALARM)
    assert state_text.of_topics({topic: {"data": {"reason": ""}}}) == []
