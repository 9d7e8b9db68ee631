"""What can go wrong with a recording, as exceptions whose text is ready to be shown."""

import errno
import os

from chefbotd.core.commands import Refused


class RecordingError(Refused):
    """The recorder did not do what was asked; what was recorded before is as it was."""


class UnreadableRecording(Exception):
    """A file is no recording, or nothing of it can be read."""


ADVICE = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the quota of disk space is used up",
    errno.EROFS: "the file system is read-only",
    errno.EACCES: "this user has no permission",
    errno.EPERM: "this user has no permission",
    errno.EIO: "the disk cannot be read or written",
    errno.ENODEV: "the disk is gone",
}


def explain(error: OSError) -> str:
    """The reason in words."""
    number = error.errno or 0
    return ADVICE.get(number) or (os.strerror(number) if number else str(error))
