"""Configurations for the programs: loaded and checked in one way, whatever the command."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from chefbotd.cli.common.exits import Exit, ProgramError

if TYPE_CHECKING:
    from chefbotd.settings import Settings
    from chefbotd.sim.simulation import Simulation


def load_valid(path: Path | None, overrides: Mapping[str, object] | None = None) -> "Settings":
    """The configuration at ``path`` (None: the packaged ChefBot's).

    Raises:
        ProgramError: it is not valid, and why.
    """
    from chefbotd.settings import SettingsError, load

    try:
        return load(path, overrides=overrides)
    except SettingsError as error:
        details = {"differences": error.differences} if error.differences else {}
        raise ProgramError(Exit.BAD_CONFIGURATION, str(error), **details) from error


def simulation(settings: "Settings") -> "Simulation":
    """What to simulate for this configuration.

    Raises:
        ProgramError: it cannot be simulated, and why.
    """
    from chefbotd.process.simulated_robot import CannotSimulateError, checked_simulation

    try:
        return checked_simulation(settings)
    except CannotSimulateError as error:
        raise ProgramError(Exit.BAD_CONFIGURATION, str(error)) from error
