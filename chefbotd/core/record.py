"""The base class of values that are made at the rate of the encoders: events, and states between two steps."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Any, Generic, Protocol, Self, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from chefbotd.core.sentence import Sentence

__all__ = [
    "Level",
    "LogLine",
    "MutableState",
    "Record",
    "Stateful",
    "StatefulPart",
    "StatefulValue",
    "replace",
]


class Record(Struct, frozen=True, gc=False):
    """A value that never changes, with named fields; ``replace`` makes another with some of them changed.

    It takes a tenth of a dataclass's time to make, and the garbage collector never looks into it: so a record must not
    hold anything that leads back to it.
    """


class Level(StrEnum):
    """How bad it is what a line of the log says."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class LogLine(Record, frozen=True):
    """A sentence for people about an event; ``source`` is the part of the robot that it is about."""

    level: Level
    source: str
    text: str


def state_line(source: str, state: str, reason: str) -> LogLine:
    """A part's new state, and why where there is a reason."""
    return LogLine(Level.INFO, source, because(state, reason) if reason else state)


def because(state: str, reason: str) -> str:
    """A state and the reason for it, where that is a sentence with an id as another one."""
    if isinstance(reason, Sentence):
        return Sentence("log.state", "{state}: {reason}", state=state, reason=reason)
    return f"{state}: {reason}"


class MutableState(Struct, eq=False):
    """The base class of a part that is nothing but its state: it offers itself, and takes over another's fields."""

    def state(self) -> Self:
        """Return the state of this part."""
        return self

    def restore(self, state: Self) -> None:
        """Restore this state."""
        for name in self.__struct_fields__:
            setattr(self, name, getattr(state, name))


M = TypeVar("M", bound=MutableState)
V = TypeVar("V")


class Stateful(Protocol):
    """A part that remembers something from one entry to the next."""

    def state(self) -> Any:
        """What it remembers, as a record, a number, a tuple and so on; of the class that the annotation says."""
        ...

    def restore(self, state: Any) -> None:
        """Go on from there: what it remembered before is forgotten, and its timers run until they are due."""
        ...


class StatefulPart(Generic[M]):
    """The base class of a part with more than its state: all that it remembers is one record, changed in place.

    ``parts`` are its own parts, timers and events by the fields of the memory that hold their states.
    """

    memory: M
    parts: Mapping[str, Stateful] = {}

    def state(self) -> M:
        """Return the state of this part."""
        for name, part in self.parts.items():
            setattr(self.memory, name, part.state())
        return self.memory

    def restore(self, state: M) -> None:
        """Restore this state."""
        self.memory.restore(state)
        for name, part in self.parts.items():
            part.restore(getattr(state, name))
            setattr(self.memory, name, part.state())


class StatefulValue(Generic[V]):
    """The base class of a part that remembers one value: a number, a tuple, or a record, exchanged as a whole."""

    memory: V

    def state(self) -> V:
        """Return the state of this part."""
        return self.memory

    def restore(self, state: V) -> None:
        """Restore this state."""
        self.memory = state
