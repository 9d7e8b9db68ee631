"""What a plug-in offers: a feature from a package of its own, which the configuration has to allow by name."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from msgspec import Struct

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.features.feature import Feature

API_VERSION: Final = 1
"""What a plug-in may rely on: ``PluginContext``, ``Feature`` and what docs/adding_a_feature.md names. It rises with each
change that breaks a plug-in."""


class PluginContext(Struct, frozen=True):
    """What a plug-in is built with: ``settings`` are the keys of ``[plugins.settings.NAME]``, not checked by anybody."""

    bus: Bus
    clock: Clock
    robot_name: str
    settings: Mapping[str, Any]


class Plugin(Struct, frozen=True):
    """What an entry point of the group ``chefbotd.features`` refers to.

    ``api`` is the ``API_VERSION`` that the plug-in was written for, as a number of its own. ``build`` makes the feature;
    what it raises is said, and the daemon runs without the plug-in.
    """

    api: int
    build: Callable[[PluginContext], Feature]
