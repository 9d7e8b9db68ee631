"""Two demonstrations in one folder would take each other's map that is being made."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chefbotd.cli.common.exits import Exit, ProgramError


@contextmanager
def only_one_in(folder: Path) -> Iterator[None]:
    """Keep the folder from every other demonstration until the end, which the kernel sees to.

    Raises:
        ProgramError: another one has it, or it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder / ".demo.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise ProgramError(Exit.NOT_DONE, f"cannot write to {folder}: {error.strerror}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        told = f"another demonstration is writing to {folder}: wait for it, or give another folder with --out"
        raise ProgramError(Exit.NOT_DONE, told) from None
    finally:
        os.close(descriptor)
