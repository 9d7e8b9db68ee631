"""Remembers beyond the end of the daemon that the board at a device runs our firmware.

Such a board names itself once a second, and on a bad line later. Until then it would be taken for a sketch, and driven
by lines without checksums.
"""

import contextlib
import hashlib
from pathlib import Path
from typing import Protocol

import structlog

from chefbotd.link.device_threads import DEVICE_THREADS
from chefbotd.storage import create_file

log = structlog.get_logger(component="link")


class BoardMemory(Protocol):
    """Where it is kept; what cannot be kept raises nothing."""

    def recall(self) -> bool:
        """Whether the board was ours when it was heard last."""
        ...

    def keep(self, *, is_ours: bool) -> None:
        """The board has named itself as ours, or is another one."""
        ...


class NoBoardMemory:
    """Nothing is kept: each start begins anew."""

    def recall(self) -> bool:
        """Nothing is known."""
        return False

    def keep(self, *, is_ours: bool) -> None:
        """Nothing is done."""


class BoardFile:
    """A file for each device whose board is ours, in ``folder``; it has the device's name in it."""

    def __init__(self, folder: Path, device: str) -> None:
        self._path = folder / hashlib.sha256(device.encode()).hexdigest()[:16]
        self._device = device

    def recall(self) -> bool:
        """Whether the file is there. It is looked up once, before the port is opened; what cannot be read is logged."""
        try:
            return self._path.is_file()
        except OSError as error:
            log.warning(
                "it is not known whether the board ran our firmware", path=str(self._path), error=str(error)
            )
            return False

    def keep(self, *, is_ours: bool) -> None:
        """Write or remove it, in a thread: a disk may be slow."""
        DEVICE_THREADS.submit(self.store, is_ours)

    def store(self, is_ours: bool) -> None:
        """Write or remove it now; that it cannot be is logged."""
        try:
            if not is_ours:
                with contextlib.suppress(FileNotFoundError):
                    self._path.unlink()
                return
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with create_file(self._path) as file:
                file.write(f"{self._device}\n".encode())
        except OSError as error:
            log.warning(
                "it is not kept for the next start that the board runs our firmware",
                path=str(self._path),
                error=str(error),
            )
