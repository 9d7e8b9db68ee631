"""What is wrong with a configuration, for people: a line for each refused value, with its key and where it is from."""

from collections.abc import Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from chefbotd.settings.layers import Keys


class SettingsError(Exception):
    """A configuration that cannot be used; its text is ready to be shown.

    ``differences`` are those between the configuration and a description of one's own, a line each.
    """

    def __init__(self, message: str, differences: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.differences = list(differences)


class MissingExtraError(SettingsError):
    """A configuration that may be right, and cannot be checked without a package of an extra; the text says which."""


def explain(
    error: ValidationError,
    model: type[BaseModel],
    values: Mapping[str, Any],
    origins: Mapping[Keys, str],
    file: str,
) -> str:
    """One line per refused value: where it is from, its key, what was wrong, and the value."""
    lines = []
    for problem in error.errors():
        loc = tuple(map(str, problem["loc"]))
        origin = next((origins[loc[:n]] for n in range(len(loc), 0, -1) if loc[:n] in origins), file)
        expected = _expectation(problem["type"], problem["msg"]) + _near_miss(model, problem["type"], loc)
        if not loc:  # of the whole configuration, which nobody wants to read again
            lines.append(f"{origin}{expected}")
            continue
        given = "" if problem["type"] == "missing" else f" (got {problem['input']!r})"
        lines.append(f"{origin}{dotted(values, loc)}: {expected}{given}")
    return "\n".join(lines)


RENAMED: Mapping[Keys, str] = {
    ("api", "stop_places"): "reserved_stop_connections",
    ("mapping", "told_every_s"): "publish_period_s",
    ("recording", "without"): "exclude",
    ("worker", "most_memory_mb"): "max_memory_mb",
    ("worker", "restart_after_s"): "restart_delay_s",
    ("worker", "restart_at_most_s"): "max_restart_delay_s",
}
"""Keys of earlier versions, and their names today."""


def dotted(values: object, loc: Keys) -> str:
    """A key as it is spelt everywhere: an entry of a list goes by its name, or by its number if it has none."""
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
    """The key that was meant: the new name of a renamed one, or one that a mistyped key comes near."""
    if kind != "extra_forbidden":
        return ""
    if renamed := RENAMED.get(loc):
        return f", it is now called {renamed}"
    section, known = _model_at(model, loc[:-1]), []
    if section is not None:
        known = [field.alias or name for name, field in section.model_fields.items()]
    import difflib  # rarely needed, and slow to import

    close = difflib.get_close_matches(loc[-1], known, n=1)
    return f", did you mean {close[0]}?" if close else ""


def _model_at(model: type[BaseModel], loc: Keys) -> type[BaseModel] | None:
    """The section that these keys lead to; numbers and names within it lead to its entries, which are alike."""
    found: type[BaseModel] | None = model
    for key in loc:
        if found is not None and key in found.model_fields:
            found = _model_in(found.model_fields[key].annotation)
    return found


def _model_in(annotation: object) -> type[BaseModel] | None:
    """The model in ``Model``, ``Model | None``, ``tuple[Model, ...]`` or ``Mapping[str, Model]``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    models = (_model_in(argument) for argument in get_args(annotation))
    return next((model for model in models if model is not None), None)
