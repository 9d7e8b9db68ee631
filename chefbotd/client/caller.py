"""The base of every group of the client's methods, and how answers become the documented records."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from chefbotd.client.errors import ProtocolError

if TYPE_CHECKING:
    from msgspec import inspect

    from chefbotd.client.wire import ProgressListener
    from chefbotd.rpc.encoding import Sent

M = TypeVar("M", bound="Sent")


def parse(model: type[M], value: object) -> M:
    """The value as a record. Members that a newer daemon has added are passed over; null for a number is nan.

    JSON has no number that is not finite: the daemon sends null in its place.

    Raises:
        ProtocolError: something is missing, or of another type.
    """
    import msgspec

    from chefbotd.rpc.encoding import UnknownData

    if issubclass(model, UnknownData) and isinstance(value, Mapping):
        return model(**value)
    try:
        return msgspec.convert(value, model, dec_hook=_parameters)
    except msgspec.ValidationError:
        mended = _with_nan(value, msgspec.inspect.type_info(model))
    try:
        return msgspec.convert(mended, model, dec_hook=_parameters)
    except msgspec.ValidationError as problem:
        reason = f"{model.__name__}: {problem}, in {value!r:.200}"
        raise ProtocolError(f"the daemon sent what this client does not understand: {reason}") from problem


def _parameters(kind: Any, value: object) -> Any:
    """What msgspec does not know: parameters of the configuration. Theirs is a ``ValueError`` too."""
    return kind.model_validate(value)


def _with_nan(value: Any, kind: inspect.Type) -> Any:
    """A copy with nan where a number is expected and null came."""
    from msgspec import inspect

    match kind:
        case inspect.Metadata():
            return _with_nan(value, kind.type)
        case inspect.FloatType() if value is None:
            return math.nan
        case inspect.StructType() if isinstance(value, Mapping):
            kinds = {field.encode_name: field.type for field in kind.fields}
            return {name: _with_nan(item, kinds.get(name, inspect.AnyType())) for name, item in value.items()}
        case inspect.DictType() if isinstance(value, Mapping):
            return {name: _with_nan(item, kind.value_type) for name, item in value.items()}
        case inspect.ListType() | inspect.VarTupleType() if isinstance(value, list):
            return [_with_nan(item, kind.item_type) for item in value]
        case inspect.TupleType() if isinstance(value, list) and len(value) == len(kind.item_types):
            return [
                _with_nan(item, item_kind) for item, item_kind in zip(value, kind.item_types, strict=True)
            ]
        case inspect.UnionType() if value is not None:
            (other,) = [member for member in kind.types if not isinstance(member, inspect.NoneType)][:1]
            return _with_nan(value, other)
    return value


class MethodCaller(ABC):
    """Calls methods of the socket. Every error is a ``ChefbotError``.

    The usual ones are ``CallError`` (refused; ``kind`` says why), ``CallTimeout`` and ``ConnectionLost``.
    """

    @abstractmethod
    async def call(
        self, method: str, /, *, on_progress: ProgressListener | None = None, **params: Any
    ) -> dict[str, Any]:
        """Call a method by its name; returns the answer's ``result`` unchanged."""

    async def _ask(
        self, model: str | None, method: str, /, *, on_progress: ProgressListener | None = None, **params: Any
    ) -> Any:
        """Call with the parameters that are not None. The answer is parsed as the model of this name; None: not at all.

        Importing the models takes about 0.3 s. It is done before the call, so that a robot never drives while they load;
        what needs no model, such as an emergency stop, does not wait for them.
        """
        if model is not None:
            from chefbotd.client import models
        answer = await self.call(
            method, on_progress=on_progress or ignore_progress, **drop_defaults(**params)
        )
        return None if model is None else parse(getattr(models, model), answer)


def drop_defaults(**params: Any) -> dict[str, Any]:
    """The parameters that are not None: the daemon knows the defaults of the others."""
    return {name: value for name, value in params.items() if value is not None}


def ignore_progress(_done: float, _total: float, _text: str) -> None:
    """Ignore a report of progress. Each report gives the answer more time."""
