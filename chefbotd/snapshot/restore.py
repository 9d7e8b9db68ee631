"""Restores a captured state into the objects of another daemon of the same configuration."""

import asyncio
from base64 import b64decode
from collections import Counter, deque
from collections.abc import Callable, Mapping
from enum import Enum
from itertools import count
from typing import Any

import msgspec
from pydantic import BaseModel

from chefbotd.entries import Entries
from chefbotd.snapshot.classes import TAG, NotRestorable, fields_of, is_frozen, name_of
from chefbotd.snapshot.restorable import Restorable, callback_of, fits, hints_of, is_alike

MAX_DEPTH = 60
"""Of values in values; the states of robots have 17."""

NUMBERS = frozenset("biuf")
"""The kinds of numpy's numbers that an array may be of."""


class Restore:
    """``entries`` run the timers. With ``keeps_parameters``, gains and limits stay those of the daemon.

    Nothing is made, set or called that is not ``restorable``, or not of the type of what it stands for.
    """

    def __init__(self, entries: Entries, restorable: Restorable, *, keeps_parameters: bool = False) -> None:
        self._entries, self._restorable, self._keeps_parameters = entries, restorable, keeps_parameters
        self._depth = 0
        self._objects: dict[int, Any] = {}
        self.problems: list[str] = []
        self._kinds: dict[str, Callable[[Any, Any], Any]] = {
            "float": lambda told, there: float(told["is"]),
            "int": lambda told, there: int(told["is"]),
            "bytes": lambda told, there: b64decode(told["is"]),
            "bytearray": lambda told, there: bytearray(b64decode(told["is"])),
            "tuple": self._tuple,
            "list": self._list,
            "deque": self._deque,
            "set": lambda told, there: {self._value(each, None) for each in told["is"]},
            "frozenset": lambda told, there: frozenset(self._value(each, None) for each in told["is"]),
            "dict": self._dict,
            "enum": self._enum,
            "class": lambda told, there: self._restorable.class_named(told["of"]),
            "count": lambda told, there: count(int(told["is"])),
            "array": _array,
            "event": _event,
            "future": self._future,
            "timer": self._timer,
            "model": self._model,
            "value": self._frozen,
            "object": self._object,
            "same": lambda told, there: self._objects[told["as"]],
        }

    def put(self, told: Mapping[str, Any], parts: Mapping[str, object]) -> None:
        """Put every part of ``told`` into the one of this name; what cannot be is in ``problems``."""
        for name, each in told.items():
            if name not in parts:
                self.problems.append(f"the configuration has no {name}")
                continue
            self._depth = 0
            try:
                self._value(each, parts[name])
            except (
                NotRestorable,
                LookupError,
                TypeError,
                ValueError,
                AttributeError,
                ArithmeticError,
            ) as problem:
                why = (
                    problem if isinstance(problem, NotRestorable) else f"{type(problem).__name__}: {problem}"
                )
                self.problems.append(f"{name}: {why}")

    def _value(self, told: Any, there: Any) -> Any:
        """The value; ``there`` is what the daemon has in its place."""
        if not isinstance(told, dict):
            if isinstance(told, list):
                raise NotRestorable("a list without its kind")
            return told
        kind = self._kinds.get(told[TAG])
        if kind is None:
            raise NotRestorable(f"{str(told[TAG])[:100]!r} is no kind of value")
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise NotRestorable(f"values in values, more than {MAX_DEPTH} deep")
        value = kind(told, there)
        self._depth -= 1
        return value

    def _tuple(self, told: Any, there: Any) -> Any:
        """Objects in a tuple, such as the state of a sensor with its parameters, may stay what they are."""
        here = (
            there if isinstance(there, tuple) and len(there) == len(told["is"]) else [None] * len(told["is"])
        )
        return tuple([self._value(each, old) for each, old in zip(told["is"], here, strict=True)])

    def _list(self, told: Any, there: Any) -> Any:
        old = there if isinstance(there, list) else []
        values = [
            self._value(each, old[index] if index < len(old) else None)
            for index, each in enumerate(told["is"])
        ]
        if not isinstance(there, list):
            return values
        there[:] = values
        return there

    def _deque(self, told: Any, there: Any) -> Any:
        values = [self._value(each, None) for each in told["is"]]
        if not isinstance(there, deque):
            return deque(values)
        there.clear()
        there.extend(values)
        return there

    def _dict(self, told: Any, there: Any) -> Any:
        old = there if isinstance(there, dict) else {}
        pairs = []
        for key, each in told["is"]:
            known = self._value(key, None)
            pairs.append((known, self._value(each, old.get(known))))
        if not isinstance(there, dict):
            return dict(pairs)
        there.clear()
        if isinstance(there, Counter):
            there.update(dict(pairs))
        else:
            there.update(pairs)
        return there

    def _future(self, told: Any, there: Any) -> Any:
        future = asyncio.get_running_loop().create_future()
        if told["done"]:
            future.set_result(self._value(told["is"], None))
        return future

    def _timer(self, told: Any, there: Any) -> Any:
        if not told["waits"]:
            return None
        if told["owner"].get(TAG) != "same":
            raise NotRestorable("a timer calls a part that stands before it")
        owner = self._value(told["owner"], None)
        delay_s = float(told["due_s"]) - self._entries.now_s()
        return self._entries.call_later(delay_s, callback_of(owner, told["calls"]), str(told["name"]))

    def _enum(self, told: Any, there: Any) -> Any:
        cls = self._restorable.class_named(told["of"])
        if not issubclass(cls, Enum):
            raise NotRestorable(f"{told['of']} has no names of values")
        return cls[told["is"]]

    def _model(self, told: Any, there: Any) -> Any:
        cls = self._restorable.class_named(told["of"])
        if not issubclass(cls, BaseModel):
            raise NotRestorable(f"{told['of']} are no parameters")
        if self._keeps_parameters and there is not None:
            return there
        return cls.model_validate_json(msgspec.json.encode(told["is"]), strict=True)

    def _frozen(self, told: Any, there: Any) -> Any:
        cls: Any = self._restorable.class_named(told["of"])
        if not is_frozen(cls):
            raise NotRestorable(f"{told['of']} is no value")
        return self._made(cls, self._fields(told, cls, there if type(there) is cls else None))

    def _object(self, told: Any, there: Any) -> Any:
        cls: Any = self._restorable.class_named(told["of"])
        if type(there) is cls:
            self._objects[told["no"]] = there
            for name, value in self._fields(told, cls, there).items():
                setattr(there, name, value)
            return there
        self._restorable.made_named(told["of"])
        made = self._objects[told["no"]] = self._made(cls, self._fields(told, cls, None))
        return made

    def _made(self, cls: Any, fields: dict[str, Any]) -> Any:
        if hasattr(cls, "__struct_fields__") or issubclass(cls, tuple):
            return cls(**fields)
        made = object.__new__(cls)
        for name, each in fields.items():
            object.__setattr__(made, name, each)
        return made

    def _fields(self, told: Any, cls: Any, there: Any) -> dict[str, Any]:
        """The attributes of an object; those of one that is there are of the types of those that it has."""
        known, hints, fields = fields_of(cls), hints_of(cls), {}
        for name, each in told["is"].items():
            where = f"{name_of(cls)}.{name[:100]}"
            if name not in known if known is not None else _is_foreign(name, cls, there):
                raise NotRestorable(f"{where} is no attribute that a recorded state may set")
            old = getattr(there, name, None)
            value = fields[name] = self._value(each, old)
            if not (fits(value, hints[name]) if name in hints else is_alike(value, old)):
                raise NotRestorable(f"{where} cannot be a {type(value).__name__}")
        return fields


def _is_foreign(name: str, cls: Any, there: Any) -> bool:
    """Whether an object, which keeps its attributes in a dict, has no such one; of one that is made nobody knows."""
    return hasattr(cls, name) if there is None else name not in vars(there)


def _array(told: Any, there: Any) -> Any:
    import numpy as np  # only a robot with a lidar has one

    dtype = np.dtype(str(told["dtype"]))
    if dtype.kind not in NUMBERS:
        raise NotRestorable(f"an array of {dtype}, which are no numbers")
    array = np.frombuffer(b64decode(told["is"]), dtype=dtype).reshape(told["shape"])
    return array.copy() if told["shape"] else array[()]


def _event(told: Any, there: Any) -> Any:
    event = there if isinstance(there, asyncio.Event) else asyncio.Event()
    if told["is"]:
        event.set()
    else:
        event.clear()
    return event
