"""Takes what the parts of a daemon remember: every attribute, and what hangs on it, but for code and wiring.

A part that is added to the daemon is taken with the others, without a line of its own. What is no plain value, and is
not known here, is told in ``left_out`` by the way to it.
"""

import asyncio
import math
from base64 import b64encode
from collections import deque
from collections.abc import Mapping
from enum import Enum
from itertools import count
from typing import Any

import msgspec
from pydantic import BaseModel

from chefbotd.entries import EntryTimer
from chefbotd.snapshot.classes import TAG, WIRING, is_code, is_frozen, is_ours, name_of, next_of
from chefbotd.snapshot.restorable import Restorable, held_by

SKIPPED: Any = object()
_PLAIN = frozenset({int, str, bool, type(None)})
_LARGEST = 2**63

_models: dict[int, tuple[BaseModel, Any]] = {}
"""Parameters never change, and are written as JSON once; the model is kept, so that its id stays its own."""


class Capture:
    """What is not ``restorable`` is left out, and told."""

    def __init__(self, restorable: Restorable) -> None:
        self._restorable = restorable
        self._numbers: dict[int, int] = {}
        self.left_out: list[str] = []

    def capture_parts(self, parts: Mapping[str, object]) -> dict[str, Any]:
        """The parts by their names, as what JSON can hold."""
        return {name: self._value(part, name) for name, part in parts.items()}

    def _value(self, value: Any, way: str) -> Any:
        kind = type(value)
        if kind is float:
            return value if math.isfinite(value) else {TAG: "float", "is": repr(value)}
        if kind in _PLAIN:
            return value if kind is not int or abs(value) < _LARGEST else {TAG: "int", "is": str(value)}
        if kind is tuple:
            return self._items("tuple", value, way)
        if kind is list:
            return self._items("list", value, way)
        if isinstance(value, dict):
            return self._pairs(value, way)
        if kind in (bytes, bytearray):
            return {TAG: kind.__name__, "is": b64encode(value).decode()}
        if kind is deque:
            return self._items("deque", value, way)
        if isinstance(value, WIRING) or is_code(value):
            return SKIPPED
        return self._object(value, kind, way)

    def _object(self, value: Any, kind: Any, way: str) -> Any:
        if isinstance(value, type) and value in self._restorable:
            return {TAG: "class", "of": name_of(value)}
        if is_ours(kind):
            return self._own(value, kind, way)
        if kind in (set, frozenset):
            return self._items(kind.__name__, sorted(value, key=repr), way)
        if kind is asyncio.Event:
            return {TAG: "event", "is": value.is_set()}
        if asyncio.isfuture(value):
            return self._future(value, way)
        if kind is count:
            return {TAG: "count", "is": next_of(value)}
        if kind.__module__ == "numpy":
            return self._array(value)
        if not isinstance(value, asyncio.BaseTransport):
            self._leave_out(value, way)
        return SKIPPED

    def _own(self, value: Any, kind: Any, way: str) -> Any:
        if isinstance(value, asyncio.BaseTransport):
            return SKIPPED
        if isinstance(value, EntryTimer):
            return self._timer(value, way)
        if kind not in self._restorable:
            self._leave_out(value, way)
            return SKIPPED
        if isinstance(value, Enum):
            return {TAG: "enum", "of": name_of(kind), "is": value.name}
        if isinstance(value, BaseModel):
            return self._model(value)
        if is_frozen(kind):
            return {TAG: "value", "of": name_of(kind), "is": self._fields(value, kind, way)}
        known = self._numbers.get(id(value))
        if known is not None:
            return {TAG: "same", "as": known}
        number = self._numbers[id(value)] = len(self._numbers)
        return {TAG: "object", "of": name_of(kind), "no": number, "is": self._fields(value, kind, way)}

    def _fields(self, value: Any, kind: Any, way: str) -> dict[str, Any]:
        told = {}
        for name, each in held_by(value).items():
            taken = self._value(each, f"{way}.{name}")
            if taken is not SKIPPED:
                told[name] = taken
        return told

    def _items(self, kind: str, values: Any, way: str) -> Any:
        """A container of code is wiring."""
        taken = [self._value(each, f"{way}[]") for each in values]
        if any(each is SKIPPED for each in taken):
            return SKIPPED
        return {TAG: kind, "is": taken}

    def _pairs(self, value: dict[Any, Any], way: str) -> Any:
        keys = [self._value(each, f"{way} key") for each in value]
        taken = [self._value(each, f"{way}[{key}]") for key, each in value.items()]
        if any(each is SKIPPED for each in (*keys, *taken)):
            return SKIPPED
        return {TAG: "dict", "is": [list(pair) for pair in zip(keys, taken, strict=True)]}

    def _model(self, model: BaseModel) -> Any:
        known = _models.get(id(model))
        if known is None:
            told = {
                TAG: "model",
                "of": name_of(type(model)),
                "is": msgspec.Raw(model.model_dump_json().encode()),
            }
            known = _models[id(model)] = (model, told)
        return known[1]

    def _timer(self, timer: EntryTimer, way: str) -> Any:
        """What it calls is a method of a part."""
        if not timer.waits:
            return {TAG: "timer", "waits": False}
        owner = getattr(timer.callback, "__self__", None)
        if owner is None:
            self._leave_out(timer.callback, way)
            return SKIPPED
        return {
            TAG: "timer",
            "waits": True,
            "name": timer.name,
            "due_s": timer.due_s,
            "owner": self._value(owner, way),
            "calls": getattr(timer.callback, "__name__", ""),
        }

    def _future(self, future: "asyncio.Future[Any]", way: str) -> Any:
        if not future.done():
            return {TAG: "future", "done": False}
        if future.cancelled() or future.exception() is not None:
            self._leave_out(future, way)
            return SKIPPED
        return {TAG: "future", "done": True, "is": self._value(future.result(), way)}

    def _array(self, value: Any) -> Any:
        return {
            TAG: "array",
            "dtype": value.dtype.str,
            "shape": list(value.shape),
            "is": b64encode(value.tobytes()).decode(),
        }

    def _leave_out(self, value: object, way: str) -> None:
        self.left_out.append(f"{way}: a {type(value).__name__}")
