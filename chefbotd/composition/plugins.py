"""Loads the plug-ins that the configuration allows. One that cannot be loaded is said, and left out."""

import signal
import threading
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import structlog
from msgspec.structs import replace

from chefbotd.composition.context import Context
from chefbotd.features.feature import Feature, Service, methods_and_topics
from chefbotd.features.plugin import API_VERSION, Plugin, PluginContext
from chefbotd.metrics import Metrics
from chefbotd.rpc.methods import OWN_METHODS
from chefbotd.rpc.models import PluginDescription, PluginState

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

log = structlog.get_logger(component="app")

GROUP = "chefbotd.features"
BUILT_LAST = "discovery"
"""The feature, and its service, that needs the sockets, which need every method first."""


LOADED_WITHIN_S = 10.0
"""For its import and its build: as long as it takes, nothing is served, and the board is not open."""


class Hangs(BaseException):
    """It takes too long; no ``Exception``, which a plug-in may catch."""


@contextmanager
def limited_time(name: str) -> Iterator[None]:
    """Raise ``Hangs`` in this block after ``LOADED_WITHIN_S``, where Python runs or waits; and say so in any case."""
    done, ident = threading.Event(), threading.get_ident()

    def interrupt() -> None:
        while not done.wait(LOADED_WITHIN_S):
            log.error("a plug-in hangs at its start: nothing is served until it ends", plugin=name)
            signal.pthread_kill(ident, INTERRUPTION)

    def hangs(_number: int, _frame: object) -> None:
        if not done.is_set():
            raise Hangs(f"it was not ready within {LOADED_WITHIN_S:g} s")

    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread can be interrupted
        return
    before = signal.signal(INTERRUPTION, hangs)
    threading.Thread(target=interrupt, name="plug-in's time", daemon=True).start()
    try:
        yield
    finally:
        done.set()
        signal.signal(INTERRUPTION, before)


INTERRUPTION = signal.SIGURG
"""Nobody else uses it, and it ends nothing that does not expect it."""


class _LeftOutError(Exception):
    """The plug-in cannot be used: the state to list it with, and why."""

    def __init__(self, state: PluginState, reason: str) -> None:
        super().__init__(reason)
        self.state = state


def plugins(
    context: Context, others: Iterable[Feature]
) -> tuple[list[Feature], tuple[PluginDescription, ...]]:
    """The features of the allowed plug-ins, and every allowed one with what became of it.

    ``others`` are the features that the robot has without them.
    """
    features: list[Feature] = []
    described: list[PluginDescription] = []
    others = list(others)
    for name in context.settings.plugins.allow:
        entries = _entries(name)
        package, version = _origin(entries)
        state, reason = PluginState.RUNNING, ""
        try:
            with limited_time(name):
                feature = _feature(name, entries, context, [*others, *features])
        except _LeftOutError as problem:
            state, reason = problem.state, str(problem)
            log.error("a plug-in is left out", plugin=name, state=str(state), reason=reason)
        else:
            features.append(feature)
            log.info("plug-in loaded", plugin=name, package=package, version=version)
        described.append(PluginDescription(name, package, version, state, reason))
    return features, tuple(described)


def _entries(name: str) -> "Collection[EntryPoint]":
    """Those of this name in the group."""
    from importlib.metadata import entry_points  # a robot without plug-ins does not need it

    return entry_points(group=GROUP, name=name)


def _origin(entries: "Collection[EntryPoint]") -> tuple[str, str]:
    """The package that offers it, and its version; empty where it is not exactly one."""
    if len(entries) != 1:
        return "", ""
    (entry,) = entries
    return ("", "") if entry.dist is None else (entry.dist.name, entry.dist.version)


def _feature(
    name: str, entries: "Collection[EntryPoint]", context: Context, others: Iterable[Feature]
) -> Feature:
    """Raises ``_LeftOutError``."""
    plugin = _plugin(name, entries)
    settings = context.settings.plugins.settings.get(name, {})
    try:
        feature = plugin.build(
            PluginContext(context.bus, context.clock, context.settings.robot.name, settings)
        )
        if not isinstance(feature, Feature):
            raise TypeError(f"expected a Feature from its build, got {feature!r}")
        others = list(others)
        _check_services(feature)
        _check_names(feature, others)
        methods, _ = methods_and_topics([*others, feature])
        if repeated := sorted(methods.keys() & OWN_METHODS):
            raise ValueError(f"method {', '.join(repeated)} belongs to the server")
    except BaseException as error:
        raise _LeftOutError(PluginState.FAILED, f"{type(error).__name__}: {error}") from error
    return replace(feature, add_metrics=lambda metrics: _add_metrics(name, feature, metrics))


def _check_services(feature: Feature) -> None:
    """Raises TypeError where the daemon could not run one, which would end it."""
    for service in feature.services:
        if not (isinstance(service, Service) and isinstance(service.name, str) and callable(service.run)):
            raise TypeError(f"expected services with a name and a function, got {service!r}")


def _check_names(feature: Feature, others: list[Feature]) -> None:
    """Raises ValueError where a name is not its own: the log, the faults and a recording name it."""
    if feature.name in {BUILT_LAST, *[other.name for other in others]}:
        raise ValueError(f"there is a feature named {feature.name!a} already")
    owners = {service.name: other.name for other in others for service in other.services}
    owners[BUILT_LAST] = BUILT_LAST
    for service in feature.services:
        if service.name in owners:
            raise ValueError(
                f"service {service.name!a} already belongs to the feature {owners[service.name]!a}"
            )
        owners[service.name] = feature.name


def _plugin(name: str, entries: "Collection[EntryPoint]") -> Plugin:
    """Raises ``_LeftOutError``."""
    if not entries:
        text = f"no installed package has an entry point {name!r} in the group {GROUP}"
        raise _LeftOutError(PluginState.NOT_FOUND, text)
    if len(entries) > 1:
        packages = ", ".join(sorted(entry.dist.name for entry in entries if entry.dist is not None))
        raise _LeftOutError(PluginState.FAILED, f"more than one package offers it: {packages}")
    (entry,) = entries
    try:
        plugin = entry.load()
    except BaseException as error:
        raise _LeftOutError(PluginState.FAILED, f"{type(error).__name__}: {error}") from error
    if not isinstance(plugin, Plugin):
        raise _LeftOutError(PluginState.FAILED, f"{entry.value}: expected a Plugin, got {plugin!r}")
    if plugin.api != API_VERSION:
        raise _LeftOutError(
            PluginState.INCOMPATIBLE,
            f"it was written for version {plugin.api} of the plug-ins' interface, this chefbotd has {API_VERSION}",
        )
    return plugin


def _add_metrics(name: str, feature: Feature, metrics: Metrics) -> None:
    """A figure that another part has already is left out, with those behind it."""
    try:
        feature.add_metrics(metrics)
    except Exception as error:  # noqa: BLE001 - somebody else's code
        log.error("a plug-in's figures are left out", plugin=name, reason=f"{type(error).__name__}: {error}")
