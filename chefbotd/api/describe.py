"""The interface, described by the models that check it."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from chefbotd.api import answers
from chefbotd.api.jsonrpc import ERRORS
from chefbotd.api.method import Method
from chefbotd.api.topics import Topic

NOTIFICATIONS: Mapping[str, type[BaseModel]] = {
    "hello": answers.Hello,
    "event": answers.Event,
    "dropped": answers.Dropped,
}


def describe(methods: Mapping[str, Method], topics: Mapping[str, Topic]) -> answers.Description:
    """What ``describe`` answers, for these methods and topics."""
    return answers.Description(
        protocol=answers.PROTOCOL,
        methods={name: _method(method) for name, method in methods.items()},
        topics={name: _topic(topic) for name, topic in topics.items()},
        notifications={name: _schema(model) for name, model in NOTIFICATIONS.items()},
        errors={
            str(kind): answers.ErrorDescription(code=e.code, meaning=e.meaning, closes=e.closes)
            for kind, e in ERRORS.items()
        },
    )


def _method(method: Method) -> answers.MethodDescription:
    return answers.MethodDescription(
        summary=method.summary,
        role=method.role,
        params=_schema(method.params),
        result=_schema(method.result, mode="serialization"),
    )


def _topic(topic: Topic) -> answers.TopicDescription:
    summary = (topic.model.__doc__ or "").partition("\n")[0]
    return answers.TopicDescription(summary=summary, data=_schema(topic.model, mode="serialization"))


def _schema(model: type[BaseModel], mode: Any = "validation") -> dict[str, Any]:
    return model.model_json_schema(mode=mode, by_alias=False)
