"""Records as the JSON that is sent, and as the JSON Schema that describes it."""

from collections.abc import Mapping
from inspect import cleandoc
from typing import Any, TypeAlias

import msgspec
from pydantic import BaseModel

from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence, mark_sentence, with_ids


class UnknownData:
    """The data of a topic that this version does not know: its members, unchanged, as attributes."""

    __slots__ = ("members",)

    def __init__(self, /, **members: Any) -> None:
        self.members = members

    def __getattr__(self, name: str) -> Any:
        if name in UnknownData.__slots__ or name not in self.members:
            raise AttributeError(f"{type(self).__name__} has no member {name!r}")
        return self.members[name]

    @classmethod
    def schema(cls) -> dict[str, Any]:
        """Its JSON Schema: it may have any members."""
        return {"type": "object"}

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self.members.items())})"
        )


Sent: TypeAlias = Record | UnknownData
"""What goes to clients."""


def _plain(value: object) -> object:
    """What a record may hold and msgspec does not know: parameters of the configuration, and any mapping."""
    if isinstance(value, UnknownData):
        return value.members
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, Sentence):
        raise _SentenceMet
    raise NotImplementedError(f"{type(value).__name__} cannot be sent")


class _SentenceMet(Exception):
    """There is a sentence in what is encoded."""


def _marked(value: object) -> object:
    return mark_sentence(value) if isinstance(value, Sentence) else _plain(value)


_ENCODER = msgspec.json.Encoder(enc_hook=_plain)
_MARKING = msgspec.json.Encoder(enc_hook=_marked)


def encode(record: object) -> bytes:
    """A record as JSON; a number that is not finite is null.

    An object of which a text is a sentence has its id and its arguments in its member ``said``, by the text's name.
    Records without one are encoded at once, and cost no more for it.
    """
    try:
        return _ENCODER.encode(record)
    except _SentenceMet:
        return _ENCODER.encode(with_ids(msgspec.json.decode(_MARKING.encode(record))))


def plain(record: object) -> Any:
    """A record as what JSON has: dicts, lists, text and numbers."""
    return msgspec.json.decode(encode(record))


def schema(model: type[Any]) -> dict[str, Any]:
    """The JSON Schema of what is sent as this class."""
    if issubclass(model, UnknownData):
        return model.schema()
    (whole,), parts = msgspec.json.schema_components([model], schema_hook=_schema_of_parameters)
    parts = {name: _complete(part) for name, part in parts.items()}
    return {**parts.pop(whole["$ref"].rpartition("/")[2]), **({"$defs": parts} if parts else {})}


def _complete(part: Any) -> Any:
    """Text without the indentation of its docstring, and each fixed value with its type."""
    if isinstance(part, list):
        return [_complete(item) for item in part]
    if not isinstance(part, dict):
        return part
    whole = {name: _complete(item) for name, item in part.items()}
    if isinstance(whole.get("description"), str):
        whole["description"] = cleandoc(whole["description"])
    if values := whole.get("enum"):
        whole["type"] = "string"
        if len(values) == 1:
            whole["const"] = whole.pop("enum")[0]
    return whole


def _schema_of_parameters(kind: type[Any]) -> dict[str, Any]:
    if issubclass(kind, BaseModel):
        return kind.model_json_schema(mode="serialization", by_alias=False)
    raise NotImplementedError(f"{kind.__name__} has no schema")


class EventPayload(Record, frozen=True):
    """A topic's value; ``data`` is its JSON, ``age_s`` how old it is when it is handed out."""

    topic: str
    seq: int
    stamp_s: float
    age_s: float
    data: bytes
