"""The skills by name. A skill's module is imported when it is needed."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Final

from chefbotd.worker.skills.skill import Skill

if TYPE_CHECKING:  # it would load asyncio, 7 MB
    from chefbotd.clock import Clock

SKILLS: Final[Mapping[str, str]] = {
    "mapping": "chefbotd.worker.skills.mapping:MappingSkill",
    "localization": "chefbotd.worker.skills.localization:LocalizationSkill",
    "navigation": "chefbotd.worker.skills.navigation:NavigationSkill",
}
"""Name -> module and class, which is made with its parameters as JSON and the worker's clock."""

EXTRA: Final = "navigation"
NEEDS: Final = ("numba", "scipy", "llvmlite")


class CannotLoad(Exception):
    """A skill that cannot work in this installation, and what to do; ready to be shown."""


def loaded(name: str, parameters: bytes, clock: "Clock") -> Skill:
    """The skill of this name.

    Raises:
        CannotLoad: what it needs is not installed.
    """
    module, _, kind = SKILLS[name].partition(":")
    try:
        make: Callable[[bytes, Clock], Skill] = getattr(import_module(module), kind)
    except ModuleNotFoundError as missing:
        if missing.name not in NEEDS:
            raise
        raise CannotLoad(
            f"{name} needs {missing.name}, which is not installed: pip install 'chefbotd[{EXTRA}]'"
        ) from missing
    return make(parameters, clock)
