"""What kind of class a value is of, and how a class is written."""

from functools import cache, partial
from inspect import isbuiltin, isfunction, ismethod
from itertools import count
from threading import Lock
from typing import Any

from chefbotd.bus import Bus, HandlerFailure, Inbox
from chefbotd.entries import Entries
from chefbotd.logs import RateLimitedLog
from chefbotd.metrics import Histogram, Metrics

OURS = ("chefbotd", "firmware_protocol")
TAG = "$"
"""The key that says what kind of value an object of the JSON is; everything else is what it looks like."""

WIRING = (Bus, Inbox, Entries, HandlerFailure, RateLimitedLog, Histogram, Metrics, type(Lock()))
"""How parts are connected, and what they count of themselves: every daemon makes its own."""


class NotRestorable(Exception):
    """A value that this daemon cannot take; the text says which, and why."""


def name_of(cls: type[Any]) -> str:
    """A class as it is written."""
    return f"{cls.__module__}:{cls.__qualname__}"


def is_ours(cls: type[Any]) -> bool:
    """Whether a class is part of the program."""
    return cls.__module__.partition(".")[0] in OURS


def is_code(value: object) -> bool:
    """A function, or something that calls one; a class is none."""
    if isfunction(value) or ismethod(value) or isbuiltin(value) or isinstance(value, partial):
        return True
    return callable(value) and not isinstance(value, type) and not is_ours(type(value))


@cache
def fields_of(cls: Any) -> tuple[str, ...] | None:
    """The attributes that the class declares, where it does; None: they are in the object's ``__dict__``."""
    declared = getattr(cls, "__struct_fields__", None) or getattr(cls, "__dataclass_fields__", None)
    if declared is not None:
        return tuple(declared)
    if issubclass(cls, tuple):
        return tuple(cls._fields)  # a NamedTuple
    if cls.__dictoffset__:
        return None
    return tuple(name for each in cls.__mro__ for name in _slots(each))


def _slots(cls: type[Any]) -> tuple[str, ...]:
    slots = vars(cls).get("__slots__", ())
    return (slots,) if isinstance(slots, str) else tuple(slots)


@cache
def is_frozen(cls: Any) -> bool:
    """Whether objects of a class never change, and so are values."""
    config = getattr(cls, "__struct_config__", None)
    if config is not None:
        return bool(config.frozen)
    if issubclass(cls, tuple):
        return True
    parameters = getattr(cls, "__dataclass_params__", None)
    return parameters is not None and bool(parameters.frozen)


def next_of(counter: "count[int]") -> int:
    """What a counter gives next, which stays so."""
    return int(repr(counter)[len("count(") : -1])
