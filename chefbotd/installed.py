"""Finds the components of strangers among the installed packages, by their entry points. One that fails is said.

Its import runs code of others: it has a limited time, and whatever it raises is the reason why it is left out.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final

import structlog
from msgspec import Struct

from chefbotd.component import (
    API_VERSION,
    PLUGIN_API_VERSION,
    Component,
    Plugin,
    PluginContext,
    resolve,
)
from chefbotd.core.parameters import Parameters
from chefbotd.rpc.models import PluginState

log = structlog.get_logger(component="app")

GROUP: Final = "chefbotd.components"
PLUGIN_GROUP: Final = "chefbotd.features"

LOADED_WITHIN_S = 10.0
"""For its import, and again for its build: as long as it takes, nothing is served, and the board is not open."""

INTERRUPTION = signal.SIGURG
"""Nobody else uses it, and it ends nothing that does not expect it."""


class Hangs(BaseException):
    """It takes too long; no ``Exception``, which a component may catch."""


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


class Installed(Struct, frozen=True):
    """What became of the import of an allowed component; without one, ``state`` and ``reason`` say why."""

    name: str
    package: str
    version: str
    component: Component | None
    state: PluginState = PluginState.RUNNING
    reason: str = ""


class _LeftOutError(Exception):
    """It cannot be used: the state to list it with, and why."""

    def __init__(self, state: PluginState, reason: str) -> None:
        super().__init__(reason)
        self.state = state


def find_installed(name: str) -> Installed:
    """The component that an installed package offers under this name, imported."""
    entries = [*entry_points(group=GROUP, name=name), *entry_points(group=PLUGIN_GROUP, name=name)]
    package, version = _origin(entries)
    try:
        return Installed(name, package, version, _load_component(name, entries))
    except _LeftOutError as problem:
        return Installed(name, package, version, None, problem.state, str(problem))


def _origin(entries: list[EntryPoint]) -> tuple[str, str]:
    """The package that offers it, and its version; empty where it is not exactly one."""
    if len(entries) != 1:
        return "", ""
    (entry,) = entries
    return ("", "") if entry.dist is None else (entry.dist.name, entry.dist.version)


def _load_component(name: str, entries: list[EntryPoint]) -> Component:
    """Raises ``_LeftOutError``."""
    if not entries:
        text = f"no installed package has an entry point {name!r} in the group {GROUP}"
        raise _LeftOutError(PluginState.NOT_FOUND, text)
    if len(entries) > 1:
        packages = ", ".join(sorted(entry.dist.name for entry in entries if entry.dist is not None))
        raise _LeftOutError(PluginState.FAILED, f"more than one package offers it: {packages}")
    (entry,) = entries
    try:
        with limited_time(name):
            return _check_component(name, entry.value, entry.load())
    except _LeftOutError:
        raise
    except BaseException as error:
        raise _LeftOutError(PluginState.FAILED, f"{type(error).__name__}: {error}") from error


def _check_component(name: str, value: str, offered: object) -> Component:
    """The component, with its section's class; a plug-in as the component that it is."""
    if isinstance(offered, Plugin):
        _check_version(offered.api, PLUGIN_API_VERSION)
        return _component_of(name, offered)
    if not isinstance(offered, Component):
        raise _LeftOutError(PluginState.FAILED, f"{value}: expected a Component, got {offered!r}")
    _check_version(offered.api, API_VERSION)
    if offered.name != name:
        raise ValueError(
            f"the entry point {name!r} offers the component {offered.name!r}: both need one name"
        )
    if offered.section is not None:
        section = resolve(offered.section)
        if not (isinstance(section, type) and issubclass(section, Parameters)):
            raise TypeError(f"expected a class of Parameters as its section, got {section!r}")
        section.model_rebuild(force=True)
    return offered


def _check_version(api: int, own: int) -> None:
    if api != own:
        raise _LeftOutError(
            PluginState.INCOMPATIBLE,
            f"it was written for version {api} of the plug-ins' interface, this chefbotd has {own}",
        )


def _component_of(name: str, plugin: Plugin) -> Component:
    """A plug-in has no class of its settings: it checks ``[plugins.settings.NAME]`` itself."""

    def build(context: Any) -> Any:
        settings = context.settings.plugins.settings.get(name, {})
        return plugin.build(PluginContext(context.bus, context.clock, context.robot_name, settings))

    return Component(name=name, api=API_VERSION, build=build)
