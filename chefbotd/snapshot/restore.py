"""Puts what was taken into the parts of another daemon of the same configuration: into the objects that it has."""

import asyncio
from base64 import b64decode
from collections import Counter, deque
from collections.abc import Callable, Mapping
from itertools import count
from typing import Any

import msgspec
from pydantic import BaseModel

from chefbotd.entries import Entries
from chefbotd.snapshot.classes import TAG, NotRestorable, class_named, is_frozen

MUTABLE = (list, dict, deque, set, bytearray)


class Restore:
    """``entries`` run the timers. With ``keeps_parameters``, gains and limits stay those of the daemon."""

    def __init__(self, entries: Entries, *, keeps_parameters: bool = False) -> None:
        self._entries, self._keeps_parameters = entries, keeps_parameters
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
            "enum": lambda told, there: class_named(told["of"])[told["is"]],
            "class": lambda told, there: class_named(told["of"]),
            "count": lambda told, there: count(told["is"]),
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
            try:
                self._value(each, parts[name])
            except (NotRestorable, KeyError, TypeError, ValueError, AttributeError) as problem:
                self.problems.append(f"{name}: {problem}")

    def _value(self, told: Any, there: Any) -> Any:
        """The value; ``there`` is what the daemon has in its place."""
        if not isinstance(told, dict):
            return told
        return self._kinds[told[TAG]](told, there)

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
        owner = self._value(told["owner"], None)
        delay_s = told["due_s"] - self._entries.now_s()
        return self._entries.call_later(delay_s, getattr(owner, told["calls"]), told["name"])

    def _model(self, told: Any, there: Any) -> Any:
        if self._keeps_parameters and there is not None:
            return there
        cls = class_named(told["of"])
        if not issubclass(cls, BaseModel):
            raise NotRestorable(f"{told['of']} are no parameters")
        return cls.model_validate_json(msgspec.json.encode(told["is"]), strict=True)

    def _frozen(self, told: Any, there: Any) -> Any:
        cls: Any = class_named(told["of"])
        if not is_frozen(cls):
            raise NotRestorable(f"{told['of']} is no value")
        old = there if type(there) is cls else None
        fields = {name: self._value(each, getattr(old, name, None)) for name, each in told["is"].items()}
        if hasattr(cls, "__struct_fields__") or issubclass(cls, tuple):
            return cls(**fields)
        made = object.__new__(cls)
        for name, each in fields.items():
            object.__setattr__(made, name, each)
        return made

    def _object(self, told: Any, there: Any) -> Any:
        cls = class_named(told["of"])
        if type(there) is not cls and hasattr(cls, "__struct_fields__"):
            fields = {name: self._value(each, None) for name, each in told["is"].items()}
            made = self._objects[told["no"]] = cls(**fields)
            return made
        made = there if type(there) is cls else object.__new__(cls)
        self._objects[told["no"]] = made
        for name, each in told["is"].items():
            setattr(made, name, self._value(each, getattr(made, name, None)))
        return made


def _array(told: Any, there: Any) -> Any:
    import numpy as np  # only a robot with a lidar has one

    array = np.frombuffer(b64decode(told["is"]), dtype=np.dtype(told["dtype"])).reshape(told["shape"])
    return array.copy() if told["shape"] else array[()]


def _event(told: Any, there: Any) -> Any:
    event = there if isinstance(there, asyncio.Event) else asyncio.Event()
    if told["is"]:
        event.set()
    else:
        event.clear()
    return event
