"""Gains saved into configuration files: what changes, what stays, and what happens when it cannot be done."""

import stat
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from chefbotd.cli import gains_file
from chefbotd.cli.gains_file import save, with_gains
from chefbotd.motion.pid import PidParameters
from chefbotd.settings import SettingsError, load, packaged

Spoil = Callable[[Path], None]


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A copy of ChefBot's configuration."""
    path = tmp_path / "robot.toml"
    path.write_bytes(packaged().read_bytes())
    return path


def gains(**changes: object) -> dict[str, PidParameters]:
    """ChefBot's own, with changes to the right wheel."""
    own = load().gains()
    return {**own, "right_wheel": own["right_wheel"].model_copy(update=changes)}


def both(**changes: object) -> dict[str, PidParameters]:
    """ChefBot's own, with changes to both wheels."""
    return dict.fromkeys(load().gains(), gains(**changes)["right_wheel"])


def changed(before: str, after: str) -> list[str]:
    """The lines that are in one and not in the other."""
    old, new = before.splitlines(), after.splitlines()
    return [f"-{line}" for line in old if line not in new] + [f"+{line}" for line in new if line not in old]


def test_only_what_changed_is_written(config: Path) -> None:
    """A new kp and kv change two lines, comments and all the rest stay."""
    before = config.read_text()
    save(config, both(kp=450.0, kv=2500.0))
    assert changed(before, config.read_text()) == [
        "-kp_duty_per_m_s = 400.0",
        "-kv_duty_per_m_s = 2400.0            # duty per speed,",
        "+kp_duty_per_m_s = 450.0",
        "+kv_duty_per_m_s = 2500.0            # duty per speed,",
    ]


def test_what_is_off_has_no_line(config: Path) -> None:
    """A gain that is switched off loses its line, a default that is left gets one."""
    before = config.read_text()
    save(config, both(back_calculation_s=None, deadband=0.01))
    assert changed(before, config.read_text()) == ["-back_calculation_s = 0.5", "+deadband_m_s = 0.01"]
    assert load(config).gains() == both(back_calculation_s=None, deadband=0.01)


def test_a_wheel_that_differs_and_comes_back(config: Path) -> None:
    """It gets a section of its own, which goes when all are alike again; either way the file says the gains."""
    save(config, gains(kp=450.0, back_calculation_s=None))
    assert "[wheel_pid.right_wheel]\nkp_duty_per_m_s = 450.0\n" in config.read_text()
    assert load(config).gains() == gains(kp=450.0, back_calculation_s=None)
    save(config, gains(kp=500.0))
    assert load(config).gains() == gains(kp=500.0)
    save(config, both(kp=1.0))
    assert "wheel_pid" not in config.read_text()
    assert load(config).gains() == both(kp=1.0)


def test_another_wheel_differs(config: Path) -> None:
    """Of four wheels, the gains of most are the robot's; a section that is not needed any more goes."""
    wheels, odd = ("a", "b", "c", "d"), gains(kp=1.0)["right_wheel"]
    usual = load().gains()["left_wheel"]
    first = with_gains(config.read_text(), {wheel: odd if wheel == "a" else usual for wheel in wheels})
    second = with_gains(first, {wheel: odd if wheel == "d" else usual for wheel in wheels})
    said = tomllib.loads(second)
    assert said["pid"]["kp_duty_per_m_s"] == 400.0
    assert said["wheel_pid"].keys() == {"d"}


def test_short_names_are_kept(config: Path) -> None:
    """A file that says ``kp`` goes on saying it so."""
    config.write_text(config.read_text().replace("kp_duty_per_m_s", "kp"))
    save(config, both(kp=450.0))
    assert "\nkp = 450.0\n" in config.read_text()
    assert "kp_duty_per_m_s" not in config.read_text()


def test_the_file_is_replaced_as_it_was(config: Path) -> None:
    """Mode and line ends stay, a symbolic link goes on pointing at the file, and nothing is left lying about."""
    config.write_bytes(config.read_bytes().replace(b"\n", b"\r\n"))
    config.chmod(0o640)
    link = config.with_name("link.toml")
    link.symlink_to(config.name)
    save(link, both(kp=450.0))
    assert stat.S_IMODE(config.stat().st_mode) == 0o640
    assert b"kp_duty_per_m_s = 450.0\r\n" in config.read_bytes()
    assert link.is_symlink()
    assert sorted(path.name for path in config.parent.iterdir()) == ["link.toml", "robot.toml"]


def test_another_robots_file(config: Path) -> None:
    """Gains of wheels that the file does not have are not written into it."""
    before = config.read_bytes()
    with pytest.raises(
        SettingsError, match="for the wheels left_wheel, right_wheel; the gains are for third"
    ):
        save(config, {"third": gains()["left_wheel"]})
    assert config.read_bytes() == before


def test_no_configuration(config: Path) -> None:
    """What was broken before is not touched."""
    config.write_text("[pid]\n")
    with pytest.raises(SettingsError, match="this key is required"):
        save(config, gains())
    assert config.read_text() == "[pid]\n"


def test_a_file_that_would_not_load(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Should the new file be refused, the old one stays and the new one is gone."""
    before = config.read_bytes()

    def only_the_old(path: Path) -> object:
        if path.name != config.name:
            raise SettingsError("it is refused")
        return load(path)

    monkeypatch.setattr(gains_file, "load", only_the_old)
    with pytest.raises(SettingsError, match="it is refused"):
        save(config, both(kp=450.0))
    assert config.read_bytes() == before
    assert [path.name for path in config.parent.iterdir()] == ["robot.toml"]
