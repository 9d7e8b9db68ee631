"""The configuration of a robot: one TOML file, the environment and overrides, as validated parameters."""

from chefbotd.settings.base import DEFAULT_ROBOT, packaged
from chefbotd.settings.errors import MissingExtraError, SettingsError
from chefbotd.settings.loader import load
from chefbotd.settings.model import Settings

__all__ = ["DEFAULT_ROBOT", "MissingExtraError", "Settings", "SettingsError", "load", "packaged"]
