"""The packaged robots' files: short, and the same robots as before."""

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from chefbotd.settings import load, packaged
from chefbotd.settings.loader import read_values
from chefbotd.settings.reference import sections
from tests.robot_files import full

ROBOTS = ("chefbot", "chefbot_lidar", "khan")
DEFAULTS = {key.key: key.default for section in sections() for key in section.keys}
SAID_NEVERTHELESS = {
    "robot.name",
    "link.device",
    "chassis.track_multiplier",
    "chassis.wheels.NAME.encoder_sign",
    "chassis.wheels.NAME.motor_sign",
    "drive.max_duty",
    "infrared.NAME.name",
    "lidar.NAME.name",
    "lidar.NAME.model",
    "lidar.NAME.mount_y_m",
    "lidar.NAME.mount_yaw_rad",
    "battery.reference_v",
}
"""What everybody looks for in a file of his own, whether it is the default or not."""


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_short_file_is_the_robot_of_the_whole_one(robot: str) -> None:
    """Every value of the loaded configuration; who has a copy of the whole file has the same robot."""
    assert load(packaged(robot)) == load(full(robot))


def entries(values: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, object]]:
    """Each key of a file and its value; NAME is an entry of a list."""
    for name, value in values.items():
        key = f"{path}{name}"
        if isinstance(value, dict):
            yield from entries(value, f"{key}.")
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for one in value:
                yield from entries(one, f"{key}.NAME.")
        else:
            yield key, value


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_packaged_file_has_what_differs_and_no_default(robot: str) -> None:
    """A key that has its default is left out, but for those that everybody looks for."""
    for key, value in entries(tomllib.loads(packaged(robot).read_text(encoding="utf-8"))):
        if key not in SAID_NEVERTHELESS and key in DEFAULTS:
            told = (
                f"{value:g}"
                if isinstance(value, float)
                else f'"{value}"'
                if isinstance(value, str)
                else str(value)
            )
            assert told != DEFAULTS[key], key


def test_a_file_may_extend_a_robot_that_extends_another(tmp_path: Any) -> None:
    """chefbot_lidar is chefbot with a lidar: its values have those of both."""
    values = read_values(packaged("chefbot_lidar"))
    assert values["chassis"]["track_width_m"] == 0.3
    assert values["robot"]["name"] == "chefbot_lidar"
    own = tmp_path / "own.toml"
    own.write_text('extends = "chefbot_lidar"\n[chassis]\ntrack_width_m = 0.31\n')
    settings = load(own)
    assert (settings.chassis.track_width_m, settings.lidar[0].model, settings.pid.kp) == (0.31, "ld19", 200.0)
