"""Describes the socket's methods and topics from the models that validate them."""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Literal, TypeAlias

from pydantic import BaseModel

from chefbotd.rpc import models
from chefbotd.rpc.jobs import JobProgress
from chefbotd.rpc.jsonrpc import ERRORS
from chefbotd.rpc.method import Method
from chefbotd.rpc.topics import Topic

Mode: TypeAlias = Literal["validation", "serialization"]

NOTIFICATIONS: Mapping[str, type[BaseModel]] = {
    "hello": models.Hello,
    "event": models.Event,
    "dropped": models.Dropped,
    "progress": JobProgress,
}


def describe(methods: Mapping[str, Method], topics: Mapping[str, Topic]) -> models.Description:
    """What ``describe`` answers, for these methods and topics."""
    return models.Description(
        protocol=models.PROTOCOL,
        methods={name: _method(method) for name, method in methods.items()},
        topics={name: _topic(topic) for name, topic in topics.items()},
        notifications={name: _schema(model, "validation") for name, model in NOTIFICATIONS.items()},
        errors={
            str(kind): models.ErrorDescription(code=e.code, meaning=e.meaning, closes=e.closes)
            for kind, e in ERRORS.items()
        },
    )


def prepare(methods: Mapping[str, Method], topics: Mapping[str, Topic]) -> Iterator[None]:
    """Build the schemas that ``describe`` needs, one per step, so that no step takes longer than a few milliseconds."""
    wanted: list[tuple[type[BaseModel], Mode]] = [(m.params, "validation") for m in methods.values()]
    wanted += [(m.result, "serialization") for m in methods.values()]
    wanted += [(t.model, "serialization") for t in topics.values()]
    wanted += [(model, "validation") for model in NOTIFICATIONS.values()]
    for model, mode in wanted:
        _schema(model, mode)
        yield


def _method(method: Method) -> models.MethodDescription:
    return models.MethodDescription(
        summary=method.summary,
        role=method.role,
        params=_schema(method.params, "validation"),
        result=_schema(method.result, "serialization"),
    )


def _topic(topic: Topic) -> models.TopicDescription:
    summary = (topic.model.__doc__ or "").partition("\n")[0]
    return models.TopicDescription(summary=summary, data=_schema(topic.model, "serialization"))


@cache
def _schema(model: type[BaseModel], mode: Mode) -> dict[str, Any]:
    """A model's JSON Schema, built once in a process: it depends on the class alone."""
    return model.model_json_schema(mode=mode, by_alias=False)
