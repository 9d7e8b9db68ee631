"""Configuration: files, environment and overrides."""

import os
from pathlib import Path

import pytest

from chefbotd.settings import SettingsError, load, packaged
from tests.chefbotd.settings.robot_file import spoil


def test_the_packaged_chefbot_has_the_published_numbers():
    """Wheel diameter 0.09 m, base 0.3 m, 4200 counts, a wire of 255 (its gains are our own), dead-man 0.5 s."""
    settings = load()
    assert settings.robot.name == "chefbot"
    assert [wheel.radius_m for wheel in settings.chassis.wheels] == [0.045, 0.045]
    assert settings.chassis.track_width_m == 0.3
    assert settings.encoders.counts_per_turn == 4200
    assert (settings.pid.kp, settings.pid.ki, settings.pid.output_limit) == (200, 2000, 255)
    assert settings.drive.max_duty == 255
    assert settings.safety.command_timeout_s == 0.5
    assert {name: settings.safety.sources[name].priority for name in settings.safety.offered} == {
        "safety": 10,
        "teleop": 7,
        "navigation": 5,
    }


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


@pytest.mark.parametrize("table", ["api", "limits.linear"])
def test_a_table_that_stands_twice_is_named_as_in_the_file(tmp_path: Path, table: str):
    """As where the lines of a page are pasted below a file that has the table already."""
    twice = tmp_path / "robot.toml"
    twice.write_text(f"[{table}]\n[pid]\n[{table}]\n")
    with pytest.raises(SettingsError) as told:
        load(twice)
    assert f"not valid TOML: [{table}] stands twice: put all its keys under one of them (at line 3" in str(
        told.value
    )


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
    safety = settings.safety
    sources = {
        name: (safety.sources[name].priority, safety.sources[name].timeout_s) for name in safety.offered
    }
    assert sources == {"joystick": (10, 0.5), "marker": (8, 0.5), "move_base": (2, 0.5), "external": (1, 0.5)}
    assert (settings.ultrasonic, settings.imu, list(settings.range_mounts())) == (None, None, ["front"])


@pytest.mark.parametrize("key", ["sim.wire", "sim.body.wheel_radius_m", "sim.ultrasonic.mount_x_m"])
def test_what_other_sections_say_is_not_taken_from_the_simulators(key: str):
    """The simulated robot's wire, wheels and mounts are the robot's own: ``[sim]`` has no such key."""
    with pytest.raises(SettingsError, match=f"{key}: unknown key"):
        load(overrides={key: 1})


def test_a_wheel_goes_by_its_name(monkeypatch: pytest.MonkeyPatch):
    """In a variable, whatever its case, and in messages, where the variable said a number."""
    monkeypatch.setenv("CHEFBOTD_CHASSIS__WHEELS__RIGHT_WHEEL__RADIUS_M", "0.05")
    assert [wheel.radius_m for wheel in load().chassis.wheels] == [0.045, 0.05]
    monkeypatch.setenv("CHEFBOTD_CHASSIS__WHEELS__RIGHT_WHEEL__RADIUS_M", "-2")
    with pytest.raises(
        SettingsError, match=r"^CHEFBOTD_\w+RIGHT_WHEEL__RADIUS_M: chassis\.wheels\.right_wheel\.radius_m: .*"
    ):
        load()


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


def test_a_variable_is_blamed_for_what_it_breaks_between_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page beyond this computer needs a token: where a variable has set its host, no file is to blame."""
    monkeypatch.setenv("CHEFBOTD_PAGE__ENABLED", "true")
    with pytest.raises(SettingsError) as refused:
        load(overrides={"page.host": "0.0.0.0"})
    assert str(refused.value).startswith("page.host '0.0.0.0' is beyond")
    monkeypatch.setenv("CHEFBOTD_PAGE__HOST", "0.0.0.0")
    with pytest.raises(SettingsError) as refused:
        load()
    assert str(refused.value).startswith("CHEFBOTD_PAGE__HOST: page.host '0.0.0.0' is beyond")
