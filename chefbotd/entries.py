"""The names that plug-ins of version 1 import: elsewhere they are ``InputLog`` and ``inputs_of``."""

from chefbotd.inputs import InputLog as Entries
from chefbotd.inputs import inputs_of as entries_of

__all__ = ["Entries", "entries_of"]
