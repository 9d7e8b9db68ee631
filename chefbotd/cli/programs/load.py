"""Loads and checks a configuration for a command."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from chefbotd.cli.common.exits import Exit, ProgramError

if TYPE_CHECKING:
    from chefbotd.settings import Settings, SettingsError


def load_valid(path: Path | None, overrides: Mapping[str, object] | None = None) -> "Settings":
    """The configuration at ``path`` (None: the packaged ChefBot's).

    Raises:
        ProgramError: it is not valid, or cannot be read without an extra; the message says why.
    """
    from chefbotd.settings import SettingsError, load

    try:
        return load(path, overrides=overrides)
    except SettingsError as error:
        raise bad_configuration(error) from error


def bad_configuration(error: "SettingsError") -> ProgramError:
    """Its text, the differences between description and configuration, and the exit code that fits."""
    from chefbotd.settings import MissingExtraError

    details = {"differences": error.differences} if error.differences else {}
    is_missing = isinstance(error, MissingExtraError)
    return ProgramError(Exit.NOT_INSTALLED if is_missing else Exit.BAD_CONFIGURATION, str(error), **details)
