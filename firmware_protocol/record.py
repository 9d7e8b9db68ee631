"""The base of the values of this package: like a frozen dataclass with slots, and made in a fortieth of its time.

``dataclass`` writes and compiles seven functions for each class: with twenty classes, a daemon's start was 15 ms longer.
"""

from collections.abc import Callable
from typing import Any, ClassVar, dataclass_transform


@dataclass_transform(frozen_default=True)
class _Declared(type):
    """Makes slots of a class's annotated names, in their order; what is assigned there is the default."""

    _fields: tuple[str, ...]
    _setters: list[Callable[[object, object], None]]

    def __new__(cls, name: str, bases: tuple[type, ...], space: dict[str, Any]) -> "_Declared":
        if bases:
            fields = tuple(space.get("__annotations__", ()))
            defaults = {field: space.pop(field) for field in fields if field in space}
            space.update(__slots__=fields, __match_args__=fields, _fields=fields, _defaults=defaults)
        made = super().__new__(cls, name, bases, space)
        made._setters = [getattr(made, field).__set__ for field in made._fields]
        return made


class Record(metaclass=_Declared):
    """A value that never changes: its fields are given by place or by name, and two with equal ones are equal."""

    __slots__ = ()
    _fields: ClassVar[tuple[str, ...]] = ()
    _defaults: ClassVar[dict[str, Any]] = {}

    def __init__(self, *values: Any, **named: Any) -> None:
        setters = type(self)._setters
        if named or len(values) != len(setters):
            values = self._placed(values, named)
        for put, value in zip(setters, values):  # noqa: B905 - as many, and in a control step
            put(self, value)
        self.__post_init__()

    def _placed(self, values: tuple[Any, ...], named: dict[str, Any]) -> tuple[Any, ...]:
        """Every field's value; raises ``TypeError`` where one is missing, or given twice, or there is none of a name."""
        given = dict(zip(self._fields, values, strict=False))
        found = {**self._defaults, **given, **named}
        if len(values) > len(given) or given.keys() & named.keys() or found.keys() != set(self._fields):
            raise TypeError(f"{type(self).__name__} takes {self._fields}, got {values} and {named}")
        return tuple([found[field] for field in self._fields])

    def __post_init__(self) -> None:
        """Check the fields; raises ``ValueError``."""

    def _values(self) -> tuple[Any, ...]:
        return tuple([getattr(self, field) for field in self._fields])

    def __eq__(self, other: object) -> bool:
        return self._values() == other._values() if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash((type(self), self._values()))

    def __repr__(self) -> str:
        told = ", ".join(f"{field}={getattr(self, field)!r}" for field in self._fields)
        return f"{type(self).__name__}({told})"

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__} never changes, nor does its {name!r}")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__} never changes, nor does its {name!r}")

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._values()
