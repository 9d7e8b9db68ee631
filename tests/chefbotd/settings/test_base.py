"""A robot's file may hold only what differs from a packaged robot: ``extends``."""

from pathlib import Path

import pytest

from chefbotd.components.calibration.calibrated_file import save as save_values
from chefbotd.components.tuning.gains_file import save as save_gains
from chefbotd.settings import Settings, SettingsError, load, packaged


def written(folder: Path, text: str) -> Path:
    """A robot's file with this text."""
    path = folder / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return path


def differing(one: Settings, other: Settings) -> set[str]:
    """The names of the sections that differ."""
    mine, theirs = one.model_dump(), other.model_dump()
    return {name for name in mine if mine[name] != theirs[name]}


def test_a_file_that_only_extends_is_the_packaged_robot(tmp_path: Path) -> None:
    """One line is a whole configuration, for each packaged robot."""
    for robot in ("chefbot", "chefbot_lidar", "khan"):
        assert load(written(tmp_path, f'extends = "{robot}"\n')) == load(packaged(robot))


def test_only_what_the_file_says_differs(tmp_path: Path) -> None:
    """A key in a section leaves the section's other keys as they are."""
    settings = load(
        written(tmp_path, 'extends = "chefbot"\n[chassis]\ntrack_width_m = 0.17\n[link]\nbaud = 57600\n')
    )
    usual = load()
    assert settings.chassis.track_width_m == 0.17
    assert settings.chassis.wheels == usual.chassis.wheels
    assert settings.link.device == usual.link.device
    assert differing(settings, usual) == {"chassis", "link"}


def test_a_wheel_is_changed_by_its_name(tmp_path: Path) -> None:
    """``[chassis.wheels.left_wheel]`` changes one wheel's keys, and no other's."""
    settings = load(written(tmp_path, 'extends = "chefbot"\n[chassis.wheels.left_wheel]\nmotor_sign = -1\n'))
    left, right = settings.chassis.wheels
    assert (left.motor_sign, left.radius_m, right.motor_sign) == (-1, 0.045, 1)


def test_a_list_replaces_the_whole_list(tmp_path: Path) -> None:
    """Two wheels in the file are two wheels, and not four."""
    wheels = "".join(
        f'[[chassis.wheels]]\nname = "{side}"\nside = "{side}"\nradius_m = 0.033\n'
        for side in ("left", "right")
    )
    settings = load(written(tmp_path, f'extends = "chefbot"\n{wheels}'))
    assert [(wheel.name, wheel.radius_m) for wheel in settings.chassis.wheels] == [
        ("left", 0.033),
        ("right", 0.033),
    ]


def test_false_leaves_a_sensor_out(tmp_path: Path) -> None:
    """Each part that a robot may lack, in one line; a required one cannot be left out."""
    text = 'extends = "chefbot_lidar"\nimu = false\nultrasonic = false\nbattery = false\nlidar = false\nbody = false\n'
    settings = load(written(tmp_path, text))
    assert (settings.imu, settings.ultrasonic, settings.battery, settings.body) == (None, None, None, None)
    assert settings.lidar == ()
    with pytest.raises(SettingsError, match="chassis"):
        load(written(tmp_path, 'extends = "chefbot"\nchassis = false\n'))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            'extends = "marvin"\n',
            "extends: no configuration comes with chefbotd for robot 'marvin'; there are: ",
        ),
        ('extends = "../config/khan"\n', "no configuration comes with chefbotd for robot"),
        ("extends = 7\n", "extends: expected the name of a packaged robot, such as 'chefbot', got 7"),
        (
            'extends = "chefbot"\n[chassis.wheels.middle]\nradius_m = 0.1\n',
            "chassis.wheels.middle.radius_m: there is no entry middle, only 0 to 1, left_wheel, right_wheel",
        ),
        (
            'extends = "chefbot"\n[chassis.wheels]\nleft_wheel = 7\n',
            "chassis.wheels.left_wheel: expected a section with the keys to change, got 7",
        ),
        ('extends = "chefbot"\n[link]\nbawd = 9600\n', "link.bawd: unknown key, did you mean baud?"),
    ],
)
def test_what_does_not_fit_is_named_with_the_file(tmp_path: Path, text: str, said: str) -> None:
    """The key, the value, what was expected, and the file."""
    path = written(tmp_path, text)
    with pytest.raises(SettingsError) as refused:
        load(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert said in str(refused.value)


def test_calibration_writes_into_a_file_with_only_what_differs(tmp_path: Path) -> None:
    """Values of a section, a wheel and a motor's model that the file does not name yet are in force."""
    path = written(tmp_path, '# mine\nextends = "chefbot"\n\n[chassis]\ntrack_width_m = 0.17  # by tape\n')
    model = {"dead_zone_duty": 22.0, "gain_rad_s_per_duty": 0.0367, "time_constant_s": 0.09}
    motors = {
        f"drive.motors.{wheel}_wheel.{way}.{key}": value
        for wheel in ("left", "right")
        for way in ("forward", "reverse")
        for key, value in model.items()
    }
    save_values(
        path, {"chassis.track_width_m": 0.171, "chassis.wheels.left_wheel.encoder_sign": -1, **motors}
    )
    settings = load(path)
    assert settings.chassis.track_width_m == 0.171
    assert [wheel.encoder_sign for wheel in settings.chassis.wheels] == [-1, 1]
    assert settings.drive.motors["right_wheel"].reverse.dead_zone_duty == 22.0
    text = path.read_text(encoding="utf-8")
    assert text.startswith('# mine\nextends = "chefbot"\n\n[chassis]\ntrack_width_m = 0.171 # by tape\n') or (
        "track_width_m = 0.171  # by tape" in text
    )


def test_tuned_gains_are_written_into_a_file_without_gains(tmp_path: Path) -> None:
    """Only the gain that changed comes into the file; the others remain the packaged robot's."""
    path = written(tmp_path, 'extends = "chefbot"\n')
    gains = load(path).gains()
    changed = {name: values.model_copy(update={"kp": 150.0}) for name, values in gains.items()}
    save_gains(path, changed)
    assert load(path).gains() == changed
    assert path.read_text(encoding="utf-8") == 'extends = "chefbot"\n\n[pid]\nkp_duty_per_m_s = 150.0\n'
    own = {**changed, "left_wheel": changed["left_wheel"].model_copy(update={"ki": 100.0})}
    save_gains(path, own)
    assert load(path).gains() == own
