"""What is told of a refused configuration: the key, where it is from, and what was expected."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from chefbotd.settings import Settings, SettingsError, load
from chefbotd.settings.errors import MOVED, RENAMED, explain, with_new_names
from tests.chefbotd.settings.robot_file import spoil


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
            r"link.bawd: unknown key, did you mean baud\?",
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


def test_a_section_that_is_mistyped_is_told_with_the_one_that_was_meant(chefbot: Path):
    """``[ultrasonics]`` comes near ``[ultrasonic]``; what comes near nothing gets no guess."""
    with pytest.raises(SettingsError, match=r"ultrasonics: unknown key, did you mean ultrasonic\?"):
        load(spoil(chefbot, "[ultrasonic]", "[ultrasonics]"))
    with pytest.raises(SettingsError, match=r"zebra: unknown key$"):
        load(spoil(chefbot, "[imu]", "[zebra]"))


@pytest.mark.parametrize(("old", "new"), RENAMED.items(), ids=[".".join(keys) for keys in RENAMED])
def test_a_renamed_key_is_refused_with_its_new_name(old: tuple[str, ...], new: str):
    """A configuration of an earlier version is told what each key is called now, which is a key that there is."""
    told = []
    for key in (old[-1], new):
        values: dict[str, Any] = {key: 12}
        for name in reversed(old[:-1]):
            values = {name: [values] if name in ("infrared", "depth_camera", "people") else values}
        with pytest.raises(ValidationError) as refused:
            Settings.model_validate(values)
        told.append(explain(refused.value, Settings, values, {}, ""))
    assert f"{old[-1]}: unknown key, it is now called {new}" in told[0]
    assert "got 12" not in told[0]
    assert "unknown key" not in told[1]


@pytest.mark.parametrize("key", [keys[-1] for keys in MOVED])
def test_a_key_that_moved_is_refused_with_its_new_place(chefbot: Path, key: str):
    """What a wheel's size and slip are was a matter of ``[sim.body]``; a recording with it can still be replayed."""
    values: dict[str, Any] = {"sim": {"body": {key: 1.0}}}
    with pytest.raises(ValidationError) as refused:
        Settings.model_validate(values)
    told = explain(refused.value, Settings, values, {}, "")
    assert f"sim.body.{key}: unknown key, it is now called sim.true." in told
    assert with_new_names(values) == {"sim": {"body": {}}}


def test_a_near_miss_in_a_list_and_in_a_named_section(chefbot: Path):
    """A wheel's ``radius`` and a source's ``timeout``: their own keys are suggested."""
    spoil(chefbot, "radius_m = 0.045", "radius = 0.045")
    spoil(chefbot, "timeout_s = 0.2", "timeout = 0.2")
    with pytest.raises(SettingsError) as error:
        load(chefbot)
    assert "chassis.wheels.left_wheel.radius: unknown key, did you mean radius_m?" in str(error.value)
    assert "safety.sources.safety.timeout: unknown key, did you mean timeout_s?" in str(error.value)
