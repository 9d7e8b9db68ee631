"""Every key of a configuration: its type, unit, default and bounds, what it is for, and which command finds it."""

import inspect
import re
from collections.abc import Iterator, Mapping
from enum import Enum
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from chefbotd.core.record import Record
from chefbotd.settings.key_texts import text_of
from chefbotd.settings.model import Settings

UNITS: Mapping[str, str] = {
    "duty_per_m_s2": "duty per m/s²",
    "duty_per_m_s": "duty per m/s",
    "duty_per_m": "duty per m",
    "rad_s_per_duty": "rad/s per duty",
    "variance_m2_per_m": "m² per m",
    "variance_rad2_per_rad": "rad² per rad",
    "rad_s_per_root_s": "rad/s per √s",
    "rad_per_root_s": "rad per √s",
    "rad_per_root_m": "rad per √m",
    "m_per_root_m": "m per √m",
    "rad_per_rad": "rad per rad",
    "m_per_rad": "m per rad",
    "rad_per_m": "rad per m",
    "m_per_m": "m per m",
    "counts_per_deg_s": "counts per °/s",
    "counts_per_g": "counts per g",
    "counts_per_turn": "counts per turn",
    "kg_m2": "kg m²",
    "n_m": "N m",
    "rad_s3": "rad/s³",
    "rad_s2": "rad/s²",
    "rad_s": "rad/s",
    "m_s3": "m/s³",
    "m_s2": "m/s²",
    "m_s": "m/s",
    "turns_per_s": "turns/s",
    "points_per_s": "points/s",
    "per_s": "1/s",
    "per_m": "1/m",
    "bytes_s": "bytes/s",
    "bytes": "bytes",
    "duty": "duty",
    "counts": "counts",
    "bits": "bits",
    "rpm": "1/min",
    "ohm": "Ω",
    "ah": "Ah",
    "hz": "Hz",
    "minutes": "min",
    "kb": "kB",
    "mb": "MB",
    "px": "pixels",
    "ms": "ms",
    "kg": "kg",
    "rad": "rad",
    "m": "m",
    "s": "s",
    "v": "V",
    "a": "A",
}
"""Units by the ends of keys, longer ends first."""

FOUND_BY: Mapping[str, str] = {
    "link.device": "chefbotctl ports",
    "link.baud": "chefbotctl ports --listen",
    "robot.wire": "chefbotctl new-robot",
    "encoders.counts_per_turn": "chefbotctl calibrate encoders",
    "encoders.max_speed_rad_s": "chefbotctl new-robot",
    "encoders.max_acceleration_rad_s2": "chefbotctl new-robot",
    "drive.max_rim_speed_m_s": "chefbotctl new-robot",
    "drive.max_duty": "chefbotctl doctor --motors",
    "drive.motors": "chefbotctl calibrate motors",
    "drive.motor_voltage_v": "chefbotctl calibrate motors",
    "drive.response_delay_s": "chefbotctl doctor --motors",
    "pid.kp_duty_per_m_s": "chefbotctl calibrate motors",
    "pid.ki_duty_per_m": "chefbotctl calibrate motors",
    "pid.ks_duty": "chefbotctl calibrate motors",
    "pid.kv_duty_per_m_s": "chefbotctl calibrate motors",
    "pid.ka_duty_per_m_s2": "chefbotctl calibrate motors",
    "wheel_pid.NAME.kp_duty_per_m_s": "chefbotctl pid tune",
    "wheel_pid.NAME.ki_duty_per_m": "chefbotctl pid tune",
    "wheel_pid.NAME.kd_duty_per_m_s2": "chefbotctl pid tune",
    "chassis.track_width_m": "chefbotctl new-robot",
    "chassis.track_multiplier": "chefbotctl calibrate wheels",
    "chassis.left_radius_multiplier": "chefbotctl calibrate wheels",
    "chassis.right_radius_multiplier": "chefbotctl calibrate wheels",
    "chassis.wheels.NAME.radius_m": "chefbotctl new-robot",
    "chassis.wheels.NAME.motor_sign": "chefbotctl calibrate motors",
    "chassis.wheels.NAME.encoder_sign": "chefbotctl calibrate motors",
    "battery.divider_ratio": "chefbotctl calibrate battery",
    "imu.gyro_scale": "chefbotctl calibrate imu",
    "imu.gyro_bias_rad_s": "chefbotctl calibrate imu",
    "imu.lag_s": "chefbotctl calibrate imu",
    "lidar.NAME.mount_x_m": "chefbotctl calibrate wheels",
    "lidar.NAME.mount_y_m": "chefbotctl calibrate wheels",
    "lidar.NAME.mount_yaw_rad": "chefbotctl calibrate wheels",
    "lidar.NAME.device": "chefbotctl ports --listen",
    "ultrasonic.offset_m": "chefbotctl calibrate sensors",
    "infrared.NAME.offset_m": "chefbotctl calibrate sensors",
}
"""The command that finds a key, or each key of a section."""

INTRODUCTION = """# Every key of a configuration

Written by `make client` from the classes that check a configuration. A robot's file is TOML. It may begin with
`extends = "chefbot"` (or `khan`, `chefbot_lidar`): it then needs only the keys that differ from that robot's, and has
the others from it. `imu = false` leaves a section out that the other robot has. Unknown keys are refused.

- *required* is a key without a default. A file with `extends` has it from the robot that it extends.
- *none* is a key that is off, or follows from others, where it is left out.
- *Found by* names the command that measures the value; the others are choices, or are measured with a tape.
- Values have the unit that they are given in; a key's name ends in it.
- `[[NAME]]` is a list: any number of tables. `chassis.wheels` and other lists of a robot that is extended can be changed
  by name, as `[chassis.wheels.left_wheel]`.
- A key may be set in the environment: `CHEFBOTD_LINK__DEVICE=/dev/ttyUSB0` overrides `[link] device`.

`chefbotd check-config FILE` prints the values that matter, `--all` every value as it results."""


class KeyReference(Record, frozen=True):
    """One key. An entry of a list or of a table of names is NAME in it; an empty ``unit`` or ``bounds`` is none."""

    key: str
    text: str
    type: str
    unit: str
    default: str
    bounds: str
    found_by: str


class SectionReference(Record, frozen=True):
    """A table of the file: its header, what it is for, and its keys."""

    header: str
    purpose: str
    keys: tuple[KeyReference, ...]


def sections() -> Iterator[SectionReference]:
    """Every section of a configuration, in the order of the model."""
    for name, field in Settings.model_fields.items():
        yield from _sections_of(name, field.annotation)


def _sections_of(path: str, annotation: Any) -> Iterator[SectionReference]:
    model, container = _model_in(annotation)
    if model is None:
        return
    repeated = "" if container is None else ".NAME"
    keys, inner = [], []
    for name, field in model.model_fields.items():
        key = field.alias or name
        if _model_in(field.annotation)[0] is not None:
            inner.append((f"{path}{repeated}.{key}", field.annotation))
        else:
            keys.append(_key(f"{path}{repeated}.{key}", text_of(model, name, field), field))
    header = f"[[{path}]]" if container is tuple else f"[{path}{repeated}]"
    yield SectionReference(header, purpose_of(model), tuple(keys))
    for inner_path, inner_annotation in inner:
        yield from _sections_of(inner_path, inner_annotation)


def _key(path: str, text: str, field: FieldInfo) -> KeyReference:
    return KeyReference(
        path,
        text,
        type_name(field.annotation),
        unit_of(path.rpartition(".")[2]),
        _default(field),
        _bounds(field),
        found_by(path),
    )


def found_by(path: str) -> str:
    """The command that finds this key; empty where it is a choice."""
    names = path.split(".")
    prefixes = (".".join(names[:count]) for count in range(len(names), 0, -1))
    return next((FOUND_BY[prefix] for prefix in prefixes if prefix in FOUND_BY), "")


def unit_of(key: str) -> str:
    """The unit that a key ends in."""
    return next((unit for end, unit in UNITS.items() if key == end or key.endswith(f"_{end}")), "")


def purpose_of(model: type[BaseModel]) -> str:
    """What a section is for: its class' own words, with the codes of its keys as Markdown."""
    words = re.sub(r"``", "`", inspect.getdoc(model) or "")
    return re.sub(r"\n(?!\n)", " ", words.replace("\n\n", "\0")).replace("\0", "\n\n")


def _model_in(annotation: Any) -> tuple[type[BaseModel] | None, type | None]:
    """The model in ``Model``, ``Model | None``, ``tuple[Model, ...]`` or ``Mapping[str, Model]``, and the container."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation, None
    origin = get_origin(annotation)
    container = (
        tuple if origin is tuple else dict if origin is not None and issubclass_of_mapping(origin) else None
    )
    for argument in get_args(annotation):
        model, inner = _model_in(argument)
        if model is not None:
            return model, container or inner
    return None, None


def issubclass_of_mapping(origin: Any) -> bool:
    """Whether a generic type's origin is a mapping."""
    return isinstance(origin, type) and issubclass(origin, Mapping)


def type_name(annotation: Any) -> str:
    """A type in a configuration's words: number, whole number, text, yes/no, or the words that may be said."""
    origin = get_origin(annotation)
    if origin is Annotated:
        return type_name(get_args(annotation)[0])
    if origin is Literal:
        return " or ".join(_literal(value) for value in get_args(annotation))
    if origin in (Union, UnionType):
        return " or ".join(type_name(one) for one in get_args(annotation) if one is not NoneType)
    if origin is tuple or origin in (list, frozenset, set):
        inner = [one for one in get_args(annotation) if one is not ...]
        fixed = Ellipsis not in get_args(annotation) and origin is tuple
        named = type_name(inner[0])
        is_choice = isinstance(inner[0], type) and issubclass(inner[0], Enum)
        several = named.replace("list of", "lists of") if named.startswith("list") else f"{named}s"
        several = named if is_choice else several
        return f"list of {len(inner)} {several}" if fixed else f"list of {several}"
    if origin is not None and issubclass_of_mapping(origin):
        return "table"
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return " or ".join(_literal(member.value) for member in annotation)
    names = {bool: "true or false", int: "whole number", float: "number", str: "text"}
    return names.get(
        annotation, {"Path": "path", "SecretStr": "text"}.get(getattr(annotation, "__name__", ""), "text")
    )


def _literal(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def _default(field: FieldInfo) -> str:
    if field.default_factory is not None:
        return ""
    if field.default is PydanticUndefined:
        return "required"
    if field.default is None:
        return "none"
    value = field.default
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple | frozenset | set | list):
        plain = [one.value if isinstance(one, Enum) else one for one in value]
        return str(sorted(plain) if isinstance(value, frozenset | set) else plain)
    return (
        f"{value:g}"
        if isinstance(value, float)
        else _literal(value)
        if isinstance(value, str)
        else str(value)
    )


def _number(value: float) -> str:
    """Without an exponent, as a file would have it."""
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else f"{value:g}"


_SIGNS = {annotated_types.Gt: ("gt", "above"), annotated_types.Ge: ("ge", "from"), annotated_types.Lt: ("lt", "below"),
          annotated_types.Le: ("le", "to")}  # fmt: skip


def _bounds(field: FieldInfo) -> str:
    words = []
    for constraint in _constraints(field):
        for kind, (attribute, word) in _SIGNS.items():
            if isinstance(constraint, kind):
                words.append(f"{word} {_number(getattr(constraint, attribute))}")
    return " ".join(words)


def _constraints(field: FieldInfo) -> list[object]:
    """The field's own constraints, and those of an annotated type within it."""
    constraints: list[object] = list(field.metadata)
    pending = [field.annotation]
    while pending:
        annotation = pending.pop()
        if get_origin(annotation) is Annotated:
            first, *rest = get_args(annotation)
            for one in rest:
                constraints += one.metadata if isinstance(one, FieldInfo) else [one]
            pending.append(first)
        elif get_origin(annotation) in (Union, UnionType):
            pending += get_args(annotation)
    return constraints


def page() -> str:
    """The page docs/reference/configuration.md."""
    parts = [INTRODUCTION]
    for section in sections():
        parts.append(f"## `{section.header}`\n\n{section.purpose}")
        if section.keys:
            rows = ["| key | what it is for | values | default |", "|---|---|---|---|"]
            rows += [_row(key) for key in section.keys]
            parts.append("\n".join(rows))
    return "\n\n".join(parts) + "\n"


def _row(key: KeyReference) -> str:
    name = key.key.rpartition(".")[2]
    text = f"{key.text} Found by `{key.found_by}`." if key.found_by else key.text
    default = f"`{key.default}`" if key.default not in ("", "none", "required") else key.default
    values = ", ".join(part for part in (key.type, key.unit, key.bounds) if part)
    return f"| `{name}` | {text} | {values} | {default} |"
