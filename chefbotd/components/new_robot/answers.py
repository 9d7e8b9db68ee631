"""What was answered and measured, as values of a configuration with their reasons, and the file that holds them."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from chefbotd.core.record import Record
from chefbotd.settings.base import OPTIONAL_SECTIONS
from chefbotd.settings.model import Settings
from chefbotd.settings.toml_edit import Editor, toml_value

Value = str | float | bool
LIDAR_NAME = "lidar"
LIDAR = f"lidar.{LIDAR_NAME}"
NOT_MEASURED = "# Not measured yet, and still "


class FoundValue(Record, frozen=True):
    """A key's value, and how it was found: a comment in the file."""

    value: Value
    reason: str


Answers = Mapping[str, FoundValue]
"""By dotted keys; an entry of a list is named, as in ``chassis.wheels.left_wheel.radius_m``."""


def unmeasured_keys(text: str) -> frozenset[str]:
    """What a robot's file says of itself that was not measured: its values are still the packaged robot's."""
    lines = (line.rstrip() for line in text.splitlines() if line.startswith(NOT_MEASURED))
    return frozenset(line.partition("'s: ")[2] for line in lines)


def differing(answers: Answers, values: Mapping[str, Any]) -> dict[str, FoundValue]:
    """The answers that are not what these values of a file say already."""
    return {key: answer for key, answer in answers.items() if not _is_same(answer.value, _at(values, key))}


def new_file(base: str, answers: Answers, missing: Sequence[str] = ()) -> str:
    """The text of a robot's file with only what differs from the packaged robot ``base``; ``missing`` was skipped."""
    lines = [
        f"# Only what differs from the packaged robot {base!r}; 'chefbotd check-config FILE --all' prints every value.",
        "# Every key: docs/reference/configuration.md. 'chefbotctl new-robot' again proposes what has changed.",
        *[f"{NOT_MEASURED}{base}'s: {key}" for key in missing],
        f'extends = "{base}"',
    ]
    lines += [_line(key, answer) for key, answer in answers.items() if "." not in key]
    sections = dict.fromkeys(key.rpartition(".")[0] for key in answers if "." in key)
    for section in sorted(
        sections, key=lambda name: list(Settings.model_fields).index(name.partition(".")[0])
    ):
        lines += _section(section, answers)
    return "\n".join(lines) + "\n"


def _section(section: str, answers: Answers) -> list[str]:
    """A section's lines after a blank one. A lidar is an entry of a list, which no base has."""
    keys = [key for key in answers if key.rpartition(".")[0] == section]
    header = ["[[lidar]]", f'name = "{LIDAR_NAME}"'] if section == LIDAR else [f"[{section}]"]
    return ["", *header, *(_line(key, answers[key]) for key in keys)]


def edit_answers(text: str, answers: Answers, missing: Sequence[str] = ()) -> str:
    """A robot's file with these answers; else only comments of ours change that are not true any more.

    Raises:
        ValueError: it has a form that cannot be edited.
    """
    present, left_out = tomllib.loads(text), list[str]()
    for name in OPTIONAL_SECTIONS:
        if present.get(name) is False and any(key.startswith(f"{name}.") for key in answers):
            text = re.sub(rf"(?m)^{name} *= *false.*\n?", "", text, count=1)
    editor = Editor(_true_comments(text, answers, missing))
    extends, has_lidar = "extends" in present, isinstance(present.get("lidar"), list)
    for key, answer in answers.items():
        *section, name = key.split(".")
        if ".".join(section) == LIDAR and not has_lidar:
            continue  # appended below
        if not section and answer.value is False:
            editor.drop((name,))
            left_out += [name] if extends else []
        else:
            editor.change(tuple(section), {name: answer.value})
    lines = "".join(f"\n{name} = false" for name in left_out)
    after = re.sub(r"(?m)^extends\s*=.*$", lambda match: match[0] + lines, editor.text(), count=1)
    if not has_lidar and any(key.startswith(f"{LIDAR}.") for key in answers):
        after += "\n".join(_section(LIDAR, answers)) + "\n"
    return after


def _true_comments(text: str, answers: Answers, missing: Sequence[str]) -> str:
    """Without lines about what is measured by now; a changed value with its new reason, if it had one of ours."""
    lines, section = list[str](), ""
    for line in text.splitlines(keepends=True):
        if line.startswith(NOT_MEASURED) and line.rstrip().partition("'s: ")[2] not in missing:
            continue
        if header := re.match(r"\[+([\w.]+)\]+", line):
            section = f"{header[1]}."
        reason = re.match(r"(\w+) *=.*? +# (.*)", line)
        answer = answers.get(f"{section}{reason[1]}") if reason else None
        if reason and answer and _without_numbers(reason[2]) == _without_numbers(answer.reason):
            line = line.replace(reason[2], answer.reason)
        lines.append(line)
    return "".join(lines)


def _without_numbers(reason: str) -> str:
    return re.sub(r"[\d.]+", "0", reason)


def _line(key: str, answer: FoundValue) -> str:
    said = f"{key.rpartition('.')[2]} = {toml_value(answer.value)}"
    return f"{said:<35} # {answer.reason}" if answer.reason else said


def _is_same(value: Value, present: object) -> bool:
    if value is False and present in (None, []):
        return True  # a section that is left out already
    return (type(value) is type(present) and value == present) or (_is_number(value) and value == present)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _at(values: Any, key: str) -> Any:
    """The value at a dotted key; None where there is none."""
    for name in key.split("."):
        if isinstance(values, list):
            values = next((entry for entry in values if entry.get("name") == name), None)
        elif isinstance(values, dict):
            values = values.get(name)
        else:
            return None
    return values
