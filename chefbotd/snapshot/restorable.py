"""The classes and functions that a recorded state may name: only those of the running daemon itself.

A recording may come from a stranger. No module is imported, no method called and no object made that is not here.
"""

import sys
import typing
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import is_dataclass
from enum import Enum
from types import ModuleType, UnionType
from typing import Any

from msgspec import Struct
from pydantic import BaseModel

from chefbotd.entries import EntryTimer
from chefbotd.snapshot.classes import OURS, WIRING, NotRestorable, fields_of, is_code, is_ours, name_of

NOT_NAMED = (*WIRING, EntryTimer)


class Restorable:
    """The classes and the timers' callbacks of ``parts``, and of all that hangs on them.

    Values may be of the classes that the modules of these parts define or import, and that are nothing but data.
    A part names in ``RESTORABLE`` the classes of further objects that it may hold later, and in ``RESTORABLE_TIMERS``
    those of its methods that a timer may call.
    """

    def __init__(self, parts: Iterable[object]) -> None:
        placed = set(_classes_in(parts))
        made = {each for cls in placed for each in getattr(cls, "RESTORABLE", ())}
        values = {each for each in _hinted(placed | made) if is_data(each)}
        values |= set(_data_of(placed | made | values))
        self._made = (*made, *(each for each in values if issubclass(each, Struct)))
        self._classes = {name_of(each): each for each in placed | made | values}
        self._known = frozenset(self._classes.values())

    def __contains__(self, cls: type[Any]) -> bool:
        return cls in self._known

    def class_named(self, name: object) -> type[Any]:
        """The class of this name.

        Raises:
            NotRestorable: the daemon has none that a state may name.
        """
        found = self._classes.get(name) if isinstance(name, str) else None
        if found is None:
            raise NotRestorable(f"{str(name)[:100]!r} is no class that a recorded state may name")
        return found

    def made_named(self, name: object) -> type[Any]:
        """The class of an object that is to be made.

        Raises:
            NotRestorable: the daemon has it already, or has no such class.
        """
        found = self.class_named(name)
        if not issubclass(found, self._made):
            raise NotRestorable(f"a recorded state may make no other {name}")
        return found


def callback_of(owner: object, method: object) -> Any:
    """What a timer may call.

    Raises:
        NotRestorable: the part has no such timer.
    """
    if method not in getattr(type(owner), "RESTORABLE_TIMERS", ()):
        raise NotRestorable(f"no timer calls {str(method)[:100]!r} of {name_of(type(owner))}")
    return getattr(owner, str(method))


def is_data(cls: Any) -> bool:
    """Whether objects of a class are only made of their fields."""
    return issubclass(cls, Struct | BaseModel | Enum) or is_dataclass(cls) or hasattr(cls, "_fields")


def _classes_in(parts: Iterable[object]) -> Iterator[type[Any]]:
    """The classes of ours that hang on these objects."""
    seen: dict[int, object] = {}
    waiting = list(parts)
    while waiting:
        value = waiting.pop()
        if id(value) in seen:
            continue
        seen[id(value)] = value
        if isinstance(value, list | tuple | set | frozenset | deque):
            waiting += value
        elif isinstance(value, Mapping):
            waiting += (*value, *value.values())
        cls = value if isinstance(value, type) else type(value)
        if not is_ours(cls) or isinstance(value, NOT_NAMED) or is_code(value):
            continue
        yield cls
        if not isinstance(value, BaseModel | Enum | type):
            waiting += held_by(value).values()


def held_by(value: object) -> dict[str, Any]:
    """The attributes of an object that belong into a state."""
    cls: Any = type(value)
    names, unrecorded = fields_of(cls), getattr(cls, "UNRECORDED", ())
    if names is not None:
        return {
            name: getattr(value, name) for name in names if name not in unrecorded and hasattr(value, name)
        }
    return {name: each for name, each in vars(value).items() if name not in unrecorded}


def _hinted(classes: Iterable[type[Any]]) -> set[type[Any]]:
    """These classes, those that their fields are said to be of, and so on."""
    found: set[type[Any]] = set()
    waiting: list[Any] = list(classes)
    while waiting:
        each = waiting.pop()
        if typing.get_args(each):
            waiting += typing.get_args(each)
        elif isinstance(each, type) and is_ours(each) and each not in found:
            found.add(each)
            waiting += hints_of(each).values()
    return found


def hints_of(cls: Any) -> Mapping[str, Any]:
    """What the fields of a class are said to be; nothing where a type checker alone knows."""
    try:
        return typing.get_type_hints(cls)
    except NameError:
        return {}


def _data_of(classes: Iterable[type[Any]]) -> Iterator[type[Any]]:
    """What the modules of these classes, and the modules that they import, have of ours that is only data."""
    modules = [sys.modules[name] for name in {each.__module__ for each in classes}]
    imported = [each for module in modules for each in vars(module).values() if isinstance(each, ModuleType)]
    for module in {*modules, *(each for each in imported if each.__name__.partition(".")[0] in OURS)}:
        for each in vars(module).values():
            if isinstance(each, type) and is_ours(each) and is_data(each) and not issubclass(each, NOT_NAMED):
                yield each


def fits(value: object, hint: Any) -> bool:
    """Whether a value is of the type that its field is said to be of; code never is."""
    kind, arguments = typing.get_origin(hint) or hint, typing.get_args(hint)
    if kind in (typing.Union, UnionType):
        return any(fits(value, each) for each in arguments)
    if kind is typing.Annotated:
        return fits(value, arguments[0])
    if kind is typing.Literal:
        return value in arguments
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if hint is None:
        return value is None
    if kind is Callable or not isinstance(kind, type):
        return kind is Any or isinstance(kind, typing.TypeVar)
    if (kind is int and isinstance(value, bool)) or not isinstance(value, kind):
        return False
    if isinstance(value, tuple) and kind is tuple and arguments:
        expected = arguments[:1] * len(value) if arguments[-1] is Ellipsis else arguments
        return len(value) == len(expected) and all(map(fits, value, expected))
    return True


def is_alike(value: object, there: object) -> bool:
    """Whether a value can take the place of what an attribute holds now."""
    if there is None or value is None:
        return not is_code(there)
    if is_code(there) or isinstance(there, NOT_NAMED):
        return False
    kinds = type(value), type(there)
    return kinds[0] is kinds[1] or all(kind in (int, float) for kind in kinds)
