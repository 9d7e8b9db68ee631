"""Loading and checking a configuration for a command."""

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
        ProgramError: it is not valid; the message says why.
    """
    from chefbotd.settings import SettingsError, load

    try:
        return load(path, overrides=overrides)
    except SettingsError as error:
        details = {"differences": error.differences} if error.differences else {}
        raise ProgramError(Exit.BAD_CONFIGURATION, str(error), **details) from error


def simulation(settings: "Settings") -> "Simulation":
    """The simulation that this configuration describes.

    Raises:
        ProgramError: it cannot be simulated; the message says why.
    """
    from chefbotd.process.simulated_robot import CannotSimulateError, checked_simulation

    try:
        return checked_simulation(settings)
    except CannotSimulateError as error:
        raise ProgramError(Exit.BAD_CONFIGURATION, str(error)) from error
