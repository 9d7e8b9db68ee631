"""Every attribute of an object and of all that hangs on it, by its path: what a state may have forgotten shows here."""

import ast
import asyncio
import functools
import inspect
import textwrap
import threading
from collections.abc import Iterator, Mapping, Sequence, Set
from enum import Enum
from types import ModuleType
from typing import Any

import msgspec
import numpy as np
from pydantic import BaseModel

from chefbotd.bus import Bus, HandlerFailure, Inbox
from chefbotd.components.maps.parts import Cache
from chefbotd.components.maps.robot_pose import RobotPose
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.recording.replay.build import RecordedLatch
from chefbotd.components.recording.replay.stand_ins import UnheardProgress
from chefbotd.components.worker.channel import Channel
from chefbotd.components.worker.replayed import ReplayedWorker
from chefbotd.core.record import StatefulPart
from chefbotd.inputs import InputLog, InputTimer
from chefbotd.link.board_writer import LineRing
from chefbotd.logs import RateLimitedLog
from chefbotd.metrics import Histogram, Metrics
from chefbotd.process.latch_file import LatchFile
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.repeats import RepeatableRequest
from chefbotd.rpc.session import Session, TokenBucket
from firmware_protocol.decoder import ReadShape

OURS = ("chefbotd", "firmware_protocol", "tests")

WIRING = (
    Bus,
    Inbox,
    InputLog,
    HandlerFailure,
    RateLimitedLog,
    Histogram,
    Metrics,
    BaseModel,
    ModuleType,
    ProgressReporter,
    UnheardProgress,
    Channel,
    ReplayedWorker,
)
"""How parts are connected, what they count of themselves, and what never changes."""

OUTSIDE: Mapping[type[Any], str] = {
    Cache: "answers from the disk, which are recorded",
    LatchFile: "of the disk",
    LineRing: "for the log",
    MapStore: "of the disk",
    ReadShape: "learnt from what comes, and faster than the table that it stands for",
    RecordedLatch: "of the disk, in a replay",
    RepeatableRequest: "a client's line, of which a recording has what it says",
    RobotPose: "where a place is saved, which is an answer from the disk",
    Session: "a connection; of who it is the leases have a record",
    TokenBucket: "admits requests, and those in a recording were admitted",
}
"""Objects from which nothing follows that a replay computes, and why."""


def attributes(parts: Mapping[str, object]) -> dict[str, Any]:
    """The plain values that hang on the parts, by their paths; a timer is when it is due, None without one."""
    return dict(_values(parts, "", set()))


def _shown(value: object) -> str:
    """A sentence as its words, which is what a state has of it."""
    return str(value) if isinstance(value, str) else repr(value)


def _values(value: Any, path: str, seen: set[int]) -> Iterator[tuple[str, Any]]:
    if isinstance(value, InputTimer):
        yield path, round(value.due_s, 6) if value.waits else None
    elif isinstance(value, asyncio.Event):
        yield path, value.is_set()
    elif asyncio.isfuture(value):
        yield from _values(value.result() if value.done() else "pending", path, seen)
    elif isinstance(value, np.ndarray):
        yield path, value.tolist()
    elif isinstance(value, Enum | str | bytes | bytearray):
        yield path, value
    elif _is_frozen(value):
        yield path, msgspec.to_builtins(value, enc_hook=_shown)
    elif isinstance(value, Mapping):
        yield path, [_key(key) for key in value]
        for key, each in value.items():
            yield from _values(each, f"{path}[{_key(key)}]", seen)
    elif isinstance(value, Set):
        yield path, sorted(map(repr, value))
    elif isinstance(value, Sequence) or type(value).__name__ == "deque":
        yield path, len(value)
        for index, each in enumerate(value):
            yield from _values(each, f"{path}[{index}]", seen)
    elif _is_code(value) or isinstance(
        value, (*WIRING, *OUTSIDE, asyncio.BaseTransport, type(threading.Lock()))
    ):
        return
    elif type(value).__module__.partition(".")[0] in OURS:
        yield from _of_object(value, path, seen)
    elif isinstance(value, int | float | None):
        yield path, round(value, 6) if path.endswith("due_s") and value is not None else value
    else:
        yield path, type(value).__name__


def _of_object(value: Any, path: str, seen: set[int]) -> Iterator[tuple[str, Any]]:
    """An object that has been met already is not walked again."""
    if id(value) in seen:
        return
    seen.add(id(value))
    yield path, type(value).__name__
    names = [name for each in type(value).__mro__ for name in _slots(each)]
    for name in dict.fromkeys((*names, *getattr(value, "__dict__", ()))):
        if hasattr(value, name):
            yield from _values(getattr(value, name), f"{path}/{type(value).__name__}.{name}", seen)


def _is_frozen(value: object) -> bool:
    """Whether a value never changes, whoever has it."""
    config, parameters = (
        getattr(value, "__struct_config__", None),
        getattr(value, "__dataclass_params__", None),
    )
    return (config is not None and config.frozen) or (parameters is not None and parameters.frozen)


def _slots(cls: type[Any]) -> Sequence[str]:
    slots = vars(cls).get("__slots__", ())
    return (slots,) if isinstance(slots, str) else tuple(slots)


def _key(key: object) -> str:
    return key.__name__ if isinstance(key, type) else str(key)


def _is_code(value: object) -> bool:
    return (
        inspect.isroutine(value)
        or inspect.isclass(value)
        or isinstance(value, functools.partial)
        or (hasattr(value, "cache_info"))
    )


def changed_attributes(parts: Mapping[str, object]) -> Iterator[tuple[Any, str]]:
    """The objects that hang on the parts, and the attributes that one of their methods changes.

    What a part names among its ``parts`` is another owner, which is changed and restored in place.
    """
    for owner in _objects(list(parts.values())):
        own_parts = owner.parts.values() if isinstance(owner, StatefulPart) else ()
        for name in changed_by_methods(type(owner)):
            if hasattr(owner, name) and not any(getattr(owner, name) is part for part in own_parts):
                yield owner, name


def _objects(waiting: list[Any]) -> Iterator[Any]:
    seen: dict[int, Any] = {}
    while waiting:
        value = waiting.pop()
        if (
            id(value) in seen
            or isinstance(value, (type, str, bytes, *WIRING, *OUTSIDE))
            or _is_frozen(value)
            or _is_code(value)
        ):
            continue
        seen[id(value)] = value
        if isinstance(value, Mapping):
            waiting += value.values()
        elif isinstance(value, Sequence | Set):
            waiting += value
        elif type(value).__module__.partition(".")[0] in OURS:
            yield value
            names = {name for each in type(value).__mro__ for name in _slots(each)} | set(
                getattr(value, "__dict__", ())
            )
            waiting += [getattr(value, name) for name in names if hasattr(value, name)]


@functools.cache
def changed_by_methods(cls: type[Any]) -> frozenset[str]:
    """The attributes that a method of a class assigns, or changes the content of, but for those that make it."""
    names: set[str] = set()
    for each in cls.__mro__:
        if each.__module__.partition(".")[0] not in OURS:
            continue
        tree = ast.parse(textwrap.dedent(inspect.getsource(each)))
        for method in tree.body[0].body:  # type: ignore[attr-defined]
            if isinstance(method, ast.FunctionDef | ast.AsyncFunctionDef) and method.name not in MAKE:
                names |= set(_changed(method))
    return frozenset(names)


def _changed(method: ast.AST) -> Iterator[str]:
    for node in ast.walk(method):
        if isinstance(node, ast.Attribute | ast.Subscript) and isinstance(node.ctx, ast.Store | ast.Del):
            yield from _own(node.value if isinstance(node, ast.Subscript) else node)
        elif (
            isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in CHANGING
        ):
            yield from _own(node.func.value)


def _own(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self":
        yield node.attr


MAKE = {
    "__init__",
    "restore",
    "add_listener",
    "add_on_ready",
    "add_own",
    "call_on_fault",
    "call_on_latched",
    "call_on_limits",
}
"""Methods that make an object or wire it, and the one under test."""

CHANGING = {
    "append",
    "appendleft",
    "extend",
    "add",
    "update",
    "pop",
    "popleft",
    "popitem",
    "clear",
    "remove",
    "discard",
}
"""Methods of containers."""
