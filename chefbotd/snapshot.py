"""The state of the daemon's parts by name: recorded in one daemon, restored in another of the same configuration.

The annotation of a part's ``state`` says of which class its state is. A recorded state may come from a stranger, so that
class alone decides what is read from it: no name in it is looked up, nothing in it is called, and a value of another
type is refused.
"""

import typing
from base64 import b64decode, b64encode
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cache
from typing import Any

import msgspec
from pydantic import BaseModel

from chefbotd.core.events.inputs import StateRecorded
from chefbotd.core.record import Stateful, StatefulPart, StatefulValue
from chefbotd.core.sentence import Sentence
from chefbotd.inputs import InputLog

LONGEST_PROBLEM = 200


class DaemonState:
    """``parts`` remember something; ``waiting`` are the tasks of requests that can go on from it.

    Requests of the methods ``harmless`` change none of the parts, so that it does not matter how far one of them is.
    """

    def __init__(
        self,
        entries: InputLog,
        parts: Mapping[str, Stateful],
        waiting: Callable[[], Collection[str]],
        harmless: Collection[str],
    ) -> None:
        self._entries, self.parts = entries, parts
        self._waiting, self._harmless = waiting, harmless

    @property
    def is_settled(self) -> bool:
        """Whether nothing is under way that a state cannot have in it."""
        return next(self._under_way(), None) is None

    def record(self) -> StateRecorded:
        """The state now, between two entries. A part that fails to offer its own is left out, and disturbs nobody."""
        parts, left_out = dict[str, str](), list(self._under_way())
        for name, part in self.parts.items():
            try:
                parts[name] = encode_state(part.state())
            except STATE_ERRORS as problem:
                left_out.append(f"{name}: {_describe(problem)}")
        is_open = tuple(name for name, session in self._entries.links.items() if session.is_open)
        return StateRecorded(self._entries.now_s(), parts, is_open, tuple(left_out))

    def restore(self, recorded: Mapping[str, object], excluded: Collection[str] = ()) -> list[str]:
        """Put every part into its recorded state, but for the ``excluded`` ones; returns what cannot be, and why."""
        problems = []
        for name, text in recorded.items():
            if name not in self.parts:
                problems.append(f"this daemon has no part {name[:100]!r}")
            elif name not in excluded:
                try:
                    self.parts[name].restore(decode_state(state_class(type(self.parts[name])), text))
                except STATE_ERRORS as problem:
                    problems.append(f"{name}: {_describe(problem)}")
        return problems

    def _under_way(self) -> Iterator[str]:
        waiting = self._waiting()
        for name, steps in self._entries.running.items():
            may_begin_again = name in waiting and not steps.is_woken
            if may_begin_again or steps.is_at_rest or steps.what in self._harmless:
                continue
            if steps.what:
                yield f"{name} ({steps.what}) is under way"
            else:
                yield f"the service {name} is in the middle of something"


STATE_ERRORS = (
    msgspec.MsgspecError,
    LookupError,
    TypeError,
    ValueError,
    AttributeError,
    ArithmeticError,
    RecursionError,
)
"""Exceptions raised when a wrong state is encoded, decoded or restored."""


def _describe(problem: Exception) -> str:
    return " ".join(f"{type(problem).__name__}: {problem}".split())[:LONGEST_PROBLEM]


@cache
def state_class(part: type[Any]) -> Any:
    """The type of the states of a class of parts."""
    declared = typing.get_type_hints(part.state)["return"]
    if isinstance(declared, typing.TypeVar):
        bases = typing.cast("Any", part).__orig_bases__
        declared = next(
            typing.get_args(base)[0]
            for base in bases
            if typing.get_origin(base) in (StatefulPart, StatefulValue)
        )
    return part if declared is typing.Self else declared


def encode_state(state: object) -> str:
    """A state as MessagePack, which knows infinities and bytes, in base64."""
    return b64encode(_ENCODER.encode(state)).decode()


def decode_state(cls: Any, text: object) -> Any:
    """The state of this type that ``encode_state`` has written, exactly.

    Raises:
        ValueError: it has more in it than such a state; for what else is none, anything of ``STATE_ERRORS``.
    """
    if not isinstance(text, str):
        raise ValueError("the state is in the form of an earlier version of chefbotd")
    data = b64decode(text, validate=True)
    state = msgspec.msgpack.decode(data, type=cls, dec_hook=_from_plain)
    again = _ENCODER.encode(state)
    if again != data and msgspec.msgpack.decode(again) != msgspec.msgpack.decode(data):
        raise ValueError("there is more in it than this version of chefbotd records")
    return state


def _to_plain(value: Any) -> Any:
    """Parameters as JSON, an array of numpy's as its shape and its numbers, and a sentence as its English words."""
    if isinstance(value, BaseModel):
        return value.model_dump_json()
    if type(value).__module__ == "numpy":
        return value.shape, value.astype("<f8").tobytes()
    if isinstance(value, Sentence):
        return str(value)
    raise TypeError(f"a {type(value).__name__} belongs into no state")


def _from_plain(cls: Any, plain: Any) -> Any:
    kind = typing.get_origin(cls) or cls
    if issubclass(kind, BaseModel):
        return kind.model_validate_json(msgspec.convert(plain, str), strict=True)
    if kind is Counter:
        return Counter(msgspec.convert(plain, dict[str, int]))
    if kind.__module__ == "numpy":
        import numpy as np  # only a robot with a lidar has one

        shape, data = msgspec.convert(plain, tuple[tuple[int, ...], bytes], builtin_types=(bytes,))
        return np.frombuffer(data, "<f8").reshape(shape).copy()
    raise TypeError(f"a {kind.__name__} belongs into no state")


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_to_plain)
