"""The reference of every key follows from the classes that check a configuration."""

import re
from collections.abc import Iterator
from typing import Any

import click
import pytest

from chefbotd.cli.programs.chefbotctl import main as chefbotctl
from chefbotd.settings import load, packaged
from chefbotd.settings.reference import FOUND_BY, UNITS, page, sections
from tests.chefbotd.settings.write_reference import PAGE

KEYS = {key.key: key for section in sections() for key in section.keys}


def test_the_page_is_current() -> None:
    """``make client`` writes it; a key that was added or changed shows here."""
    assert PAGE.read_text(encoding="utf-8") == page(), "run: make client"


def test_every_key_says_what_it_is_for() -> None:
    """A sentence that begins and ends as one, of more than its own name, from the model that checks the key."""
    for key in KEYS.values():
        assert key.text.endswith("."), key
        assert len(key.text.split()) >= 4, key
        assert key.text[0] in "`-" or not key.text[0].islower(), key
        assert not re.search(r"\bNone\b", key.text), key


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("odometry.fusion.gyro_noise_rad_per_root_s", "rad per √s"),
        ("sim.board.line_rate_bytes_s", "bytes/s"),
        ("worker.queue_kb", "kB"),
        ("pid.kd_duty_per_m_s2", "duty per m/s²"),
        ("odometry.travel_variance_m2_per_m", "m² per m"),
        ("safety.overspeed.share", ""),
    ],
)
def test_units_follow_from_the_ends_of_keys(key: str, unit: str) -> None:
    """The longest end that is a unit counts: a rate of bytes is no time."""
    assert KEYS[key].unit == unit


def test_no_longer_end_of_a_key_stands_behind_a_shorter_one() -> None:
    """The first that fits is taken."""
    ends = list(UNITS)
    for place, end in enumerate(ends):
        assert not any(end.endswith(f"_{earlier}") for earlier in ends[:place]), end


def _keys_in(path: str, value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        for name, inner in value.items():
            is_named = path in (
                "drive.motors",
                "wheel_pid",
                "safety.sources",
                "sim.true.wheels",
                "sim.true.lidars",
            )
            yield from _keys_in(f"{path}.{'NAME' if is_named else name}" if path else name, inner)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for inner in value:
            yield from _keys_in(f"{path}.NAME", inner)
    elif path.rpartition(".")[2] not in ("NAME",) and value not in ({}, []):
        yield path


@pytest.mark.parametrize("robot", ["chefbot", "chefbot_lidar", "khan"])
def test_every_key_of_the_packaged_robots_is_in_it(robot: str) -> None:
    """Each that ``check-config --all`` prints."""
    values = load(packaged(robot)).model_dump(mode="json", by_alias=True)
    missing = {key for key in _keys_in("", values) if key not in KEYS}
    sections_alone = {key for key in missing if any(known.startswith(f"{key}.") for known in KEYS)}
    assert missing - sections_alone == set()


def test_what_a_key_says_is_what_its_class_checks() -> None:
    """One of each kind, against the classes as they are read by hand."""
    radius = KEYS["chassis.wheels.NAME.radius_m"]
    assert (radius.type, radius.unit, radius.default, radius.bounds) == (
        "number",
        "m",
        "required",
        "above 0 to 1",
    )
    buffer = KEYS["link.board_buffer_bytes"]
    assert (buffer.type, buffer.unit, buffer.default, buffer.bounds) == (
        "whole number", "bytes", "63", "from 32 to 1000000",
    )  # fmt: skip
    assert KEYS["encoders.counted_by"].type == '"sketch" or "firmware"'
    assert KEYS["encoders.max_acceleration_rad_s2"].default == "none"
    assert KEYS["chassis.left_radius_multiplier"].bounds == "from 0.5 to 2"
    assert KEYS["pid.kv_duty_per_m_s"].unit == "duty per m/s"


def test_every_section_says_what_it_is_for() -> None:
    """In a sentence at least."""
    for section in sections():
        assert len(section.purpose) > 20, section.header


def test_the_commands_that_find_keys_are_there() -> None:
    """Each key is one of the configuration's or a section, each command one of chefbotctl's."""
    for key, command in FOUND_BY.items():
        assert key in KEYS or any(known.startswith(f"{key}.") for known in KEYS), key
        program, *words = command.split()
        assert program == "chefbotctl"
        group: click.Command = chefbotctl
        while isinstance(group, click.Group):
            found = group.get_command(click.Context(group), words.pop(0))
            assert found is not None, command
            group = found
        if group.name == "calibrate":
            assert words[0] in (
                "encoders",
                "battery",
                "motors",
                "wheels",
                "umbmark",
                "lidar",
                "imu",
                "sensors",
            )
