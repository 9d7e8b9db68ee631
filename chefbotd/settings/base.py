"""A robot's file with only what differs: ``extends = "chefbot"`` takes everything else from a packaged robot.

A section in the file changes the keys that it names, ``[chassis.wheels.left_wheel]`` those of the wheel of this name; a
list (``[[chassis.wheels]]``) replaces the whole list. ``imu = false`` leaves a section out that the robot lacks.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from chefbotd.packaged import packaged_folder
from chefbotd.settings.errors import SettingsError, UnknownKey, place
from chefbotd.settings.model import Settings

DEFAULT_ROBOT = "chefbot"
EXTENDS = "extends"

OPTIONAL_SECTIONS = tuple(
    name for name, field in Settings.model_fields.items() if field.default is None or field.default == ()
)
"""The sections of parts that a robot may lack."""

SEEING = ("ultrasonic", "infrared", "lidar", "depth_camera")
"""What the obstacle guard sees by. Where the robot has none of it, the base's guard is left out too."""


def packaged(robot: str = DEFAULT_ROBOT) -> Path:
    """The path of this robot's configuration in chefbotd.

    Raises:
        SettingsError: chefbotd has none; the message lists the robots that it has.
    """
    folder = packaged_folder()
    path = folder / f"{robot}.toml"
    if not path.is_file() or path.parent != folder:
        names = ", ".join(sorted(p.stem for p in folder.glob("*.toml")))
        raise SettingsError(f"no configuration comes with chefbotd for robot {robot!r}; there are: {names}")
    return path


def base_of(values: Mapping[str, Any]) -> Path | None:
    """The packaged configuration that a file's values extend; None where the file is whole.

    Raises:
        SettingsError: chefbotd has no such robot.
    """
    if EXTENDS not in values:
        return None
    named = values[EXTENDS]
    if not isinstance(named, str):
        raise SettingsError(
            f"extends: expected the name of a packaged robot, such as {DEFAULT_ROBOT!r}, got {named!r}"
        )
    try:
        return packaged(named)
    except SettingsError as error:
        raise SettingsError(f"extends: {error}") from error


def merge(base: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """The base's values with those of a file that extends it.

    Raises:
        SettingsError: the file names an entry that a list of the base does not have.
    """
    if not isinstance(own.get("safety", {}), dict):
        raise SettingsError(f"safety: expected a section, got {own['safety']!r}")
    merged = {
        **base,
        **{key: _merge_tables(base.get(key), value, key) for key, value in own.items() if key != EXTENDS},
    }
    drop_left_out(merged)
    if not any(merged.get(name) for name in SEEING) and "guard" not in own.get("safety", {}):
        merged["safety"] = {key: value for key, value in merged.get("safety", {}).items() if key != "guard"}
    return merged


def _merge_tables(base: Any, own: Any, key: str) -> Any:
    if not isinstance(own, dict):
        return own
    if isinstance(base, dict):
        inner = {name: _merge_tables(base.get(name), value, f"{key}.{name}") for name, value in own.items()}
        return {**base, **inner}
    if isinstance(base, list) and base:
        return _change_entries(base, own, key)
    return own


def _change_entries(base: list[Any], own: Mapping[str, Any], key: str) -> list[Any]:
    """The base's list with the changes of the entries that are named."""
    changed = {"list": [dict(entry) for entry in base]}
    for name, values in own.items():
        if not isinstance(values, dict):
            raise SettingsError(f"{key}.{name}: expected a section with the keys to change, got {values!r}")
        for inner, value in values.items():
            try:
                place(changed, ("list", name, inner), value)
            except UnknownKey as error:
                raise SettingsError(f"{key}.{str(error).removeprefix('list.')}") from error
    return changed["list"]


def drop_left_out(values: dict[str, Any]) -> None:
    """Remove the sections that are ``false``: the robot has no such part."""
    for name in OPTIONAL_SECTIONS:
        if values.get(name) is False:
            del values[name]
