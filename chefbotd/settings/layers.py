"""The layers of a configuration's values: the file, then the environment, then the command line.

A file's values are already typed. A variable is text: where it reads as a TOML value it is that value, else a string.
"""

import tomllib
from collections.abc import Mapping
from typing import Any, TypeAlias

Keys: TypeAlias = tuple[str, ...]

ENVIRONMENT_PREFIX = "CHEFBOTD_"


class UnknownKey(Exception):
    """A key that leads nowhere; its text is ready to be shown."""


def from_environment(environment: Mapping[str, str]) -> dict[Keys, str]:
    """``CHEFBOTD_LINK__DEVICE=x`` as ``("link", "device"): "x"``."""
    return {
        tuple(name.removeprefix(ENVIRONMENT_PREFIX).lower().split("__")): text
        for name, text in environment.items()
        if name.startswith(ENVIRONMENT_PREFIX)
    }


def variable(keys: Keys) -> str:
    """The name of the variable that sets this key."""
    return ENVIRONMENT_PREFIX + "__".join(keys).upper()


def read(text: str) -> object:
    """What a variable's text means: ``7`` a number, ``true`` a condition, ``[1, 2]`` a list, ``/dev/x`` a string."""
    try:
        document = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    value = document.get("value")
    return value if len(document) == 1 and isinstance(value, bool | int | float | str | list | dict) else text


def place(values: dict[str, Any], keys: Keys, value: object) -> Keys:
    """Put a value where its keys lead, making sections on the way.

    A list's entry goes by its ``name``, in any case, or by its number, from 0; with the latter the keys are returned.

    Raises:
        UnknownKey: the way leads through a value, or to an entry that the list does not have.
    """
    *sections, name = keys
    inner: Any = values
    path: list[str] = []
    for section in sections:
        if isinstance(inner, dict):
            path.append(section)
            inner = inner.setdefault(section, {})
        else:
            index = _index(inner, section, keys)
            path.append(str(index))
            inner = inner[index]
        if not isinstance(inner, dict | list):
            raise UnknownKey(f"{'.'.join(keys)}: {section} is a value, not a section")
    if isinstance(inner, dict):
        inner[name] = value
        return (*path, name)
    index = _index(inner, name, keys)
    inner[index] = value
    return (*path, str(index))


def _index(entries: list[Any], text: str, keys: Keys) -> int:
    if text.isascii() and text.isdigit() and int(text) < len(entries):
        return int(text)
    names = [str(entry.get("name", "")) if isinstance(entry, dict) else "" for entry in entries]
    lowered = [name.lower() for name in names]
    if text and lowered.count(text.lower()) == 1:
        return lowered.index(text.lower())
    choices = [f"0 to {len(entries) - 1}", *filter(None, names)]
    raise UnknownKey(f"{'.'.join(keys)}: there is no entry {text}, only {', '.join(choices)}")
