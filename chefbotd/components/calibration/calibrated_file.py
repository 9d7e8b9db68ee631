"""Calibrated values written into a robot's configuration: comments kept, the old file kept, the difference shown."""

import difflib
import shutil
import tomllib
from pathlib import Path
from typing import Any

from tomlkit.exceptions import TOMLKitError

from chefbotd.core.record import Record
from chefbotd.settings.errors import SettingsError
from chefbotd.settings.loader import load
from chefbotd.settings.replace_file import read_writable, replace_file
from chefbotd.settings.toml_edit import Editor
from chefbotd.settings.values import Values, as_written


class Saved(Record, frozen=True):
    """What was written: the file, where the old one is kept, and the lines that differ (a unified diff)."""

    path: str
    kept: str
    difference: str


def save(path: Path, values: Values) -> Saved:
    """Write the values into the configuration at ``path``, in one step or not at all. The old file is kept beside it.

    Raises:
        SettingsError: the file is no configuration, has no such list element, or would be none with the values.
        OSError: it cannot be read, kept or replaced.
    """
    path = path.resolve()
    load(path)
    before = read_writable(path)
    try:
        after = with_values(before, values)
    except (ValueError, TOMLKitError) as error:
        raise SettingsError(f"{path}: cannot be edited: {error}") from error
    kept = replace_keeping(path, after)
    return Saved(str(path), str(kept), difference(path.name, before, after))


def replace_keeping(path: Path, text: str) -> Path:
    """Write this text in the place of the configuration, in one step or not at all; returns where the old one is kept.

    Raises:
        SettingsError: the text is no configuration.
        OSError: the file cannot be kept or replaced.
    """
    kept = _next_free(path)
    try:
        shutil.copy2(path, kept)
        replace_file(path, text)
    except BaseException:
        kept.unlink(missing_ok=True)
        raise
    return kept


def with_values(text: str, values: Values) -> str:
    """The configuration with these values; everything else is unchanged.

    Raises:
        ValueError: a list has no element of that name, or the text has a form that cannot be edited.
    """
    editor = Editor(text)
    written = {key: as_written(key, value) for key, value in values.items()}
    for key, value in written.items():
        *section, name = key.split(".")
        editor.change(tuple(section), {name: value})
    after = editor.text()
    said = tomllib.loads(after)
    wrong = [key for key, value in written.items() if _at(said, key) != value]
    if wrong:
        raise ValueError(
            f"{', '.join(wrong)}: the file has no such section, or in a form that is not supported"
        )
    return after


def difference(name: str, before: str, after: str) -> str:
    """The lines that differ, as a unified diff."""
    lines = difflib.unified_diff(
        before.splitlines(), after.splitlines(), f"{name} (before)", f"{name} (after)", n=1, lineterm=""
    )
    return "\n".join(lines)


def _at(said: Any, key: str) -> Any:
    """The value at this path of a parsed file; None where it has none."""
    for name in key.split("."):
        if isinstance(said, list):
            said = _find_named(said, name)
        elif isinstance(said, dict):
            said = said.get(name)
        else:
            return None
    return said


def _find_named(elements: list[Any], name: str) -> Any:
    """The element of this name. The only one of a list may have none."""
    named = [element for element in elements if element.get("name") == name]
    if not named and len(elements) == 1 and "name" not in elements[0]:
        named = elements
    return named[0] if len(named) == 1 else None


def _next_free(path: Path) -> Path:
    """A name beside the file that nothing has yet: ``robot.toml.before``, ``robot.toml.before-2``, ..."""
    for number in range(1, 10_000):
        kept = path.with_name(f"{path.name}.before{'' if number == 1 else f'-{number}'}")
        if not kept.exists() and not kept.is_symlink():  # a copy would be written where a link leads
            return kept
    raise FileExistsError(f"{path}.before-*: there are 10,000 old files already; remove some")
