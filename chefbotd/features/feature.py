"""The definition of a feature: its services, its methods and topics of the socket, and its figures."""

from collections.abc import Callable, Coroutine, Iterable, Mapping
from typing import Any, TypeAlias

from msgspec import Struct

from chefbotd.core.record import Stateful
from chefbotd.features.log_topic import log_topic
from chefbotd.metrics import Metrics
from chefbotd.rpc.method import Method
from chefbotd.rpc.topics import Topic

Run: TypeAlias = Callable[[], Coroutine[Any, Any, None]]
Waiting: TypeAlias = Mapping[str, Callable[[Any], Coroutine[Any, Any, Any]]]
"""Makes a method's handler for a request, from the function that takes its progress."""


class Service(Struct, frozen=True):
    """A loop that runs as long as the daemon does.

    If a ``critical`` service fails, the daemon ends. Any other one is restarted, with the motors stopped. A replay runs
    a service that is ``in_steps``: each of its steps from one wait to the next is an entry.
    """

    name: str
    run: Run
    critical: bool = False
    in_steps: bool = False


def _none_waits() -> Waiting:
    """No request waits."""
    return {}


class ReplayedInputs(Struct, frozen=True):
    """What a replay takes from a recording for a feature, beside requests, timers and the bytes of links.

    ``take`` has a handler for each class of events that comes in. One of ``core.events.inputs`` comes in as such; any
    other one was published by ``InputLog.observe``, and is published again after its handler. ``go_on`` is called when
    a recorded state has been restored.
    """

    take: Mapping[type[Any], Callable[[Any], None]]
    go_on: Callable[[], None] = lambda: None


def _no_inputs() -> ReplayedInputs:
    """Nothing of its own comes in."""
    return ReplayedInputs({})


def _no_metrics(metrics: Metrics) -> None:
    """Add nothing."""


class Feature(Struct, frozen=True):
    """One capability of the robot. ``add_metrics`` adds its figures to the registry.

    ``parts`` have a state that lasts from one entry to the next; a recording contains these states by name.
    ``waiting`` returns the waiting requests by the names of their tasks, with the function that continues each.
    ``inputs`` makes what a replay takes in for it. Parts that are ``configured`` stay as they are in a replay with
    another configuration. The methods ``not_replayed`` only look, at what a replay has not. ``offers`` is for components
    that build on this one; ``skill_host`` runs the skills of those behind it (``chefbotd.component_context.SkillHost``).
    """

    name: str
    services: tuple[Service, ...] = ()
    methods: tuple[Method, ...] = ()
    topics: tuple[Topic, ...] = ()
    add_metrics: Callable[[Metrics], None] = _no_metrics
    parts: Mapping[str, Stateful] = {}
    waiting: Callable[[], Waiting] = _none_waits
    inputs: Callable[[], ReplayedInputs] = _no_inputs
    configured: tuple[str, ...] = ()
    not_replayed: tuple[str, ...] = ()
    offers: Any = None
    skill_host: Any = None


def methods_and_topics(features: Iterable[Feature]) -> tuple[dict[str, Method], dict[str, Topic]]:
    """The methods and the topics of all features by name, with the log of what their events say.

    Raises:
        ValueError: two features have a method or a topic of the same name.
    """
    methods: dict[str, Method] = {}
    topics: dict[str, Topic] = {}
    for feature in features:
        _add(methods, {method.name: method for method in feature.methods}, f"{feature.name}: method")
        _add(topics, {topic.name: topic for topic in feature.topics}, f"{feature.name}: topic")
    _add(topics, {"log": log_topic(topics.values())}, "log: topic")
    return methods, topics


def _add(rows: dict[str, Any], more: dict[str, Any], what: str) -> None:
    if repeated := sorted(rows.keys() & more.keys()):
        raise ValueError(f"{what} {', '.join(repeated)} already belongs to another feature")
    rows.update(more)
