"""Gains saved into configuration files: what changes, and what stays."""

import re
import tomllib
from pathlib import Path

import pytest

from chefbotd.components.tuning.gains_file import save, with_gains
from chefbotd.motion.pid import PidParameters
from chefbotd.settings import load
from tests.robot_files import full

PID = """kp = 200
ki = 2000.0
ks = 21.2
kv = 598
ka = 15
output_limit = 255
integral_limit = 75
back_calculation_s = 0.5
"""
"""ChefBot's gains as somebody else would write them."""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A copy of ChefBot's configuration."""
    path = tmp_path / "robot.toml"
    path.write_bytes(full().read_bytes())
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
        "-kp_duty_per_m_s = 200.0             # the published 400 belongs to a host without feedforward",
        "-kv_duty_per_m_s = 598.0             # duty per speed,",
        "+kp_duty_per_m_s = 450.0             # the published 400 belongs to a host without feedforward",
        "+kv_duty_per_m_s = 2500.0             # duty per speed,",
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
    assert said["pid"]["kp_duty_per_m_s"] == 200.0
    assert said["wheel_pid"].keys() == {"d"}


def test_short_names_are_kept(config: Path) -> None:
    """A file that says ``kp`` goes on saying it so."""
    config.write_text(config.read_text().replace("kp_duty_per_m_s", "kp"))
    save(config, both(kp=450.0))
    assert "\nkp = 450.0 " in config.read_text()
    assert "kp_duty_per_m_s" not in config.read_text()


def test_what_goes_leaves_its_comments(config: Path) -> None:
    """A section that goes leaves its comments where it stood; those above the next header stay right above it."""
    apart = (
        "# it pulls\n[wheel_pid.right_wheel]   # the worn one\n"
        + PID
        + "# below\n\n# of what follows\n[limits]"
    )
    config.write_text(
        config.read_text().replace("[limits]", apart).replace("ki = 2000.0", "ki = 7  # found by hand")
    )
    save(config, both())
    assert (
        "\n# it pulls\n# the worn one\n# found by hand\n# below\n\n# of what follows\n[limits]\n"
        in config.read_text()
    )
    assert load(config).gains() == both()


def test_what_is_off_leaves_its_comment(config: Path) -> None:
    """The line of a gain that is switched off goes without its comment, which is kept from the next section."""
    config.write_text(
        config.read_text().replace("_calculation_s = 0.5\n\n", "_calculation_s = 0.5  # slow\n# of it\n")
    )
    save(config, both(back_calculation_s=None))
    assert "\nintegral_limit_duty = 75.0\n# slow\n\n# of it\n[limits]\n" in config.read_text()


def test_a_new_gain_stands_with_the_others(config: Path) -> None:
    """It comes below the last gain, above the comments of the next section."""
    config.write_text(config.read_text().replace("\n[limits]", "# below\n\n# of it\n[limits]"))
    save(config, both(deadband=0.01))
    assert "_s = 0.5\n# below\ndeadband_m_s = 0.01\n\n# of it\n[limits]\n" in config.read_text()


@pytest.mark.parametrize("wheels", [("left_wheel", "right_wheel"), ("right_wheel", "left_wheel")])
def test_a_tie_changes_nothing_that_stood(config: Path, wheels: tuple[str, str]) -> None:
    """Of two wheels that differ, ``[pid]`` stays that of the one which has its values still."""
    tuned, usual = wheels
    before = config.read_text()
    save(config, {tuned: gains(kp=450.0)["right_wheel"], usual: load().pid})
    assert config.read_text().startswith(before + f"\n[wheel_pid.{tuned}]\n")


def test_a_tie_of_wheels_that_all_changed(config: Path) -> None:
    """The first wheel of the chassis has ``[pid]`` then, whatever the order of the gains; saved again, it stays."""
    left, right = both(kp=1.0)["left_wheel"], both(kp=2.0)["left_wheel"]
    save(config, {"right_wheel": right, "left_wheel": left})
    assert (load(config).pid, dict(load(config).wheel_pid)) == (left, {"right_wheel": right})
    saved = config.read_bytes()
    save(config, {"right_wheel": right, "left_wheel": left})
    assert config.read_bytes() == saved


def test_sections_that_are_meant_stay(config: Path) -> None:
    """Where every wheel has a section by hand, they are changed in place, also one that is like ``[pid]``."""
    config.write_text(config.read_text() + f"[wheel_pid.left_wheel]\n{PID}[wheel_pid.right_wheel]\n{PID}")
    before = config.read_text()
    save(config, gains(kp=450.0))
    assert config.read_text() == "kp = 450.0".join(before.rsplit("kp = 200", 1))
    save(config, both(kp=450.0))
    assert config.read_text() == before.replace("kp = 200\n", "kp = 450.0\n")


def test_there_and_back(config: Path) -> None:
    """A wheel that is tuned and put back leaves the very file."""
    before = config.read_bytes()
    save(config, gains(kp=450.0))
    save(config, gains())
    assert config.read_bytes() == before


def test_nothing_to_change(config: Path) -> None:
    """Gains that the file has already do not replace it."""
    was = config.stat().st_ino
    save(config, both())
    assert config.stat().st_ino == was


def test_the_environment_is_not_saved(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A gain that the environment sets is neither taken into the file nor kept out of it."""
    wanted = both(kv=450.0)
    monkeypatch.setenv("CHEFBOTD_PID__KP_DUTY_PER_M_S", "350")
    monkeypatch.setenv("CHEFBOTD_PID__KV_DUTY_PER_M_S", "450")
    save(config, wanted)
    monkeypatch.undo()
    assert load(config).gains() == wanted


def test_what_the_environment_gave_is_said(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that has no gains of its own, because the environment gives them, gets a section for them."""
    wanted = both(kp=450.0)
    config.write_text(re.sub(r"(?ms)^\[pid\].*?^\[limits\]", "[limits]", config.read_text()))
    monkeypatch.setenv("CHEFBOTD_PID", "{kp = 1, ki = 1, output_limit = 255}")
    save(config, wanted)
    monkeypatch.undo()
    assert load(config).gains() == wanted
