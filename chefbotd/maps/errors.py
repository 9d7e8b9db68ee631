"""What can go wrong with a stored map, as one exception whose text is ready to be shown."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chefbotd.core.commands import RefusalKind, Refused


class MapStoreError(Refused):
    """Something was not done; everything that was stored before is as it was."""


ADVICE = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the quota of disk space is used up",
    errno.EROFS: "the file system is read-only",
    errno.EACCES: "this user has no permission",
    errno.EPERM: "this user has no permission",
    errno.EIO: "the disk cannot be read or written",
}


def explain(error: OSError) -> str:
    """The reason in words."""
    number = error.errno or 0
    return ADVICE.get(number) or (os.strerror(number) if number else str(error))


@contextmanager
def told(doing: str, path: Path) -> Iterator[None]:
    """Turn a failure of the file system in this block into a ``MapStoreError``: what could not be done, and where."""
    try:
        yield
    except OSError as error:
        where = error.filename if isinstance(error.filename, str) else path
        raise MapStoreError(
            RefusalKind.STORAGE_FAILED, f"cannot {doing}: {explain(error)} ({where})"
        ) from error
