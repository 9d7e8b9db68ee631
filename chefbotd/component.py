"""The door: what a component, ours or a stranger's, offers to the daemon, the worker, ``chefbotctl`` and the page.

A component is one folder and one section of the configuration. Whatever is slow to load is named by a reference,
``module:attribute``, and loaded when it is needed.
"""

from collections.abc import Callable, Iterator, Mapping
from enum import StrEnum
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from msgspec import Struct

if TYPE_CHECKING:
    from chefbotd.core.parameters import Parameters

API_VERSION: Final = 1
"""What a component may rely on: this module, its ``Context`` but for ``parts``, ``Feature``, and what
docs/adding_a_component.md names. It rises with each change that breaks a component."""

Reference: TypeAlias = str
"""``package.module:attribute``."""


class SectionForm(StrEnum):
    """How a section stands in the configuration: a table, one that the robot may lack, or a list of tables."""

    TABLE = "table"
    OPTIONAL = "optional"
    LIST = "list"


class StatusRow(Struct, frozen=True):
    """A row of ``chefbotctl status``: ``fact`` makes a ``cli.common.state_text.Fact`` of the data of ``topic``.

    It stands behind the row of the topic ``after`` (empty: at the end). A row that ``ages`` is faint when it is old.
    """

    topic: str
    fact: Reference
    after: str = ""
    ages: bool = False


class PagePart(Struct, frozen=True):
    """A card of the page: the JavaScript ``file`` beside the module ``package``, whose default export is its class.

    The card is a section of the panel ``panel``: ``drive``, ``goals``, ``map``, ``camera``, ``programs``, ``lately``,
    ``people``, ``workshop``, or one of its own with the title ``title``. A lower ``order`` stands higher; the page's own
    cards have 50. The module may import other JavaScript that lies beside it, and a style sheet of the same name is
    loaded with it. Guests see a card only if it is ``for_guests``.
    """

    package: str
    file: str
    panel: str = "workshop"
    title: str = ""
    order: int = 50
    for_guests: bool = False


class RunOption(Struct, frozen=True):
    """An option of ``chefbotd run``: a flag, or with ``choices`` one of these words.

    ``keys`` are the keys of the configuration that it sets, of what was given. ``needs_simulated`` says why a real robot
    has no use for it; empty: it has.
    """

    name: str
    help: str
    keys: Callable[[Any], Mapping[str, object]]
    choices: tuple[str, ...] = ()
    needs_simulated: str = ""


class Hardware(Struct, frozen=True):
    """What ``chefbotd run`` drives in place of the robot's own board, where its ``option`` is given.

    ``check`` is called with the settings, and raises ``ProgramError`` where this robot cannot be simulated. ``clock``
    returns the clock and what makes its loop. ``connect`` takes settings and clock, and returns a context manager of
    ``component_context.ConnectedHardware``.
    """

    option: str
    help: str
    check: Reference
    clock: Reference
    connect: Reference


class Extra(Struct, frozen=True):
    """What a component needs that is not installed with chefbotd: the ``packages`` of the extra ``name``.

    ``when`` says, by its section, whether it cannot do without.
    """

    name: str
    packages: tuple[str, ...]
    when: Callable[[Any], bool] = bool


def _always(section: Any, settings: Any) -> bool:
    """A component without a choice."""
    return True


class Component(Struct, frozen=True, kw_only=True):
    """One capability. ``api`` is the ``API_VERSION`` that it was written for, as a number of its own.

    ``build`` makes its feature, or a list of them, of a ``component_context.Context``; what it raises is said, and the
    daemon runs without the component. Where all runs on one loop, as in a test, ``in_loop`` is its ``substitute``.

    ``section`` is the class of its section, which stands in the configuration under the component's name, or under
    ``section_key``; ``paths`` are its keys that are paths from the configuration's folder. A key in ``short_forms`` may
    be a text alone: it is then the named key of its table. ``check`` is called with the section and all settings, and
    yields a sentence for everything that does not fit together. ``scanners`` are what sees as a lidar does, by the
    section (``settings.model.Scanner``); ``wheelbase_m`` is how far the wheels of a side are spread, if it knows that.

    It is built where its section and the whole settings say that it ``is_enabled``, and then needs its ``extra``. One
    that serves others than the socket's clients, or tells them of the robot, is ``outward``: a replay and a private
    daemon switch its section off. A private daemon also switches off what is ``exclusive``: one daemon on a computer
    can have it. A replay with another configuration leaves a section that is ``fixed`` as recorded. ``page_hosts`` are
    names under which browsers may open the page.

    ``events`` are the classes of its events, for those who read a recording. A component that publishes what came from
    outside does so by ``context.clock.observe``: a replay takes it from the recording. ``skills`` run in the worker,
    each made with the section as JSON and the worker's clock.
    ``commands`` are those of ``chefbotctl`` by name (``map edit`` is one of the group ``map``), ``daemon_commands``
    those of ``chefbotd``; ``run_options`` are options of ``chefbotd run``, and ``hardware`` is what that drives in place
    of a real board. ``client_methods`` are classes with those methods of the typed client that do
    more than ask: ``make client`` puts them into it, beside those of the socket, which it writes.
    """

    name: str
    api: int
    build: Callable[[Any], Any] | Reference | None = None
    in_loop: Reference | None = None
    section: "type[Parameters] | Reference | None" = None
    section_key: str = ""
    form: SectionForm = SectionForm.TABLE
    short_forms: Mapping[str, str] = {}
    scanners: Callable[[Any], tuple[Any, ...]] | None = None
    wheelbase_m: Callable[[Any], float] | None = None
    paths: tuple[str, ...] = ()
    is_enabled: Callable[[Any, Any], bool] = _always
    extra: Extra | None = None
    outward: bool = False
    exclusive: bool = False
    fixed: bool = False
    page_hosts: Callable[[Any, Any], tuple[str, ...]] | Reference | None = None
    check: Callable[[Any, Any], Iterator[str]] | Reference | None = None
    events: tuple[type[Any] | Reference, ...] = ()
    skills: Mapping[str, Reference] = {}
    commands: Mapping[str, Reference] = {}
    client_methods: tuple[Reference, ...] = ()
    daemon_commands: Mapping[str, Reference] = {}
    run_options: tuple[RunOption, ...] = ()
    hardware: Hardware | None = None
    status: tuple[StatusRow, ...] = ()
    page: tuple[PagePart, ...] = ()

    @property
    def key(self) -> str:
        """The name of its section in the configuration."""
        return self.section_key or self.name


def resolve(reference: Any) -> Any:
    """What a reference names; anything but a text is returned as it is.

    Raises:
        ImportError: there is no such module; AttributeError: it has no such attribute.
    """
    if not isinstance(reference, str):
        return reference
    module, _, name = reference.partition(":")
    return getattr(import_module(module), name)


PLUGIN_API_VERSION: Final = 1


class PluginContext(Struct, frozen=True):
    """What a plug-in is built with: ``settings`` are the keys of ``[plugins.settings.NAME]``, not checked by anybody."""

    bus: Any
    clock: Any
    robot_name: str
    settings: Mapping[str, Any]


class Plugin(Struct, frozen=True):
    """The simplest component, which an entry point of the group ``chefbotd.features`` refers to: ``build`` alone.

    ``api`` is the ``PLUGIN_API_VERSION`` that it was written for, as a number of its own.
    """

    api: int
    build: Callable[[PluginContext], Any]
