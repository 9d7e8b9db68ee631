"""Composes the configuration from the sections of its components: ours, and those of strangers that it allows."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from msgspec.structs import replace
from pydantic import PlainSerializer, SecretStr, ValidationError, WrapValidator, create_model

from chefbotd.component import Component, SectionForm, resolve
from chefbotd.component_list import own_components
from chefbotd.core.parameters import Parameters, section

if TYPE_CHECKING:
    from chefbotd.installed import Installed
    from chefbotd.settings.model import Settings

M = TypeVar("M", bound=Parameters)


def with_sections(model: type[M], components: Iterable[Component]) -> type[M]:
    """The model with a field for the section of each component, under the component's name."""
    return _compose_model(
        model,
        {component.key: _field(component) for component in components if component.section is not None},
    )


def _compose_model(model: type[M], fields: Mapping[str, Any]) -> type[M]:
    make: Any = create_model
    made: type[M] = make("Settings", __base__=model, __module__=model.__module__, **fields)
    made.__doc__ = model.__doc__
    return made


def _field(component: Component) -> tuple[Any, Any]:
    kind: Any = resolve(component.section)
    match component.form:
        case SectionForm.TABLE:
            return kind, section()
        case SectionForm.OPTIONAL:
            return kind | None, None
        case SectionForm.LIST:
            return tuple[kind, ...], ()


def model_for(values: Mapping[str, Any], model: "type[Settings]") -> "type[Settings]":
    """The model that checks a configuration with these values: ``model``, with the sections of allowed strangers.

    A section of one that is left out is not checked: the daemon runs without it, whatever it says.
    """
    allowed = _allowed_names(values)
    if not allowed:
        return model
    from chefbotd.installed import find_installed  # a robot without strangers does not look for any

    strangers = [_with_own_section(find_installed(name), model) for name in allowed]
    fields: dict[str, Any] = {}
    for stranger in strangers:
        if stranger.component is None and stranger.name in values and stranger.name not in model.model_fields:
            fields[stranger.name] = (Annotated[Any, PlainSerializer(lambda _: {}, when_used="json")], None)
        elif stranger.component is not None and stranger.component.section is not None:
            kind, default = _field(stranger.component)
            fields[stranger.component.key] = (Annotated[kind, WrapValidator(_refuse_faults)], default)
    made = _compose_model(model, fields)
    made.strangers = tuple(strangers)
    return made


def _allowed_names(values: Mapping[str, Any]) -> list[str]:
    """The names in ``[plugins] allow``, each once; what is none is refused by the model."""
    plugins = values.get("plugins")
    names = plugins.get("allow") if isinstance(plugins, Mapping) else None
    if not isinstance(names, list | tuple):
        return []
    return list(dict.fromkeys(name for name in names if isinstance(name, str)))


def _with_own_section(stranger: "Installed", model: type[Parameters]) -> "Installed":
    """Left out where its section is another part's."""
    component = stranger.component
    if component is None or component.section is None or component.key not in model.model_fields:
        return stranger
    from chefbotd.rpc.models import PluginState

    reason = f"ValueError: there is a section [{component.key}] already"
    return replace(stranger, component=None, state=PluginState.FAILED, reason=reason)


def _refuse_faults(value: Any, validate: Callable[[Any], Any]) -> Any:
    """A check of somebody else that fails, rather than refuses, refuses the value all the same."""
    try:
        return validate(value)
    except (ValidationError, ValueError, AssertionError):
        raise
    except Exception as fault:
        raise ValueError(f"its check fails: {type(fault).__name__}: {fault}") from fault


def paths_of(model: "type[Settings]") -> list[tuple[str, str]]:
    """The sections and keys of components that are paths from the configuration's folder."""
    strangers = [stranger.component for stranger in model.strangers if stranger.component is not None]
    return [(component.key, key) for component in (*own_components(), *strangers) for key in component.paths]


def switched_off(settings: "Settings", *, exclusive: bool = False) -> dict[str, Any]:
    """The sections of what serves others or tells them of the robot, each switched off; or of what is exclusive, too."""
    return {
        component.key: _off(component, getattr(settings, component.key))
        for component in _components(settings)
        if component.section is not None and (component.outward or (exclusive and component.exclusive))
    }


def _off(component: Component, section_of_component: Any) -> Any:
    match component.form:
        case SectionForm.TABLE:
            return section_of_component.model_copy(update={"enabled": False})
        case SectionForm.OPTIONAL:
            return None
        case SectionForm.LIST:
            return ()


def fixed_sections(settings: "Settings") -> dict[str, Any]:
    """The sections that stay as they were recorded in a replay with another configuration."""
    return {
        component.key: getattr(settings, component.key)
        for component in _components(settings)
        if component.section is not None and component.fixed
    }


def _components(settings: "Settings") -> list[Component]:
    """Ours, and those of strangers that were found."""
    strangers = [stranger.component for stranger in settings.strangers if stranger.component is not None]
    return [*own_components(), *strangers]


def check_components(settings: "Settings", components: Iterable[Component]) -> Iterator[str]:
    """What each component says of its section and of others."""
    for component in components:
        if component.check is not None:
            yield from resolve(component.check)(getattr(settings, component.key, None), settings)


def check_strangers(settings: "Settings") -> Iterator[str]:
    """The same of allowed strangers; and what is written where none of them reads it."""
    for stranger in settings.strangers:
        component = stranger.component
        if component is None:
            continue
        if component.section is not None and stranger.name in settings.plugins.settings:
            yield f"plugins.settings.{stranger.name}: its keys stand in a section of their own, [{stranger.name}]"
        try:
            yield from [f"[{stranger.name}] {wrong}" for wrong in check_components(settings, [component])]
        except Exception as fault:  # noqa: BLE001 - somebody else's code, and it is told
            yield f"[{stranger.name}] its check fails: {type(fault).__name__}: {fault}"


def secrets_of(value: object) -> Iterator[str]:
    """Every secret in parameters, in plain text: for who keeps them out of a file."""
    if isinstance(value, SecretStr):
        yield value.get_secret_value()
    elif isinstance(value, Parameters):
        for name in type(value).model_fields:
            yield from secrets_of(getattr(value, name))
    elif isinstance(value, Mapping):
        for inner in value.values():
            yield from secrets_of(inner)
    elif isinstance(value, list | tuple | set | frozenset):
        for inner in value:
            yield from secrets_of(inner)
