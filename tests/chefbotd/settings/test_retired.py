"""Keys that became constants: a recording may hold one with the value of the constant, a file may not."""

from pathlib import Path
from typing import Any, ClassVar

import pytest

from chefbotd.core.parameters import Parameters, section
from chefbotd.settings import Settings, SettingsError, load, packaged
from chefbotd.settings.retired import RetiredKey, advice_of, drop_retired


class Wheel(Parameters):
    """An entry of a list, or one by name."""

    retired: ClassVar[dict[str, Any]] = {"slip": 0.5}
    radius_m: float = 0.1


class Robot(Parameters):
    """A table in each form that a configuration has."""

    retired: ClassVar[dict[str, Any]] = {"slam": {"loops": {"every_m": 0.5}}}
    front: Wheel = section()
    spare: Wheel | None = None
    listed: tuple[Wheel, ...] = ()
    named: dict[str, Wheel] = {}


@pytest.mark.parametrize(
    "of",
    [
        lambda wheel: {"front": wheel},
        lambda wheel: {"spare": wheel},
        lambda wheel: {"listed": [{"radius_m": 0.2}, wheel]},
        lambda wheel: {"named": {"left": wheel}},
    ],
)
def test_a_retired_key_is_dropped_wherever_its_table_stands(of: Any) -> None:
    """Alone, in a list or by name; what is left is a configuration of this version."""
    values = of({"slip": 0.5, "radius_m": 0.3})
    drop_retired(Robot, values)
    assert values == of({"radius_m": 0.3})
    Robot.model_validate(values)


def test_another_value_than_the_constant_is_refused_with_its_place() -> None:
    """The path of the key, its value then, and what it is now."""
    with pytest.raises(
        RetiredKey, match=r"^listed\.0\.slip was 0\.7 then, and this version has always 0\.5$"
    ):
        drop_retired(Robot, {"listed": [{"slip": 0.7}]})
    with pytest.raises(
        RetiredKey, match=r"^slam\.loops\.every_m was 2 then, and this version has always 0\.5$"
    ):
        drop_retired(Robot, {"slam": {"loops": {"every_m": 2}}})
    with pytest.raises(RetiredKey, match=r"^slam\.loops\.odd was 2 then, and this version has no such key$"):
        drop_retired(Robot, {"slam": {"loops": {"odd": 2}}})
    with pytest.raises(RetiredKey, match=r"^slam was 7 then"):
        drop_retired(Robot, {"slam": 7})


def test_a_whole_table_of_constants_is_dropped() -> None:
    """Also where it is empty, or has some of the keys."""
    for table in ({}, {"loops": {}}, {"loops": {"every_m": 0.5}}):
        values: dict[str, Any] = {"slam": table, "front": {}}
        drop_retired(Robot, values)
        assert values == {"front": {}}


def test_the_advice_names_the_constant() -> None:
    """For a key and for a table; none for other unknown keys."""
    assert advice_of(Wheel, "slip") == ", which earlier versions had: now it is always 0.5; remove it"
    assert advice_of(Robot, "slam") == ", which earlier versions had: now its values are fixed; remove it"
    assert advice_of(Wheel, "radius") == advice_of(None, "slip") == ""


@pytest.mark.parametrize("value", ["0.03", "0.05"])
def test_a_file_with_a_retired_key_gets_a_sentence(tmp_path: Path, value: str) -> None:
    """Whatever its value is: a line that does nothing has no place in a file."""
    path = tmp_path / "robot.toml"
    path.write_text(
        f"{packaged('chefbot_lidar').read_text()}\n[mapping.slam.matching]\nlaser_noise_m = {value}\n"
    )
    with pytest.raises(
        SettingsError, match=r"mapping\.slam: unknown key, which earlier versions had: now its values"
    ):
        load(path)


@pytest.mark.parametrize(
    ("path", "constant"),
    [
        ("drive.max_step_s", 0.1),
        ("drive.longest_step_s", 0.1),
        ("drive.saturation_recovery_per_s", 0.5),
        ("drive.regain_per_s", 0.5),
        ("safety.off_target.least_m_s", 0.04),
        ("safety.off_target.lasts_s", 2.0),
        ("safety.off_target.filter_s", 1.0),
        ("safety.battery.filter_s", 1.0),
        ("sim.motor.static_to_kinetic_friction", 1.3),
        ("sim.lidar.wobble_s", 3.0),
        ("sim.lidar.glass_square", 0.97),
        ("sim.lidar.handover_s", 0.01),
    ],
)
def test_a_recording_may_hold_a_key_that_nobody_set(path: str, constant: float, tmp_path: Path) -> None:
    """With the default of then, which is the constant; a file may not, and is told what to do."""
    *tables, key = path.split(".")
    values: dict[str, Any] = {key: constant}
    for name in reversed(tables):
        values = {name: values}
    drop_retired(Settings, values)
    assert key not in str(values)
    file = tmp_path / "robot.toml"
    file.write_text(f'extends = "chefbot"\n[{".".join(tables)}]\n{key} = {constant}\n')
    with pytest.raises(SettingsError, match=f"{path}: unknown key, .* it is always {constant}; remove it"):
        load(file)
