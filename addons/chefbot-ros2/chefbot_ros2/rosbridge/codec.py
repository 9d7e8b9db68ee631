"""ROS messages as rosbridge has them in JSON, and back."""

import base64
import math
from functools import cache
from typing import Any

import numpy as np
from msgspec import Raw
from rosbags.interfaces import Nodetype

from chefbot_ros2.messages import TYPESTORE


class NotAMessage(ValueError):
    """What came is no message of that type; the text says where."""


MANY, LEAST_CELL = 10_000, -99
_CELLS = np.frombuffer(
    b"".join(b"%3d," % max(LEAST_CELL, cell) for cell in (*range(128), *range(-128, 0))), dtype=np.uint32
)
"""Each byte as JSON in four letters, with spaces before it, which mean nothing there."""


def _cells(cells: Any) -> bytes:
    """A map's cells as JSON, without a number of Python for each: a stop waits while they are made."""
    text: bytes = _CELLS.take(cells.view(np.uint8)).tobytes()
    return b"[" + text[:-1] + b"]"


@cache
def _field_names(type_name: str) -> tuple[str, ...]:
    _, members = TYPESTORE.fielddefs[type_name]
    return tuple(name for name, _ in members)


def to_json(value: Any) -> Any:
    """A message with all that it holds. Bytes are base64, and what is not finite is null, as rosbridge has it."""
    if isinstance(value, np.ndarray):
        if value.dtype == np.uint8:
            return base64.b64encode(value.tobytes()).decode()
        if value.dtype == np.int8 and value.size > MANY and value.min() >= LEAST_CELL:
            return Raw(_cells(value))
        if value.dtype.kind == "f" and not np.isfinite(value).all():
            return [item if math.isfinite(item) else None for item in value.tolist()]
        return value.tolist()
    if hasattr(value, "__msgtype__"):
        return {name: to_json(getattr(value, name)) for name in _field_names(value.__msgtype__)}
    if isinstance(value, list):
        return [to_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def full_name(name: Any) -> str:
    """``geometry_msgs/msg/Twist``, also of ROS 1's ``geometry_msgs/Twist``; raises ``NotAMessage`` for no text."""
    if not isinstance(name, str):
        raise NotAMessage("expected the name of a type")
    package, _, rest = name.partition("/")
    return f"{package}/msg/{rest.rpartition('/')[2]}"


def from_json(type_name: str, value: Any, where: str = "msg") -> Any:
    """A message of this type; what is not given is zero, empty, or the unit quaternion.

    Raises:
        NotAMessage: it has a field that the type has not, or one of another kind.
    """
    if not isinstance(value, dict):
        raise NotAMessage(f"{where}: expected an object")
    _, members = TYPESTORE.fielddefs[type_name]
    names = [name for name, _ in members]
    if unknown := sorted(set(value) - set(names)):
        raise NotAMessage(f"{where}: {type_name} has no {', '.join(unknown)}; it has {', '.join(names)}")
    if type_name == "geometry_msgs/msg/Quaternion" and not value:
        value = {"w": 1.0}
    return TYPESTORE.types[type_name](
        **{name: _member(kind, value.get(name), f"{where}.{name}") for name, kind in members}
    )


def _member(kind: Any, value: Any, where: str) -> Any:
    node, about = kind
    if node is Nodetype.NAME:
        return from_json(about, {} if value is None else value, where)
    if node is Nodetype.BASE:
        return _number_or_text(about[0], value, where)
    (_, _), count = about
    if value is None:
        return np.zeros(count)
    if not isinstance(value, list) or (node is Nodetype.ARRAY and len(value) != count):
        raise NotAMessage(f"{where}: expected a list of {count}")
    return np.array([_number_or_text("float64", item, where) for item in value])


def _number_or_text(base: str, value: Any, where: str) -> Any:
    if base == "string":
        if value is not None and not isinstance(value, str):
            raise NotAMessage(f"{where}: expected text")
        return value or ""
    if value is None:
        return 0.0 if base.startswith("float") else 0
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise NotAMessage(f"{where}: expected a number")
    try:
        return float(value) if base.startswith("float") else int(value)
    except (
        OverflowError,
        ValueError,
    ) as problem:  # more digits than a double has, or infinite for a whole number
        raise NotAMessage(f"{where}: this number does not fit {base}") from problem
