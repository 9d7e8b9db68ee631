"""A configuration that cannot be used, as the end of a program."""

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.settings import MissingExtraError, SettingsError


def bad_configuration(error: SettingsError) -> ProgramError:
    """Its text, the differences between description and configuration, and the exit code that fits."""
    details = {"differences": error.differences} if error.differences else {}
    is_missing = isinstance(error, MissingExtraError)
    return ProgramError(Exit.NOT_INSTALLED if is_missing else Exit.BAD_CONFIGURATION, str(error), **details)
