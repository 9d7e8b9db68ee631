"""Builds components, ours and strangers', through one door. One that cannot be built is said, and left out."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import structlog
from msgspec.structs import replace

from chefbotd.component import Component, PagePart, resolve
from chefbotd.component_context import Context as ComponentContext
from chefbotd.composition.context import Context
from chefbotd.entries import entries_of
from chefbotd.features.feature import Feature, Service, methods_and_topics
from chefbotd.metrics import Metrics
from chefbotd.rpc.methods import OWN_METHODS
from chefbotd.rpc.models import PluginDescription, PluginState

if TYPE_CHECKING:
    from chefbotd.components.worker.process import Worker
    from chefbotd.driving.inner_driver import InnerDriver
    from chefbotd.driving.service import DriveService
    from chefbotd.installed import Installed
    from chefbotd.rpc.control_leases import ControlLeases

log = structlog.get_logger(component="app")

BUILT_LAST = "discovery"
"""The feature, and its service, that needs the sockets, which need every method first."""


class Built:
    """The features of strangers' components, what became of each, their parts of the page, the classes of events."""

    def __init__(self) -> None:
        self.features: list[Feature] = []
        self.descriptions: list[PluginDescription] = []
        self.page: list[tuple[str, PagePart]] = []
        self.events: dict[str, type[Any]] = {}


def build_strangers(
    context: Context,
    driving: "DriveService",
    leases: "ControlLeases",
    worker: "Worker | None",
    others: Iterable[Feature],
) -> Built:
    """The components that the configuration allows; ``others`` are the features that the robot has without them."""
    built, others = Built(), list(others)
    for stranger in _strangers(context):
        before = [*others, *built.features]
        features, stranger = _built(stranger, context, driving, leases, worker, before)
        name, package, version = stranger.name, stranger.package, stranger.version
        if stranger.component is None:
            log.error("a plug-in is left out", plugin=name, state=str(stranger.state), reason=stranger.reason)
        else:
            built.features += features
            built.page += [(name, part) for part in stranger.component.page]
            built.events |= _events(stranger.component)
            log.info("plug-in loaded", plugin=name, package=package, version=version)
        built.descriptions.append(PluginDescription(name, package, version, stranger.state, stranger.reason))
    return built


def _strangers(context: Context) -> "list[Installed]":
    """As they were found when the configuration was read."""
    settings = context.settings
    found = {stranger.name: stranger for stranger in settings.strangers}
    if settings.plugins.allow:
        from chefbotd.installed import find_installed

        return [found.get(name) or find_installed(name) for name in settings.plugins.allow]
    return []


def brings_skills(context: Context) -> bool:
    """Whether an allowed component has a skill for the worker."""
    return any(stranger.component and stranger.component.skills for stranger in _strangers(context))


def _built(
    stranger: "Installed",
    context: Context,
    driving: "DriveService",
    leases: "ControlLeases",
    worker: "Worker | None",
    others: list[Feature],
) -> "tuple[list[Feature], Installed]":
    """Its features; without any where it is left out, which it then says."""
    component = stranger.component
    if component is None:
        return [], stranger
    from chefbotd.installed import limited_time

    try:
        with limited_time(stranger.name):
            opened = open_door(component, context, driving, leases, worker)
            features = features_of(component, opened)
            _check(features, others)
            _check_events(component)
            if component.skills:
                _add_skills(component, opened)
    except BaseException as error:  # noqa: BLE001 - somebody else's code, which may even exit
        reason = f"{type(error).__name__}: {error}"
        return [], replace(stranger, component=None, state=PluginState.FAILED, reason=reason)
    return [_guarded(feature, stranger.name, opened.driver) for feature in features], stranger


def open_door(
    component: Component,
    context: Context,
    driving: "DriveService",
    leases: "ControlLeases",
    worker: "Worker | None",
) -> ComponentContext[Any]:
    """What the component is built with."""
    settings = context.settings
    return ComponentContext(
        section=None if component.section is None else getattr(settings, component.name),
        bus=context.bus,
        clock=entries_of(context.clock),
        robot_name=settings.robot.name,
        settings=settings,
        driver=_driver(component.name, context, driving, leases),
        worker=worker,
        parts=context,
    )


def _driver(
    source: str, context: Context, driving: "DriveService", leases: "ControlLeases"
) -> "InnerDriver | None":
    safety = context.settings.safety
    if source not in safety.sources:
        return None
    from chefbotd.driving.inner_driver import InnerDriver

    return InnerDriver(driving, leases, context.clock, source, safety.above(source))


def features_of(component: Component, opened: ComponentContext[Any]) -> list[Feature]:
    """What its ``build`` makes.

    Raises:
        TypeError: it is no feature.
    """
    if component.build is None:
        return []
    made = resolve(component.build)(opened)
    features = [made] if isinstance(made, Feature) else list(made) if isinstance(made, list | tuple) else None
    if features is None or not all(isinstance(feature, Feature) for feature in features):
        raise TypeError(f"expected a Feature from its build, got {made!r}")
    return features


def _add_skills(component: Component, opened: ComponentContext[Any]) -> None:
    """Raises ValueError where the worker has one of that name, or there is no worker."""
    if opened.worker is None:
        raise ValueError("its skills need the worker: [worker] enabled = true")
    parameters = b"{}" if opened.section is None else opened.section.model_dump_json().encode()
    for name, reference in component.skills.items():
        opened.worker.add_skill(name, reference, parameters)


def _events(component: Component) -> dict[str, type[Any]]:
    """The classes of its events by name."""
    return {event.__name__: event for event in map(resolve, component.events)}


def _check_events(component: Component) -> None:
    """Raises TypeError or ValueError where a recording could not tell them from others."""
    if not component.events:
        return
    from chefbotd.components.recording.classes import event_names  # every class of events

    for name, event in _events(component).items():
        if "stamp_s" not in getattr(event, "__struct_fields__", ()):
            raise TypeError(f"expected events to be records with a stamp_s, got {event!r}")
        if name in event_names():
            raise ValueError(f"there is an event named {name!a} already")


def _check(features: list[Feature], others: list[Feature]) -> None:
    """Raises TypeError or ValueError where the daemon could not run them."""
    for feature in features:
        _check_services(feature)
        _check_names(feature, others)
        others = [*others, feature]
    methods, _ = methods_and_topics(others)
    if repeated := sorted(methods.keys() & OWN_METHODS):
        raise ValueError(f"method {', '.join(repeated)} belongs to the server")


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


def _guarded(feature: Feature, name: str, driver: "InnerDriver | None") -> Feature:
    """Its figures guarded, and its driver among what a recording's states hold."""
    parts = feature.parts if driver is None else {**feature.parts, "driver": driver}
    return replace(feature, add_metrics=lambda metrics: _add_metrics(name, feature, metrics), parts=parts)


def _add_metrics(name: str, feature: Feature, metrics: Metrics) -> None:
    """A figure that another part has already is left out, with those behind it."""
    try:
        feature.add_metrics(metrics)
    except Exception as error:  # noqa: BLE001 - somebody else's code
        log.error("a plug-in's figures are left out", plugin=name, reason=f"{type(error).__name__}: {error}")
