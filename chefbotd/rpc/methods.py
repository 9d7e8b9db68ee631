"""The server's own methods: the daemon's description, clients, subscriptions, and control."""

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any

import structlog
from msgspec import defstruct
from msgspec.structs import replace

from chefbotd.clock import Clock
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence
from chefbotd.rpc import models
from chefbotd.rpc.access import Keyring, digest
from chefbotd.rpc.control_leases import ControlLeases, Sources
from chefbotd.rpc.encoding import schema
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.jobs import JobProgress, Jobs
from chefbotd.rpc.jsonrpc import ERRORS, ErrorKind
from chefbotd.rpc.method import Caller, Method, Unserved, method, methods_of
from chefbotd.rpc.models import DONE, NoParams, Params
from chefbotd.rpc.parameters import Role
from chefbotd.rpc.topics import Topic

NOTIFICATIONS: Mapping[str, type[Record]] = {
    "hello": models.Greeting,
    "event": models.TelemetryEvent,
    "dropped": models.Dropped,
    "progress": JobProgress,
}


def describe(
    methods: Mapping[str, Method],
    topics: Mapping[str, Topic],
    plugins: tuple[models.PluginDescription, ...] = (),
) -> models.Description:
    """What ``describe`` answers, for these methods, topics and plug-ins."""
    return models.Description(
        protocol=models.PROTOCOL,
        methods={name: _method(method) for name, method in methods.items()},
        topics={name: _topic(topic) for name, topic in topics.items()},
        notifications={name: _schema(model) for name, model in NOTIFICATIONS.items()},
        errors={
            str(kind): models.ErrorDescription(code=kind.code, meaning=kind.meaning, closes=kind.closes)
            for kind in ERRORS
        },
        plugins=plugins,
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
        for_guests=method.is_allowed(Role.GUEST),
        params=_schema(method.params),
        result=_schema(method.result),
    )


def _topic(topic: Topic) -> models.TopicDescription:
    summary = (topic.model.__doc__ or "").partition("\n")[0]
    return models.TopicDescription(summary=summary, for_guests=topic.for_guests, data=_schema(topic.model))


def _schema(model: Any) -> dict[str, Any]:
    return _built_schema(model)


@cache
def _built_schema(model: Any) -> dict[str, Any]:
    """A JSON Schema, built once in a process: it depends on the class alone."""
    return model.model_json_schema(by_alias=False) if issubclass(model, Params) else schema(model)


log = structlog.get_logger(__name__)


class ServerMethods:
    """The handlers.

    ``table`` has every method of the socket by name. ``plugins`` are those that the configuration allows.
    """

    def __init__(
        self,
        table: Mapping[str, Method],
        fanout: Fanout,
        clock: Clock,
        leases: ControlLeases,
        sources: Sources,
        keyring: Keyring | None = None,
        plugins: tuple[models.PluginDescription, ...] = (),
    ) -> None:
        self._plugins = plugins
        self._table, self._fanout, self._clock, self._leases = table, fanout, clock, leases
        self._sources, self._keyring = sources, keyring

    @method(role=None, when_crowded=True)
    def authenticate(self, caller: Caller, params: models.AuthenticateParams) -> models.Authenticated:
        """Authenticate with a token; its role decides which methods the client may call."""
        session, keyring = caller.session, self._keyring
        role = session.role if keyring is None else keyring.role_of(params.token.get_secret_value())
        if role is None:
            raise Unserved(ErrorKind.WRONG_TOKEN, Sentence("socket.wrong_token", "this token is not valid"))
        session.show_token(role, None if keyring is None else digest(params.token.get_secret_value()))
        log.info("client_authenticated", client=str(session), role=str(role))
        return models.Authenticated(client=str(session), role=role)

    @method(role=Role.OBSERVE, for_guests=True, when_crowded=True)
    def set_client_name(self, caller: Caller, params: models.SetClientNameParams) -> models.Done:
        """Set the name under which other clients see this one."""
        caller.session.client = params.client
        self._leases.renamed(caller.session, self._clock.now_s())
        return DONE

    @method(role=Role.OBSERVE, for_guests=True, constant=True)
    def describe(self, caller: Caller, params: NoParams) -> models.Description:
        """Describe the methods, topics and errors, with their JSON Schemas."""
        return describe(self._table, self._fanout.topics, self._plugins)

    @method(role=Role.OBSERVE)
    def list_plugins(self, caller: Caller, params: NoParams) -> models.PluginList:
        """The plug-ins that the configuration allows, and what became of each."""
        return models.PluginList(plugins=self._plugins)

    @method(role=Role.OBSERVE, for_guests=True, when_crowded=True)
    def ping(self, caller: Caller, params: NoParams) -> models.Pong:
        """Answer at once, with the daemon's time."""
        return models.Pong(stamp_s=self._clock.now_s())

    @method(role=Role.OBSERVE)
    def get_state(self, caller: Caller, params: NoParams) -> Record:
        """The link, the gate, and the latest value of each topic with its age."""
        fanout = self._fanout
        always_known: dict[str, Any] = {
            name: topic.data(fanout.state(name))
            for name, topic in fanout.topics.items()
            if topic.always_known
        }
        state: Any = self._table["get_state"].result
        return state(stamp_s=self._clock.now_s(), **always_known, topics=fanout.states())  # type: ignore[no-any-return]

    @method(
        role=Role.OBSERVE,
        for_guests=True,
        afterwards=lambda self, caller, params: self._send_snapshots(caller, params),
    )
    def subscribe(self, caller: Caller, params: models.SubscribeParams) -> models.Subscribed:
        """Receive topics from now on, first the latest value of each; replaces their rate and policy."""
        self._require_known(params.topics)
        if caller.session.role is Role.GUEST:
            self._require_for_guests(params.topics)
        interval_s = 0.0 if params.max_rate_hz is None else 1.0 / params.max_rate_hz
        self._fanout.add_receiver(caller, params.topics, params.policy, interval_s)
        return self._subscribed(caller)

    def _send_snapshots(self, caller: Caller, params: models.SubscribeParams) -> None:
        self._fanout.snapshot(caller, dict.fromkeys(params.topics))

    @method(role=Role.OBSERVE, for_guests=True)
    def unsubscribe(self, caller: Caller, params: models.UnsubscribeParams) -> models.Subscribed:
        """Stop receiving these topics; without any, all topics."""
        self._require_known(params.topics or ())
        self._fanout.remove_receiver(caller, params.topics)
        return self._subscribed(caller)

    def _subscribed(self, caller: Caller) -> models.Subscribed:
        return models.Subscribed(topics=self._fanout.subscribed(caller))

    def _require_known(self, names: Iterable[str]) -> None:
        topics = self._fanout.topics
        for name in names:
            if name not in topics:
                raise Unserved(
                    ErrorKind.UNKNOWN_TOPIC,
                    Sentence(
                        "socket.no_topic",
                        "no topic {name!a}; there are {others}",
                        name=name,
                        others=", ".join(topics),
                    ),
                )

    def _require_for_guests(self, names: Iterable[str]) -> None:
        for name in names:
            if not self._fanout.topics[name].for_guests:
                raise Unserved(
                    ErrorKind.FORBIDDEN,
                    Sentence("socket.topic_not_for_guests", "the topic {name} is not for guests", name=name),
                )

    @method(role=Role.DRIVE, moves=False)
    def take_control(self, caller: Caller, params: models.TakeControlParams) -> models.ControlTaken:
        """Take control of a source of commands, also from another client, whose motion then stops.

        From another client it counts as a decision to drive after a stop, unless this client has tried to drive, or
        took control, within the last second: then it only repeats itself.
        """
        source, names = params.source or self._sources.default, self._sources.names
        if source not in names:
            raise Refused(
                RefusalKind.UNKNOWN_SOURCE,
                Sentence(
                    "driving.unknown_source",
                    "no source named {source!a}; there are {others}",
                    source=source,
                    others=", ".join(names),
                ),
            )
        before = self._leases.take_source(source, caller.session, self._clock.now_s())
        others = None if before is None or before is caller.session else str(before)
        self._sources.take_over(caller.session.number, source, from_another=others is not None)
        return models.ControlTaken(source=source, taken_from=others)

    @method(role=Role.DRIVE, moves=False)
    def release_control(self, caller: Caller, params: NoParams) -> models.Released:
        """Give back every source that this client has; its commands are withdrawn."""
        return models.Released(sources=self._leases.release(caller.session, self._clock.now_s()))


OWN_METHODS = frozenset(
    name
    for handlers in (ServerMethods, Jobs)
    for name, function in vars(handlers).items()
    if hasattr(function, "_method")
)
"""The names that no feature's method may have."""


def state_model(topics: Mapping[str, Topic]) -> type[Record]:
    """The record that ``get_state`` answers, with a member of its own for each topic that is always known."""
    return _state_model(tuple((name, topic.model) for name, topic in topics.items() if topic.always_known))


@cache
def _state_model(topics: tuple[tuple[str, type[Any]], ...]) -> type[Record]:
    doc = "The link, the safety state, and the latest value of each topic that has one."
    fields = (("stamp_s", float), *topics, ("topics", dict[str, models.TopicState]))
    state: Any = defstruct("State", fields, bases=(Record,), namespace={"__doc__": doc}, frozen=True)
    return state  # type: ignore[no-any-return]


def method_table(
    methods: Mapping[str, Method],
    fanout: Fanout,
    clock: Clock,
    leases: ControlLeases,
    sources: Sources,
    *,
    keyring: Keyring | None = None,
    jobs: Jobs | None = None,
    plugins: tuple[models.PluginDescription, ...] = (),
) -> dict[str, Method]:
    """The server's own methods, and those of the features behind them, by name.

    Raises:
        ValueError: a feature has a method of the same name as the server.
    """
    table: dict[str, Method] = {}
    own = ServerMethods(table, fanout, clock, leases, sources, keyring, plugins)
    table.update({row.name: row for row in (*methods_of(own), *methods_of(jobs or Jobs()))})
    table["get_state"] = replace(table["get_state"], result=state_model(fanout.topics))
    if repeated := sorted(table.keys() & methods.keys()):
        raise ValueError(f"the server already has the method {', '.join(repeated)}")
    table.update(methods)
    return table
