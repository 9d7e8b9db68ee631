"""The error for a stored map; its text is ready to be shown."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.storage import explain


class MapStoreError(Refused):
    """Something was not done; everything that was stored before is as it was."""


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
