"""Who has a device: read from /proc, so that a second daemon can name the first.

The kernel lists every lock with its process for everybody to read; which files another user's process has open is only
for root. So a daemon is found by its lock, and any other program where we may look.
"""

import os
from collections.abc import Iterator
from pathlib import Path

PROC = Path("/proc")
UNKNOWN = "an unknown process"


def owner_of(device: str, proc: Path = PROC) -> str:
    """The programs and pids that hold the device open or locked, for people; symlinks are followed."""
    owners = sorted({*_lockers(device, proc), *_openers(device, proc)} - {os.getpid()})
    if not owners:
        return UNKNOWN
    return ", ".join(f"{_program(pid, proc)} (pid {pid})" for pid in owners)


def _lockers(device: str, proc: Path) -> Iterator[int]:
    """Lines read ``1: FLOCK ADVISORY WRITE <pid> <device major:minor:inode> 0 EOF``, the device in hexadecimal."""
    status = Path(device).stat()
    file = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"
    for line in (proc / "locks").read_text().splitlines():
        fields = line.split()
        if file in fields[5:6]:
            yield int(fields[4])


def _openers(device: str, proc: Path) -> Iterator[int]:
    real = os.path.realpath(device)
    for process in proc.iterdir():
        if process.name.isdecimal() and real in _open_files(process):
            yield int(process.name)


def _open_files(process: Path) -> Iterator[str]:
    """Processes and files come and go while we look, and some are not for us to see."""
    try:
        for descriptor in (process / "fd").iterdir():
            yield str(descriptor.readlink())
    except OSError:
        return


def _program(pid: int, proc: Path) -> str:
    try:
        return (proc / str(pid) / "comm").read_text().strip()
    except OSError:
        return UNKNOWN
