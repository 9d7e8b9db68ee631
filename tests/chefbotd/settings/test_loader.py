"""Configuration: files, environment, overrides and their errors."""

import os
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from chefbotd.settings import Settings, SettingsError, load, packaged
from chefbotd.settings.errors import RENAMED, explain
from firmware_protocol.codec import VARIANTS, Variant
from firmware_protocol.messages import Orientation, RawImu, UltrasonicDistance


@pytest.fixture
def chefbot(tmp_path: Path) -> Path:
    """A copy of the packaged configuration to spoil."""
    copy = tmp_path / "robot.toml"
    copy.write_text(packaged("chefbot").read_text())
    return copy


def spoil(path: Path, old: str, new: str) -> Path:
    """Replace a line's text, which must be there."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


def test_the_packaged_chefbot_has_the_published_numbers():
    """Wheel diameter 0.09 m, base 0.3 m, 4200 counts, a wire of 255 (its gains are our own), dead-man 0.5 s."""
    settings = load()
    assert settings.robot.name == "chefbot"
    assert [wheel.radius_m for wheel in settings.chassis.wheels] == [0.045, 0.045]
    assert settings.chassis.track_width_m == 0.3
    assert settings.encoders.counts_per_turn == 4200
    assert (settings.pid.kp, settings.pid.ki, settings.pid.output_limit) == (200, 200, 255)
    assert settings.drive.max_duty == 255
    assert settings.safety.command_timeout_s == 0.5
    assert {name: s.priority for name, s in settings.safety.sources.items()} == {
        "safety": 10,
        "teleop": 7,
        "navigation": 5,
    }


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            "track_width_m = 0.3",
            "track_width_m = -0.3",
            r"chassis.track_width_m: .*greater than 0 \(got -0.3\)",
        ),
        ("baud = 115200", 'baud = "fast"', r"link.baud: .*integer.* \(got 'fast'\)"),
        (
            "baud = 115200",
            "bawd = 115200",
            r"link.bawd: unknown key, did you mean baud\? \(got 115200\)",
        ),
        ("counts_per_turn = 4200", "", "encoders.counts_per_turn: this key is required"),
        ("radius_m = 0.045", "radius_m = nan", r"chassis.wheels.left_wheel.radius_m: .*finite"),
        ('side = "left"', 'side = "right"', "chassis: .*at least one wheel on the left side"),
        ("baud = 115200", 'baud = "115200"', r"link.baud: .*integer \(got '115200'\)"),
        ("exclusive = true", 'exclusive = "yes"', r"link.exclusive: .*boolean \(got 'yes'\)"),
        ("priority = 10", "priority = true", r"safety.sources.safety.priority: .*integer \(got True\)"),
        ("baud = 115200", "baud = 115200.5", "link.baud: .*integer"),
        ('name = "chefbot"', "name = 2020-01-01", "robot.name: .*string"),
        ("priority = 10", "priority = 300", r"safety.sources.safety.priority: .*255 \(got 300\)"),
    ],
)
def test_a_refused_value_is_named_with_its_key_and_range(chefbot: Path, old: str, new: str, told: str):
    """The error has the file, the key, what was expected and what was given."""
    with pytest.raises(SettingsError, match=told) as error:
        load(spoil(chefbot, old, new))
    assert str(chefbot) in str(error.value)


def test_several_mistakes_are_all_told(chefbot: Path):
    """One line for each, so that they can be mended in one go."""
    spoil(chefbot, "baud = 115200", "baud = 1")
    spoil(chefbot, "track_width_m = 0.3", "track_width_m = 0")
    with pytest.raises(SettingsError, match=r"(?s)link\.baud.*\n.*chassis\.track_width_m"):
        load(chefbot)


def test_the_environment_goes_before_the_file(monkeypatch: pytest.MonkeyPatch):
    """CHEFBOTD_LINK__DEVICE replaces [link] device, and a number is read as one."""
    monkeypatch.setenv("CHEFBOTD_LINK__DEVICE", "/dev/ttyUSB7")
    monkeypatch.setenv("CHEFBOTD_API__PORT", "7444")
    monkeypatch.setenv("CHEFBOTD_PID__KP_DUTY_PER_M_S", "350")
    settings = load()
    assert (settings.link.device, settings.api.port, settings.pid.kp) == ("/dev/ttyUSB7", 7444, 350.0)


def test_a_file_may_leave_the_decimal_point_out(chefbot: Path):
    """A whole number stands for any number."""
    assert load(spoil(chefbot, "radius_m = 0.045", "radius_m = 1")).chassis.wheels[0].radius_m == 1.0


def test_a_variable_may_reach_into_a_list(monkeypatch: pytest.MonkeyPatch):
    """The wheels are counted from 0."""
    monkeypatch.setenv("CHEFBOTD_CHASSIS__WHEELS__1__RADIUS_M", "0.05")
    assert [wheel.radius_m for wheel in load().chassis.wheels] == [0.045, 0.05]


def test_a_variable_is_read_as_its_key_needs_it(monkeypatch: pytest.MonkeyPatch):
    """What looks like a number is text where text belongs, a condition and a list are what they look like."""
    monkeypatch.setenv("CHEFBOTD_ROBOT__NAME", "7")
    monkeypatch.setenv("CHEFBOTD_LINK__EXCLUSIVE", "false")
    monkeypatch.setenv("CHEFBOTD_API__TOKEN_FILE", "1")
    monkeypatch.setenv("CHEFBOTD_INFRARED", "[]")
    settings = load()
    assert (settings.robot.name, settings.link.exclusive, settings.infrared) == ("7", False, ())
    assert settings.api.token_file == Path("1")


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("CHEFBOTD_LINK__BAUD", "x", r"^CHEFBOTD_LINK__BAUD: link.baud: .*integer \(got 'x'\)$"),
        ("CHEFBOTD_LINK__EXCLUSIVE", "yes", "^CHEFBOTD_LINK__EXCLUSIVE: link.exclusive: .*boolean"),
        (
            "CHEFBOTD_CHASSIS__WHEELS__1__SIDE",
            "up",
            r"^CHEFBOTD_CHASSIS__WHEELS__1__SIDE: chassis.wheels.right_wheel.side",
        ),
        (
            "CHEFBOTD_CHASSIS__WHEELS__2__SIDE",
            "left",
            "^CHEFBOTD_CHASSIS__WHEELS__2__SIDE: .*no entry 2, only 0 to 1, left_wheel, right_wheel",
        ),
        ("CHEFBOTD_CHASSIS__WHEELS__X", "1", "^CHEFBOTD_CHASSIS__WHEELS__X: .*no entry x"),
    ],
)
def test_a_bad_variable_is_blamed_and_not_the_file(
    monkeypatch: pytest.MonkeyPatch, name: str, text: str, told: str
):
    """The error begins with the variable's name."""
    monkeypatch.setenv(name, text)
    with pytest.raises(SettingsError, match=told):
        load()


def test_each_mistake_is_told_where_it_is(chefbot: Path, monkeypatch: pytest.MonkeyPatch):
    """The file's, the environment's and the caller's, a line each."""
    monkeypatch.setenv("CHEFBOTD_LINK__BAUD", "1")
    spoil(chefbot, "track_width_m = 0.3", "track_width_m = 0")
    with pytest.raises(SettingsError) as error:
        load(chefbot, overrides={"log.level": "loud"})
    assert [line.split(": ")[:2] for line in str(error.value).splitlines()] == [
        ["CHEFBOTD_LINK__BAUD", "link.baud"],
        [str(chefbot), "chassis.track_width_m"],
        ["log.level", "input should be 'debug', 'info', 'warning' or 'error' (got 'loud')"],
    ]


def test_overrides_have_the_last_word(monkeypatch: pytest.MonkeyPatch):
    """What the command line says beats the environment."""
    monkeypatch.setenv("CHEFBOTD_API__PORT", "7444")
    assert load(overrides={"api.port": 7555}).api.port == 7555


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("CHEFBOTD_LINK__DEVISE", "link.devise: unknown key"),
        ("CHEFBOTD_NONSENSE", "nonsense: unknown key"),
        ("CHEFBOTD_LINK__DEVICE__X", "link.device.x: device is a value, not a section"),
    ],
)
def test_a_mistyped_environment_variable_is_not_ignored(
    monkeypatch: pytest.MonkeyPatch, name: str, told: str
):
    """A name that fits no key is refused like a key that does not exist."""
    monkeypatch.setenv(name, "x")
    with pytest.raises(SettingsError, match=told):
        load()


def test_a_missing_file_and_a_broken_one_are_told_apart(tmp_path: Path):
    """Each error names the file and what is wrong with it."""
    with pytest.raises(SettingsError, match=r"absent.toml: cannot be read: No such file"):
        load(tmp_path / "absent.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("[link\n")
    with pytest.raises(SettingsError, match=r"broken.toml: not valid TOML: .*line 1"):
        load(broken)
    broken.write_bytes(b"\xff\xfe")
    with pytest.raises(SettingsError, match="not valid TOML"):
        load(broken)
    broken.write_text("link = " + "[" * 20_000)
    with pytest.raises(
        SettingsError, match=r"broken.toml: not valid TOML: lists or tables are nested too deep"
    ):
        load(broken)


def test_an_unknown_robot_is_told_which_there_are():
    """The packaged configurations are listed."""
    with pytest.raises(SettingsError, match=r"'marvin'; there are: .*chefbot"):
        packaged("marvin")


OWN_GAINS = """
[wheel_pid.{wheel}]
kp_duty_per_m_s = 1.0
ki_duty_per_m = 2.0
output_limit_duty = 255.0
"""


def test_a_wheel_may_have_gains_of_its_own(chefbot: Path):
    """``[wheel_pid.NAME]`` stands in for ``[pid]`` on that wheel alone."""
    chefbot.write_text(chefbot.read_text() + OWN_GAINS.format(wheel="right_wheel"))
    gains = load(chefbot).gains()
    assert [(name, own.kp, own.output_limit) for name, own in gains.items()] == [
        ("left_wheel", 200.0, 255.0),
        ("right_wheel", 1.0, 255.0),
    ]


def test_gains_of_a_wheel_that_is_not_there(chefbot: Path):
    """They are refused by the wheel's name."""
    chefbot.write_text(chefbot.read_text() + OWN_GAINS.format(wheel="third_wheel"))
    with pytest.raises(SettingsError, match=r"wheel_pid: .*the chassis has no wheel third_wheel"):
        load(chefbot)


def test_the_packaged_khan_has_the_published_numbers():
    """Radius 0.03 m, track 0.189 m, 1 m/s, 3 m/s2, 2 rad/s, 6 rad/s2, 0.25 s, and its four sources of 0.5 s each."""
    settings = load(packaged("khan"))
    assert {wheel.radius_m for wheel in settings.chassis.wheels} == {0.03}
    assert [wheel.name for wheel in settings.chassis.wheels] == [
        "front_left_wheel",
        "front_right_wheel",
        "rear_left_wheel",
        "rear_right_wheel",
    ]
    linear, angular = settings.limits.linear, settings.limits.angular
    assert (linear.max_forward_m_s, linear.acceleration_m_s2) == (1.0, 3.0)
    assert (angular.max_left_rad_s, angular.acceleration_rad_s2) == (2.0, 6.0)
    assert (settings.chassis.track_width_m, settings.safety.command_timeout_s) == (0.189, 0.25)
    sources = {name: (s.priority, s.timeout_s) for name, s in settings.safety.sources.items()}
    assert sources == {"joystick": (10, 0.5), "marker": (8, 0.5), "move_base": (2, 0.5), "external": (1, 0.5)}
    assert (settings.ultrasonic, settings.imu, list(settings.range_mounts())) == (None, None, ["front"])


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        ({"robot.wire": "morse"}, "robot.wire: .*should be one of classic, four_wheels, khan, khan_edges"),
        ({"robot.wire": "classic"}, "the wire 'classic' has 2 wheels, the chassis names 4"),
        ({"ultrasonic": {"name": "front"}}, "range sensors need names of their own, there are front"),
        (
            {"infrared": [{"name": "a", "setback_m": 0.1}, {"name": "b", "setback_m": 0.1}]},
            r"need analogue inputs of their own, got channels \[0, 0\]",
        ),
        (
            {"robot.wire": "four_wheels"},
            r"\[\[infrared\]\] front needs a line that the wire 'four_wheels' does not have; "
            "those with one: khan, khan_edges$",
        ),
        (
            {"quadrature.window_s": 0.1},
            r"\[quadrature\] needs a line that the wire 'khan' does not have; those with one: khan_edges$",
        ),
        (
            {"infrared": [], "safety.guard.silent_is_obstacle": True},
            r"\[safety.guard\] has no sensor to guard with: configure \[ultrasonic\], \[\[infrared\]\] or \[\[lidar\]\]",
        ),
        (
            {"infrared.0.setback_m": 0.2},
            r"infrared front sits 0.2 m behind .* would touch before the guard stops it 0.2 m from the sensor",
        ),
    ],
)
def test_parts_that_do_not_go_together_are_refused(overrides: dict[str, object], told: str):
    """A wire that is not this robot's, sensors that could not be told apart, and sections that nothing would feed."""
    with pytest.raises(SettingsError, match=told):
        load(packaged("khan"), overrides=overrides)


@pytest.mark.parametrize(
    ("section", "excluded"), [("ultrasonic", (UltrasonicDistance,)), ("imu", (Orientation, RawImu))]
)
def test_a_sensor_whose_line_the_board_leaves_out_is_refused(
    monkeypatch: pytest.MonkeyPatch, section: str, excluded: tuple[type, ...]
):
    """A board of one's own without the line: the section is named, and the wires that have it."""
    monkeypatch.setitem(VARIANTS, "mute", Variant("mute", excluded=excluded))
    with pytest.raises(
        SettingsError, match=rf"\[{section}\] needs a line that the wire 'mute' does not have; .*: classic,"
    ):
        load(overrides={"robot.wire": "mute"})


def test_all_that_does_not_go_together_is_told_at_once():
    """In one line, without the whole configuration after it."""
    with pytest.raises(SettingsError) as error:
        load(packaged("khan"), overrides={"robot.wire": "classic"})
    path = packaged("khan")
    assert str(error.value) == (
        f"{path}: the wire 'classic' has 2 wheels, the chassis names 4; [[infrared]] front needs a line that the wire "
        "'classic' does not have; those with one: khan, khan_edges"
    )


EDGES = {"robot.wire": "khan_edges"}


@pytest.mark.parametrize(
    "fits", [{}, {"link.baud": 57_600, "drive.max_rim_speed_m_s": 0.15}, {"quadrature.window_s": 0.1}]
)
def test_edges_that_fit_their_line_are_accepted(fits: dict[str, object]):
    """KHAN's 898 counts a turn need 11,320 of 11,520 bytes/s at 1.1 m/s; at half the baud rate, 0.15 m/s still do."""
    assert load(packaged("khan"), overrides={**EDGES, **fits}).robot.wire == "khan_edges"


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (
            {"link.baud": 57_600},
            "898 .* 36.7 rad/s .*max_rim_speed_m_s 1.1.* need 11320 bytes/s, .*57600 carries 5760",
        ),
        (
            {"encoders.counts_per_turn": 4200},
            "4200 encoders.counts_per_turn .* need .* bytes/s, .*115200 carries 11520",
        ),
        ({"drive.max_rim_speed_m_s": 1.3}, "at 43.3 rad/s"),
        ({"chassis.left_radius_multiplier": 0.9}, "at 40.7 rad/s"),
    ],
)
def test_edges_that_do_not_fit_their_line_are_refused(more: dict[str, object], told: str):
    """A slower line, finer encoders, faster or smaller wheels: counts, speed, and bytes needed and there are named."""
    with pytest.raises(
        SettingsError, match=f"the wire 'khan_edges' cannot carry every edge: 4 wheels of .*{told}"
    ):
        load(packaged("khan"), overrides={**EDGES, **more})


def test_a_wheel_that_would_be_taken_for_all_of_them_is_refused(chefbot: Path):
    """``set_pid`` calls every wheel 'all', so none can have that name."""
    with pytest.raises(SettingsError, match="no wheel can be named 'all'"):
        load(spoil(chefbot, 'name = "left_wheel"', 'name = "all"'))


@pytest.mark.parametrize("key", ["sim.wire", "sim.body.wheel_radius_m", "sim.ultrasonic.mount_x_m"])
def test_what_other_sections_say_is_not_taken_from_the_simulators(key: str):
    """The simulated robot's wire, wheels and mounts are the robot's own: ``[sim]`` has no such key."""
    with pytest.raises(SettingsError, match=f"{key}: unknown key"):
        load(overrides={key: 1})


def test_gains_beyond_the_duty_range_are_refused(chefbot: Path):
    """An output limit above drive.max_duty: both numbers and the wheel are named."""
    with pytest.raises(
        SettingsError, match=r"output_limit_duty 5000.0 of left_wheel is beyond drive.max_duty 255"
    ):
        load(spoil(chefbot, "output_limit_duty = 255.0", "output_limit_duty = 5000.0"))


def test_a_limit_that_blinds_the_stall_detector_is_refused(chefbot: Path):
    """Duty of 30 at most never reaches 0.12 of 255, from where on a wheel must turn: both are named. 31 does."""
    with pytest.raises(
        SettingsError,
        match=r"output_limit_duty 30.0 of left_wheel never drives it beyond 30.6 .*share 0.12",
    ):
        load(chefbot, overrides={"pid.output_limit_duty": 30.0})
    assert load(chefbot, overrides={"pid.output_limit_duty": 31.0}).pid.output_limit == 31.0


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (
            {"limits.linear.deceleration_m_s2": 0.1},
            "guard.deceleration_m_s2 0.5 counts on more braking than limits.linear.deceleration_m_s2 0.1 allows.* front",
        ),
        (
            {"ultrasonic.mount_heading_rad": 3.0, "limits.linear.reverse_deceleration_m_s2": 0.4},
            "more braking than limits.linear.reverse_deceleration_m_s2 0.4 allows",
        ),
        # Still gaining 1 m/s2 at 0.24 m/s, with 5 m/s3: 0.061 m up to 0.34 m/s, and 0.17 m/s x (0.34 + 0.2) s.
        (
            {"limits.linear.jerk_m_s3": 5.0},
            r"counts on 0.058 m to brake from 0.24 m/s .*deceleration_m_s2 1 with jerk_m_s3 5 takes 0.153 m",
        ),
        # At 1.2 rad a beam shortens by 0.36 of the way: 0.36 x (0.116 - 0.042) m would be missing.
        (
            {"ultrasonic.mount_heading_rad": 1.2, "limits.linear.deceleration_m_s2": 0.5},
            r"counts on 0.042 m to brake from 0.34 m/s .* takes 0.116 m",
        ),
    ],
    ids=["forward", "reverse", "jerk", "slanting"],
)
def test_a_guard_that_counts_on_more_braking_than_there_is_is_refused(
    overrides: dict[str, object], told: str
):
    """Both numbers are named; without the guard the same limits are fine."""
    with pytest.raises(SettingsError, match=told):
        load(overrides=overrides)
    assert load(overrides={**overrides, "safety.guard.enabled": False}).safety.guard.enabled is False


@pytest.mark.parametrize(
    "overrides",
    [
        {"limits.linear.deceleration_m_s2": 0.5},
        {"limits.linear.jerk_m_s3": 20.0},
        {"limits.linear.deceleration_m_s2": 0.1, "safety.guard.deceleration_m_s2": 0.1},
        {"limits.linear.reverse_deceleration_m_s2": 0.1},
    ],
)
def test_a_guard_that_counts_on_no_more_braking_than_there_is_is_accepted(overrides: dict[str, object]):
    """As much as the limits allow, a jerk that costs millimetres, and a limit that no sensor hangs on."""
    assert load(overrides=overrides).safety.guard.enabled


def test_a_wheel_goes_by_its_name(monkeypatch: pytest.MonkeyPatch):
    """In a variable, whatever its case, and in messages, where the variable said a number."""
    monkeypatch.setenv("CHEFBOTD_CHASSIS__WHEELS__RIGHT_WHEEL__RADIUS_M", "0.05")
    assert [wheel.radius_m for wheel in load().chassis.wheels] == [0.045, 0.05]
    monkeypatch.setenv("CHEFBOTD_CHASSIS__WHEELS__RIGHT_WHEEL__RADIUS_M", "-2")
    with pytest.raises(
        SettingsError, match=r"^CHEFBOTD_\w+RIGHT_WHEEL__RADIUS_M: chassis\.wheels\.right_wheel\.radius_m: .*"
    ):
        load()


def test_a_section_that_is_mistyped_is_told_with_the_one_that_was_meant(chefbot: Path):
    """``[ultrasonics]`` comes near ``[ultrasonic]``; what comes near nothing gets no guess."""
    with pytest.raises(SettingsError, match=r"ultrasonics: unknown key, did you mean ultrasonic\?"):
        load(spoil(chefbot, "[ultrasonic]", "[ultrasonics]"))
    with pytest.raises(SettingsError, match=r"zebra: unknown key \(got"):
        load(spoil(chefbot, "[imu]", "[zebra]"))


@pytest.mark.parametrize(("old", "new"), RENAMED.items(), ids=[".".join(keys) for keys in RENAMED])
def test_a_renamed_key_is_refused_with_its_new_name(old: tuple[str, ...], new: str):
    """A configuration of an earlier version is told what each key is called now, which is a key that there is."""
    told = []
    for key in (old[-1], new):
        values: dict[str, Any] = {key: 12}
        for name in reversed(old[:-1]):
            values = {name: [values] if name in ("infrared", "depth_camera") else values}
        with pytest.raises(ValidationError) as refused:
            Settings.model_validate(values)
        told.append(explain(refused.value, Settings, values, {}, ""))
    assert f"{old[-1]}: unknown key, it is now called {new} (got 12)" in told[0]
    assert "unknown key" not in told[1]


def test_a_near_miss_in_a_list_and_in_a_named_section(chefbot: Path):
    """A wheel's ``radius`` and a source's ``timeout``: their own keys are suggested."""
    spoil(chefbot, "radius_m = 0.045", "radius = 0.045")
    spoil(chefbot, "timeout_s = 0.2", "timeout = 0.2")
    with pytest.raises(SettingsError) as error:
        load(chefbot)
    assert "chassis.wheels.left_wheel.radius: unknown key, did you mean radius_m?" in str(error.value)
    assert "safety.sources.safety.timeout: unknown key, did you mean timeout_s?" in str(error.value)


def test_a_byte_order_mark_is_no_part_of_the_file(chefbot: Path):
    """Some editors begin a file with one."""
    chefbot.write_bytes(b"\xef\xbb\xbf" + chefbot.read_bytes())
    assert load(chefbot) == load()


def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path):
    """It would hold up the start, and each reload, until somebody writes into it."""
    pipe = tmp_path / "robot.toml"
    os.mkfifo(pipe)
    with pytest.raises(SettingsError, match=r"robot\.toml: is no regular file \(a pipe"):
        load(pipe)


def test_a_file_that_is_far_too_large_is_refused(tmp_path: Path):
    """No more of it is read than shows that: a gigabyte of nothing takes no second."""
    path = tmp_path / "robot.toml"
    with path.open("wb") as file:
        file.truncate(1 << 30)
    with pytest.raises(SettingsError, match=r"robot\.toml: is larger than 1024 KiB"):
        load(path)


def test_a_folder_is_told_as_one(tmp_path: Path):
    """It is no file that cannot be read."""
    with pytest.raises(SettingsError, match="is a folder, expected a TOML file"):
        load(tmp_path)


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        ({"battery.low_v": 12.9}, "battery: low_v must be below full_v, got 12.9 and 12.9"),
        ({"limits.linear.max_forward_m_s": 0}, r"limits\.linear\.max_forward_m_s: .*greater than 0"),
    ],
)
def test_values_with_which_no_robot_works(overrides: dict[str, object], told: str):
    """A battery that is low when it is full, a robot that may not drive."""
    with pytest.raises(SettingsError, match=told):
        load(overrides=overrides)
