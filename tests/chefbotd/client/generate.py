"""Writes what follows from the registered methods and topics: ``make client``.

That is the client's methods that only ask, its models, the types of ``subscribe``, and the tables of docs/api.md.
"""

import inspect
import re
import sys
import textwrap
from collections.abc import Collection, Iterable, Mapping
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import SecretStr

import chefbotd.client
from chefbotd.client.client import Client
from chefbotd.client.generated import GeneratedMethods
from chefbotd.component import resolve
from chefbotd.component_list import own_components
from chefbotd.core.record import Record
from chefbotd.rpc.encoding import UnknownData
from chefbotd.rpc.method import Method
from chefbotd.rpc.models import Done
from chefbotd.rpc.topics import Topic
from tests.chefbotd.client.api_page import PAGE, page
from tests.fakes.robot import methods_of_socket, topics_of

SENT = (Record, UnknownData)
PACKAGE = Path(chefbotd.client.__file__).parent
WIDTH = 120
IN_EACH_STATE = {"link", "safety"}
WITHOUT_METHOD = {"subscribe", "unsubscribe", "cancel"}
"""Of these a client makes use by itself."""

MARK = """# Written by `make client`: see tests/chefbotd/client/generate.py. Whatever is changed here by hand is lost.
# fmt: off
"""

COMPONENTS = "chefbotd.components"

METHODS_HEAD = '''# mypy: disable-error-code="no-any-return"
"""The client's methods that only ask, and the types of ``subscribe``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Literal, Unpack, overload

from chefbotd.client.caller import MethodCaller
from chefbotd.client.subscription import SubscribeOptions as Options, Subscription

if TYPE_CHECKING:
    from chefbotd.client import models as m
    from chefbotd.client.wire import ProgressListener

{imports}

class ComponentMethods({bases}):
    """The methods that components have written by hand."""


class GeneratedMethods(MethodCaller):
    """The methods of the socket for which asking is all there is to do."""
'''

TOPICS_HEAD = '''

class Topics(ABC):
    """``subscribe``, typed by the name of the topic."""

'''

SUBSCRIBE = '''
    @overload
    def subscribe(self, topics: str | Iterable[str], **options: Unpack[Options]) -> Subscription[Any]: ...

    def subscribe(self, topics: str | Iterable[str], **options: Unpack[Options]) -> Subscription[Any]:
        """Events of one or several topics, first the latest value of each; see ``Subscription``.

        Subscriptions of one client to the same topic share it, and have the same rate and policy.

        Raises:
            SubscriptionConflict: on starting, when the topic is subscribed with another rate or policy.
        """
        return self._subscription(topics, **options)

    @abstractmethod
    def _subscription(self, topics: str | Iterable[str], **options: Unpack[Options]) -> Subscription[Any]: ...
'''

SYNC_HEAD = '''
from chefbotd.client.blocking import InBackground, blocking, blocking_subscription
from chefbotd.client.client import Client


class SyncMethods(InBackground):
    """Every method of ``Client``."""

    subscribe = blocking_subscription(Client.subscribe)
'''


def _filled(line: str, indent: int) -> str:
    """A long line of code, broken after commas."""
    held = re.sub(r"(?<=[^, ]) (?=\S)", "\0", line)
    filled = textwrap.fill(
        held, WIDTH, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )
    return filled.replace("\0", " ")


def _annotation(kind: Any, where: str) -> str:
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _annotation(parts[0], where)
    if origin in (Union, UnionType):
        return " | ".join(_annotation(part, where) for part in parts)
    if origin is Literal:
        return f"Literal[{', '.join(map(repr, parts))}]"
    if isinstance(kind, type) and issubclass(kind, Enum):
        return f"Literal[{', '.join(repr(member.value) for member in kind)}]"
    if origin in (list, dict):
        return f"{origin.__name__}[{', '.join(_annotation(part, where) for part in parts)}]"
    if kind is Any:
        return "Any"
    if kind in (bool, int, float, str, SecretStr, NoneType):
        return {SecretStr: "str", NoneType: "None"}.get(kind, kind.__name__)
    raise TypeError(
        f"{where} is {kind}: its method of the client is to be written by hand, in client/methods.py"
    )


PRECONDITION = "if_stop_number"
"""The parameter of every motion that is always given by its name."""


def _method(method: Method, exported: Mapping[str, type[Any]]) -> str:
    fields = sorted(
        method.params.model_fields.items(),
        key=lambda item: (item[0] == PRECONDITION, not item[1].is_required()),
    )
    takes, gives = ["self"], []
    for name, field in fields:
        kind = _annotation(field.annotation, f"{method.name}: {name}")
        takes += ["*"] if (kind == "bool" or name == PRECONDITION) and "*" not in takes else []
        default = field.default.value if isinstance(field.default, Enum) else field.default
        if isinstance(default, list | dict):  # what is None is not sent, and the daemon has the default
            kind, default = f"{kind} | None", None
        takes.append(f"{name}: {kind}" + ("" if field.is_required() else f" = {default!r}"))
        gives.append(f"{name}={name}")
    if inspect.iscoroutinefunction(method.handle):
        takes.append("on_progress: ProgressListener | None = None")
        gives.append("on_progress=on_progress")
    model = None if method.result is Done else _exported(method.result, exported)
    head = f"    async def {method.name}({', '.join(takes)}) -> {'None' if model is None else f'm.{model}'}:"
    asked = ", ".join(["None" if model is None else f'"{model}"', f'"{method.name}"', *gives])
    call = f"        {'' if model is None else 'return '}await self._ask({asked})"
    doc = textwrap.indent(inspect.getdoc(method.handle) or "", " " * 8).strip()
    quoted = f'        """{doc}' + ('\n        """' if "\n" in doc else '"""')
    return "\n".join((_filled(head, 8), quoted, _filled(call, 12)))


def _models(kinds: Iterable[type[Any]]) -> dict[str, type[Any]]:
    """These models, those within them and those that they are made from, as far as a module has them.

    Raises:
        ValueError: two of them have the same name.
    """
    found: dict[str, type[Any]] = {}
    waiting = list(kinds)
    while waiting:
        kind = waiting.pop()
        for each in kind.__mro__:
            known = getattr(sys.modules[each.__module__], each.__name__, None) is each
            if known and issubclass(each, SENT) and each not in (Record, found.get(each.__name__)):
                if other := found.get(each.__name__):
                    raise ValueError(
                        f"{other.__module__} and {each.__module__} both have a model {each.__name__}"
                    )
                found[each.__name__] = each
                waiting += [part for kind in get_type_hints(each).values() for part in _parts(kind)]
    return found


def _parts(kind: Any) -> list[type[Any]]:
    if isinstance(kind, type) and issubclass(kind, SENT):
        return [kind]
    return [model for part in get_args(kind) for model in _parts(part)]


def _exported(model: type[Any], exported: Mapping[str, type[Any]]) -> str:
    return next(each.__name__ for each in model.__mro__ if exported.get(each.__name__) is each)


def _methods_module(
    asking: list[Method], exported: Mapping[str, type[Any]], data: Mapping[str, str], by_component: list[str]
) -> str:
    classes = [reference.partition(":")[::2] for reference in by_component]
    head = METHODS_HEAD.replace(
        "{imports}", "".join(f"from {module} import {name}\n" for module, name in sorted(classes))
    ).replace("{bases}", ", ".join(name for _, name in classes) or "MethodCaller")
    methods = "".join(f"\n{_method(each, exported)}\n" for each in asking)
    overloads = "\n".join(
        "    @overload\n"
        + _filled(
            f'    def subscribe(self, topics: Literal["{topic}"], **options: Unpack[Options]) '
            f"-> Subscription[m.{model}]: ...",
            8,
        )
        for topic, model in data.items()
    )
    return MARK + head + methods + TOPICS_HEAD + overloads + SUBSCRIBE


def _sync_module(asking: list[Method], by_hand: Mapping[str, object]) -> str:
    names = [name for name, each in by_hand.items() if inspect.iscoroutinefunction(each) and name[0] != "_"]
    rows = "".join(f"    {name} = blocking(Client.{name})\n" for name in [*names, *(m.name for m in asking)])
    return MARK + '"""The methods of the asyncio client as plain ones."""\n' + SYNC_HEAD + rows


def _models_module(exported: Mapping[str, type[Any]], data: Mapping[str, str]) -> str:
    by_module: dict[str, list[str]] = {}
    for name, model in exported.items():
        by_module.setdefault(model.__module__, []).append(name)
    imports = "\n".join(
        _import(module, ", ".join(f"{name} as {name}" for name in sorted(names)))
        for module, names in sorted(by_module.items())
    )
    table = _filled("    " + ", ".join(f'"{topic}": {model}' for topic, model in data.items()), 4)
    latest = "\n".join(
        f'    {topic} = Latest("{topic}", {model})'
        for topic, model in data.items()
        if topic not in IN_EACH_STATE
    )
    return f'''{MARK}"""Every model that a client reads: the results of the methods, and the data of the topics."""

from collections.abc import Mapping

{imports}
from chefbotd.client.event import Latest
from chefbotd.rpc.encoding import Sent

DATA_BY_TOPIC: Mapping[str, type[Sent]] = {{
{table}
}}
"""What a client reads each topic as."""


class TopicsOfState:
    """The latest data of each topic that a state may have."""

    __slots__ = ()

{latest}
'''


def _import(module: str, names: str) -> str:
    line = f"from {module} import {names}"
    return line if len(line) <= WIDTH else f"from {module} import (\n{_filled('    ' + names, 4)}\n)"


def without_component(
    name: str, methods: Mapping[str, Method], topics: Mapping[str, Topic]
) -> tuple[dict[str, Method], dict[str, Topic]]:
    """The methods and topics that are left without a component: none whose models are in its folder."""
    folder = f"{COMPONENTS}.{name}."

    def belongs(kinds: Iterable[type[Any]]) -> bool:
        return any(f"{kind.__module__}.".startswith(folder) for kind in kinds)

    return (
        {key: each for key, each in methods.items() if not belongs(_kinds_of(each))},
        {key: each for key, each in topics.items() if not belongs([each.model])},
    )


def _kinds_of(method: Method) -> list[type[Any]]:
    """The models of a method, and the class that has its handler."""
    owner = sys.modules[method.handle.__module__]
    return [method.params, method.result, type("Owner", (), {"__module__": owner.__name__})]


def written(
    methods: Mapping[str, Method], topics: Mapping[str, Topic], removed: Collection[str] = ()
) -> dict[Path, str]:
    """What each file should say; without the components ``removed``."""
    by_component = [
        reference
        for component in own_components()
        if component.name not in removed
        for reference in component.client_methods
    ]
    folders = tuple(f"{COMPONENTS}.{name}." for name in removed)
    kinds = [*(each.result for each in methods.values()), *(topic.model for topic in topics.values())]
    exported = _models([*kinds, UnknownData])
    data = {name: _exported(topic.model, exported) for name, topic in topics.items()}
    by_hand = {
        name: each
        for kind in dict.fromkeys((*Client.__mro__, *map(resolve, by_component)))
        if kind is not GeneratedMethods and not kind.__module__.startswith(folders)
        for name, each in vars(kind).items()
    }
    asking = [each for name, each in methods.items() if name not in {*by_hand, *WITHOUT_METHOD}]
    files = {
        PACKAGE / "models.py": _models_module(exported, data),
        PACKAGE / "generated.py": _methods_module(asking, exported, data, by_component),
        PACKAGE / "generated_sync.py": _sync_module(asking, by_hand),
    }
    return files | ({PAGE: page(PAGE.read_text(encoding="utf-8"), methods, topics)} if PAGE.exists() else {})


if __name__ == "__main__":
    for path, text in written(methods_of_socket(), topics_of(simulated=True)).items():
        path.write_text(text, encoding="utf-8")
