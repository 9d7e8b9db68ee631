"""The errors of recordings; their texts are ready to be shown."""

from chefbotd.core.commands import Refused


class RecordingError(Refused):
    """The recorder did not do what was asked; what was recorded before is as it was."""


class UnreadableRecording(Exception):
    """A file is no recording, or nothing of it can be read."""
