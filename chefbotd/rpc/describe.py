"""Describes the socket's methods and topics from the models of what it takes, and the records that it sends."""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from chefbotd.core.record import Record
from chefbotd.rpc import models
from chefbotd.rpc.encoding import schema
from chefbotd.rpc.jobs import JobProgress
from chefbotd.rpc.jsonrpc import ERRORS
from chefbotd.rpc.method import Method
from chefbotd.rpc.models import Params
from chefbotd.rpc.topics import Topic

NOTIFICATIONS: Mapping[str, type[Record]] = {
    "hello": models.Greeting,
    "event": models.TelemetryEvent,
    "dropped": models.Dropped,
    "progress": JobProgress,
}


def describe(methods: Mapping[str, Method], topics: Mapping[str, Topic]) -> models.Description:
    """What ``describe`` answers, for these methods and topics."""
    return models.Description(
        protocol=models.PROTOCOL,
        methods={name: _method(method) for name, method in methods.items()},
        topics={name: _topic(topic) for name, topic in topics.items()},
        notifications={name: _schema(model) for name, model in NOTIFICATIONS.items()},
        errors={
            str(kind): models.ErrorDescription(code=e.code, meaning=e.meaning, closes=e.closes)
            for kind, e in ERRORS.items()
        },
    )


def prepare(methods: Mapping[str, Method], topics: Mapping[str, Topic]) -> Iterator[None]:
    """Build the schemas that ``describe`` needs, one per step, so that no step takes longer than a few milliseconds."""
    params = [method.params for method in methods.values()]
    results = [method.result for method in methods.values()]
    for model in (*params, *results, *(topic.model for topic in topics.values()), *NOTIFICATIONS.values()):
        _schema(model)
        yield


def _method(method: Method) -> models.MethodDescription:
    return models.MethodDescription(
        summary=method.summary,
        role=method.role,
        params=_schema(method.params),
        result=_schema(method.result),
    )


def _topic(topic: Topic) -> models.TopicDescription:
    summary = (topic.model.__doc__ or "").partition("\n")[0]
    return models.TopicDescription(summary=summary, data=_schema(topic.model))


def _schema(model: Any) -> dict[str, Any]:
    return _built_schema(model)


@cache
def _built_schema(model: Any) -> dict[str, Any]:
    """A JSON Schema, built once in a process: it depends on the class alone."""
    return model.model_json_schema(by_alias=False) if issubclass(model, Params) else schema(model)
