"""How calibrated values are written into a configuration, and when they are not."""

import stat
import tomllib
from pathlib import Path

import pytest

from chefbotd.components.calibration.calibrated_file import save, with_values
from chefbotd.settings import SettingsError, load
from chefbotd.settings.values import apply_calibration, value_of
from tests.robot_files import full


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A copy of the configuration of ChefBot with a lidar."""
    path = tmp_path / "robot.toml"
    path.write_bytes(full("chefbot_lidar").read_bytes())
    path.chmod(0o640)
    return path


VALUES = {
    "chassis.track_multiplier": 1.0123456789,
    "chassis.wheels.right_wheel.motor_sign": -1.0,
    "lidar.lidar.mount_x_m": 0.0512,
    "battery.divider_ratio": 5.1,
}


def test_the_values_are_written_and_the_old_file_is_kept(config: Path) -> None:
    """Each value stands at its key, lists are found by name, comments and mode stay, and the difference is shown."""
    before = config.read_bytes()
    saved = save(config, VALUES)
    settings = load(config)
    assert value_of(settings, "chassis.track_multiplier") == 1.01235
    assert settings.chassis.wheels[1].motor_sign == -1
    assert settings.lidar[0].mount_x_m == 0.0512
    assert Path(saved.kept).read_bytes() == before
    assert stat.S_IMODE(config.stat().st_mode) == 0o640
    assert "-divider_ratio = 5.0\n+divider_ratio = 5.1" in saved.difference
    assert before.count(b"#") == config.read_bytes().count(b"#")


def test_every_old_file_is_kept(config: Path) -> None:
    """A second calibration does not overwrite what the first one kept."""
    first = save(config, VALUES)
    second = save(config, {"battery.divider_ratio": 5.2})
    assert (first.kept, second.kept) == (f"{config}.before", f"{config}.before-2")
    assert load(Path(second.kept)).battery.divider_ratio == 5.1


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"chassis.wheels.third_wheel.motor_sign": -1.0}, "third_wheel"),
        ({"battery.divider_ratio": float("nan")}, "no finite number"),
        ({"battery.divider_ratio": -5.0}, "divider_ratio"),
        ({"battery.no_such_key": 1.0}, "no_such_key"),
    ],
)
def test_what_is_no_configuration_is_not_written(config: Path, values: dict[str, float], words: str) -> None:
    """A value out of its range, an unknown key or wheel: the error names it, and the folder is as before."""
    before = config.read_bytes()
    with pytest.raises(SettingsError, match=words):
        save(config, values)
    assert config.read_bytes() == before
    assert [path.name for path in config.parent.iterdir()] == [config.name]


def test_an_inline_list_is_refused_and_named() -> None:
    """A list that is written in one line cannot be edited: that is said, and not written wrongly."""
    text = 'lidar = [{name = "a", x = 1}, {name = "b"}]\n'
    with pytest.raises(ValueError, match="lidar"):
        with_values(text, {"lidar.a.mount_x_m": 0.05})


def test_the_only_element_of_a_list_needs_no_name() -> None:
    """A single ``[[lidar]]`` without a name is the one that the default names."""
    text = '[[lidar]]\nmodel = "ld19"  # mine\n\n[imu]\n'
    after = with_values(text, {"lidar.lidar.mount_x_m": 0.05})
    assert tomllib.loads(after)["lidar"] == [{"model": "ld19", "mount_x_m": 0.05}]
    assert "# mine" in after


def test_settings_with_values_are_checked() -> None:
    """The settings with calibrated values are those that the file would give; what is out of range is refused."""
    settings = apply_calibration(load(), {"chassis.left_radius_multiplier": 1.004})
    assert settings.chassis.left_radius_multiplier == 1.004
    assert settings.model_copy(update={"chassis": load().chassis}) == load()
    with pytest.raises(SettingsError, match="left_radius_multiplier"):
        apply_calibration(load(), {"chassis.left_radius_multiplier": -0.5})


def test_the_old_file_is_not_kept_where_a_link_leads(chefbot: Path) -> None:
    """A link of that name that leads nowhere is no free name: nothing appears elsewhere."""
    elsewhere = chefbot.with_name("elsewhere")
    chefbot.with_name("robot.toml.before").symlink_to(elsewhere)
    saved = save(chefbot, {"battery.divider_ratio": 5.2})
    assert saved.kept.endswith("robot.toml.before-2")
    assert not elsewhere.exists()
