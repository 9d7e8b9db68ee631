"""Error messages for a configuration: a line for each refused value, with its key and its source."""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias, get_args

from pydantic import BaseModel, SecretStr, ValidationError

from chefbotd.settings.retired import advice_of

# The layers of a configuration's values: the file, then the environment, then the command line.
#
# A file's values are already typed. A variable is text: where it reads as a TOML value it is that value, else a string.

Keys: TypeAlias = tuple[str, ...]

ENVIRONMENT_PREFIX = "CHEFBOTD_"


class UnknownKey(Exception):
    """A key that does not exist; its text is ready to be shown."""


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
    """The value of a variable's text: ``7`` is a number, ``true`` a boolean, ``[1, 2]`` a list, ``/dev/x`` a string."""
    try:
        document = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    value = document.get("value")
    return value if len(document) == 1 and isinstance(value, bool | int | float | str | list | dict) else text


def place(values: dict[str, Any], keys: Keys, value: object) -> Keys:
    """Set the value at these keys; missing sections are made.

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


class SettingsError(Exception):
    """A configuration that cannot be used; its text is ready to be shown.

    ``differences`` are those between the configuration and a description of one's own, a line each.
    """

    def __init__(self, message: str, differences: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.differences = list(differences)


class MissingExtraError(SettingsError):
    """A configuration that cannot be checked without a package of an extra; the text names it."""


def blame_source(wrong: str, origins: Mapping[Keys, str], path: Path) -> str:
    """The source of the value that a message begins with; where other sources are mentioned, with them."""
    places = {(place, origins[keys]) for keys in origins if (place := wrong.find(".".join(keys))) >= 0}
    overriding = [source.removesuffix(": ") for _, source in sorted(places) if source]
    if not overriding:
        return f"{path}: " if not any(place == 0 for place, _ in places) else ""
    return f"{overriding[0]}: " if min(places)[0] == 0 else f"{path}, with {' and '.join(overriding)}: "


def explain(
    error: ValidationError,
    model: type[BaseModel],
    values: Mapping[str, Any],
    origins: Mapping[Keys, str],
    file: str,
) -> str:
    """One line per refused value: its source, its key, what was wrong, and the value."""
    lines = []
    for problem in error.errors():
        loc = tuple(map(str, problem["loc"]))
        origin = next((origins[loc[:n]] for n in range(len(loc), 0, -1) if loc[:n] in origins), file)
        expected = _expectation(problem["type"], problem["msg"]) + _near_miss(model, problem["type"], loc)
        if not loc:  # of the whole configuration, which nobody wants to read again
            lines.append(f"{origin}{expected}")
            continue
        given = f" (got {problem['input']!r})" if _is_repeated(model, problem["type"], loc) else ""
        lines.append(f"{origin}{join_keys(values, loc)}: {expected}{given}")
    return "\n".join(lines)


_SECRET_KEY = re.compile(r"(token|passw|secret|credential|api_?key)", re.IGNORECASE)


def _is_repeated(model: type[BaseModel], kind: str, keys: Keys) -> bool:
    """Whether a refused value is shown: one of an unknown key, of a plug-in, or of a key for secrets may be a secret."""
    is_secret = any(_SECRET_KEY.search(key) for key in keys) or keys[:2] == ("plugins", "settings")
    section = _model_at(model, keys[:-1])
    field = None if section is None else section.model_fields.get(keys[-1])
    is_secret = is_secret or (field is not None and _holds_secret(field.annotation))
    return kind not in ("missing", "extra_forbidden") and not is_secret


def _holds_secret(annotation: object) -> bool:
    return annotation is SecretStr or any(_holds_secret(argument) for argument in get_args(annotation))


_RENAMED = {
    "api": {
        "stop_places": "reserved_stop_connections",
        "stuck_s": "write_timeout_s",
        "authenticate_s": "authenticate_timeout_s",
        "request_s": "request_timeout_s",
        "idle_s": "idle_timeout_s",
    },
    "depth_camera": {"silent_s": "silence_timeout_s"},
    "drive": {
        "yield_per_s": "saturation_slowdown_per_s",
    },
    "encoders": {"slack_counts": "tolerance_counts"},
    "infrared": {"longest_gap_s": "max_gap_s"},
    "link": {"reconnect_first_s": "reconnect_delay_s", "reconnect_longest_s": "max_reconnect_delay_s"},
    "localization": {"lidar": "lidars", "search_by_itself": "auto_search", "save_every_s": "save_period_s"},
    "mapping": {"lidar": "lidars", "told_every_s": "publish_period_s", "autosave_s": "autosave_period_s"},
    "recording": {"without": "exclude"},
    "safety": {"let_go_s": "stop_hold_s", "deaf": "unresponsive"},
    "safety.echo": {"believed_after": "min_confirmations", "forgiven": "decay_per_match"},
    "safety.overspeed": {"lasts_s": "duration_s", "late_s": "stamp_error_s"},
    "safety.unresponsive": {"slack_m": "tolerance_m"},
    "safety.wheels": {
        "rolls_on_s": "coast_s",
        "forgotten_s": "decay_s",
        "forgiven_per_reading": "decay_per_reading",
    },
    "same_side": {"slack_m": "tolerance_m"},
    "sim.people": {"waits": "stops_for_robot", "keeps_m": "min_distance_m", "goes_round": "closed_path"},
    "watchdog": {"patience_s": "timeout_s"},
    "worker": {
        "start_s": "start_timeout_s",
        "silent_s": "silence_timeout_s",
        "step_s": "step_timeout_s",
        "most_memory_mb": "max_memory_mb",
        "restart_after_s": "restart_delay_s",
        "restart_at_most_s": "max_restart_delay_s",
    },
}
RENAMED: Mapping[Keys, str] = {
    (*section.split("."), old): new for section, names in _RENAMED.items() for old, new in names.items()
}
"""Keys of earlier versions, and their present names; list entries are without their number."""

MOVED: Mapping[Keys, str] = {
    ("sim", "body", "left_radius_multiplier"): "sim.true.wheels.NAME.radius_m",
    ("sim", "body", "right_radius_multiplier"): "sim.true.wheels.NAME.radius_m",
    ("sim", "body", "left_slip"): "sim.true.left_slip",
    ("sim", "body", "right_slip"): "sim.true.right_slip",
}
"""Keys of the simulator that an earlier version had in another section. A replay needs none of them."""


def with_new_names(values: dict[str, Any]) -> dict[str, Any]:
    """A configuration of an earlier version with today's keys; one in a recording cannot be edited."""
    for (*sections, old), new in RENAMED.items():
        for section in _sections(values, sections):
            if old in section:
                value = section.pop(old)
                section[new] = [value] if new == "lidars" and isinstance(value, str) else value
    for *sections, old in MOVED:
        for section in _sections(values, sections):
            section.pop(old, None)
    return values


def _sections(values: Any, names: Sequence[str]) -> Iterator[dict[str, Any]]:
    """The tables with this name, those in lists too."""
    if isinstance(values, list):
        for item in values:
            yield from _sections(item, names)
    elif isinstance(values, dict) and names:
        yield from _sections(values.get(names[0]), names[1:])
    elif isinstance(values, dict):
        yield values


def join_keys(values: object, loc: Keys) -> str:
    """A key with dots. An entry of a list has its name in it, or its number if it has no name."""
    words, inner = [], values
    for key in loc:
        if isinstance(inner, list) and key.isdigit() and int(key) < len(inner):
            inner = inner[int(key)]
            name = inner.get("name") if isinstance(inner, dict) else None
            words.append(name if isinstance(name, str) and name else key)
        else:
            inner = inner.get(key) if isinstance(inner, dict) else None
            words.append(key)
    return ".".join(words)


def _expectation(kind: str, message: str) -> str:
    if kind == "extra_forbidden":
        return "unknown key"
    if kind == "missing":
        return "this key is required"
    message = message.removeprefix("Value error, ")
    return message[0].lower() + message[1:]


def _near_miss(model: type[BaseModel], kind: str, loc: Keys) -> str:
    """The key that was probably meant: the new name of a renamed key, or a similar one."""
    if kind != "extra_forbidden":
        return ""
    keys = tuple([key for key in loc if not key.isdigit()])
    if renamed := RENAMED.get(keys) or MOVED.get(keys):
        return f", it is now called {renamed}"
    section, names = _model_at(model, loc[:-1]), []
    if advice := advice_of(section, loc[-1]):
        return advice
    if section is not None:
        names = [field.alias or name for name, field in section.model_fields.items()]
    import difflib  # rarely needed, and slow to import

    close = difflib.get_close_matches(loc[-1], names, n=1)
    if len(loc) == 1 and not close and _is_offered(loc[0]):
        return f"; it is the section of an installed component, which is not allowed: [plugins] allow = ['{loc[0]}']"
    return f", did you mean {close[0]}?" if close else ""


def _is_offered(name: str) -> bool:
    """Whether an installed package offers a component of this name."""
    from importlib.metadata import entry_points  # rarely needed, and slow to import

    return bool(entry_points(group="chefbotd.components", name=name))


def _model_at(model: type[BaseModel], loc: Keys) -> type[BaseModel] | None:
    """The section at these keys; numbers and names below it lead to its entries, which have the same model."""
    inner: type[BaseModel] | None = model
    for key in loc:
        if inner is not None and key in inner.model_fields:
            inner = _model_in(inner.model_fields[key].annotation)
    return inner


def _model_in(annotation: object) -> type[BaseModel] | None:
    """The model in ``Model``, ``Model | None``, ``tuple[Model, ...]`` or ``Mapping[str, Model]``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    models = (_model_in(argument) for argument in get_args(annotation))
    return next((model for model in models if model is not None), None)
