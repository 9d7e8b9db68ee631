"""Builds components, ours and strangers', through one door. One that cannot be built is said, and left out."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import structlog
from msgspec.structs import replace

from chefbotd import __version__
from chefbotd.component import Component, PagePart, resolve
from chefbotd.component_context import Context as ComponentContext
from chefbotd.component_context import SkillHost
from chefbotd.component_list import FIRST, OWN, SCANNING, own_component, own_components
from chefbotd.composition.context import DaemonParts
from chefbotd.features.feature import Feature, Service, methods_and_topics
from chefbotd.inputs import inputs_of
from chefbotd.metrics import Metrics
from chefbotd.rpc.methods import OWN_METHODS
from chefbotd.rpc.models import PluginDescription, PluginState
from chefbotd.settings import Settings

if TYPE_CHECKING:
    from chefbotd.driving.inner_driver import InnerDriver
    from chefbotd.installed import Installed

log = structlog.get_logger(component="app")


class Built:
    """What components bring beside their features: why one is left out, parts of the page, classes of events, offers."""

    def __init__(self) -> None:
        self.descriptions: list[PluginDescription] = []
        self.page: list[tuple[str, PagePart]] = []
        self.events: dict[str, type[Any]] = {}
        self.offers: dict[str, Any] = {}
        self.worker: SkillHost | None = None

    def add(self, name: str, features: Iterable[Feature]) -> None:
        """What the features of a component offer to those that are built behind it."""
        for feature in features:
            if feature.offers is not None:
                self.offers[name] = feature.offers
            self.worker = feature.skill_host or self.worker


def build_own(names: Iterable[str], parts: DaemonParts, built: Built) -> list[Feature]:
    """The features of these components of ours that the configuration wants; one that fails is left out."""
    features: list[Feature] = []
    for name in names:
        component = own_component(name)
        if not is_wanted(component, parts.context.settings):
            continue
        try:
            made = features_of(component, open_door(component, parts, built))
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            log.error("a component is left out", name=name, reason=reason, exc_info=error)
            built.descriptions.append(
                PluginDescription(name, "chefbotd", __version__, PluginState.FAILED, reason)
            )
        else:
            features += made
            built.add(name, made)
            built.page += [(name, part) for part in component.page]
    return features


def build_strangers(parts: DaemonParts, built: Built, others: Iterable[Feature]) -> list[Feature]:
    """The components that the configuration allows; ``others`` are the features that the robot has without them."""
    features: list[Feature] = []
    for stranger in _strangers(parts.context.settings):
        made, stranger = _build_stranger(stranger, parts, built, [*others, *features])
        name, package, version = stranger.name, stranger.package, stranger.version
        if stranger.component is None:
            log.error("a plug-in is left out", plugin=name, state=str(stranger.state), reason=stranger.reason)
        else:
            features += made
            built.add(name, made)
            built.page += [(name, part) for part in stranger.component.page]
            built.events |= _events(stranger.component)
            log.info("plug-in loaded", plugin=name, package=package, version=version)
        built.descriptions.append(PluginDescription(name, package, version, stranger.state, stranger.reason))
    return features


def is_wanted(component: Component, settings: Settings) -> bool:
    """Whether the configuration asks for it."""
    return component.build is not None and component.is_enabled(section_of(component, settings), settings)


def section_of(component: Component, settings: Settings) -> Any:
    """Its own section; None where it has none."""
    return None if component.section is None else getattr(settings, component.key)


def hosts_of_components(settings: Settings) -> list[str]:
    """The names that components of ours say under which browsers may open the page."""
    return [
        host
        for component in own_components()
        if component.page_hosts is not None and is_wanted(component, settings)
        for host in resolve(component.page_hosts)(section_of(component, settings), settings)
    ]


def _strangers(settings: Settings) -> "list[Installed]":
    """As they were found when the configuration was read."""
    by_name = {stranger.name: stranger for stranger in settings.strangers}
    if settings.plugins.allow:
        from chefbotd.installed import find_installed

        return [by_name.get(name) or find_installed(name) for name in settings.plugins.allow]
    return []


def _build_stranger(
    stranger: "Installed", parts: DaemonParts, built: Built, others: list[Feature]
) -> "tuple[list[Feature], Installed]":
    """Its features; without any where it is left out, which it then says."""
    component = stranger.component
    if component is None:
        return [], stranger
    from chefbotd.installed import limited_time

    try:
        with limited_time(stranger.name):
            opened = open_door(component, parts, built)
            features = features_of(component, opened)
            _check(features, others)
            _check_events(component)
            if component.skills:
                _add_skills(component, opened)
    except BaseException as error:  # noqa: BLE001 - somebody else's code, which may even exit
        reason = f"{type(error).__name__}: {error}"
        return [], replace(stranger, component=None, state=PluginState.FAILED, reason=reason)
    return [_guard_figures(feature, stranger.name, opened.driver) for feature in features], stranger


def open_door(component: Component, parts: DaemonParts, built: Built) -> ComponentContext[Any]:
    """What the component is built with."""
    context = parts.context
    return ComponentContext(
        section=section_of(component, context.settings),
        bus=context.bus,
        clock=inputs_of(context.clock),
        robot_name=context.settings.robot.name,
        settings=context.settings,
        driver=parts.drive_as(component.name),
        worker=built.worker,
        others=built.offers,
        parts=parts,
        substitute=context.substitutes.get(component.name),
    )


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
    from chefbotd.event_classes import event_names  # every class of events

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
    if feature.name in {*FIRST, *SCANNING, *OWN, *[other.name for other in others]}:
        raise ValueError(f"there is a feature named {feature.name!a} already")
    owners = {service.name: other.name for other in others for service in other.services}
    for service in feature.services:
        if service.name in owners:
            raise ValueError(
                f"service {service.name!a} already belongs to the feature {owners[service.name]!a}"
            )
        owners[service.name] = feature.name


def _guard_figures(feature: Feature, name: str, driver: "InnerDriver | None") -> Feature:
    """Its figures guarded, and its driver among what a recording's states hold."""
    parts = feature.parts if driver is None else {**feature.parts, "driver": driver}
    return replace(feature, add_metrics=lambda metrics: _add_metrics(name, feature, metrics), parts=parts)


def _add_metrics(name: str, feature: Feature, metrics: Metrics) -> None:
    """A figure that another part has already is left out, with those behind it."""
    try:
        feature.add_metrics(metrics)
    except Exception as error:  # noqa: BLE001 - somebody else's code
        log.error("a plug-in's figures are left out", plugin=name, reason=f"{type(error).__name__}: {error}")
