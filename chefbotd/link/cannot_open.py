"""Why a port cannot be opened: there is none, it is not for us to use, or another program has it.

The kernel lists every lock with its process for everybody to read; which files another user's process has open is only
for root. So a daemon is found by its lock, and any other program where we may look.
"""

import errno
import grp
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from serial.tools import list_ports

from chefbotd.core.sentence import Sentence

BY_ID = Path("/dev/serial/by-id")
"""Names that stay the same whichever socket a cable is plugged into; udev makes them."""

PROC = Path("/proc")
PTS_MAJORS = range(136, 144)
"""The kernel's numbers of pseudo-terminals (its devices.txt)."""

UNKNOWN = "an unknown process"


def advice(device: str, error: OSError, by_id: Path = BY_ID) -> str:
    """What keeps ``device`` from being opened, and what to do about it."""
    if error.errno == errno.ENOENT:
        return Sentence("board.no_device", "there is no such device; {ports}", ports=ports_there(by_id))
    if error.errno in (errno.EACCES, errno.EPERM):
        return Sentence(
            "board.no_permission", "permission denied; {advice}", advice=permission_advice(device)
        )
    return str(error)


def ports_there(by_id: Path = BY_ID) -> str:
    """The serial ports of this computer, by their lasting names where they have any."""
    names = names_by_device(by_id)
    devices = sorted(port.device for port in list_ports.comports())
    if not devices:
        return Sentence("board.no_port", "no serial port was found: is the board plugged in and powered?")
    ports = [f"{names[Path(port)]} ({port})" if Path(port) in names else port for port in devices]
    return Sentence("board.ports", "available serial ports: {ports}", ports=", ".join(ports))


def permission_advice(device: str) -> str:
    """Which group may open a device, and how to get into it."""
    try:
        status = Path(device).stat()
        group = grp.getgrgid(status.st_gid).gr_name
    except (OSError, KeyError):
        return "is this user allowed to use it?"
    if status.st_gid in os.getgroups() or group == "root":
        return f"{device} does not allow your group {group} to read and write: check its udev rule"
    return (
        f"only members of the group {group} may use it: run 'sudo usermod -aG {group} $USER', then log out and in again "
        f"(a service: SupplementaryGroups={group})"
    )


def names_by_device(by_id: Path = BY_ID) -> dict[Path, str]:
    """The lasting name of each port that has one."""
    try:
        return {path.resolve(): str(path) for path in sorted(by_id.iterdir())}
    except OSError:
        return {}


def owner_of(device: str, proc: Path = PROC) -> str:
    """The programs and pids that hold the device open or locked, for people; symlinks are followed."""
    return _name_processes(owners_of(device, proc), proc) or UNKNOWN


def owners_of(device: str, proc: Path = PROC) -> list[int]:
    """The processes, ours left out, that hold the device open or locked, as far as we may see.

    Raises:
        OSError: there is no such device.
    """
    return sorted({*_lockers(device, proc), *_openers(device, proc)} - {os.getpid()})


MEDDLERS = {
    "ModemManager": "which opens serial ports to look for modems: the udev rule of docs/service.md tells it off",
    "brltty": "which takes USB adapters for Braille displays: 'sudo apt remove brltty', where nobody needs one",
}
"""Programs that open ports of their own accord, and what to do about each."""


class Sharers(NamedTuple):
    """Who else reads a port that we have open, and who may do so, both for people; empty: nobody.

    Of another user's process only root sees the files. So programs that are known to open every port are ``suspects``
    where they run.
    """

    seen: str = ""
    suspects: str = ""


def sharers_of(device: str, proc: Path = PROC) -> Sharers:
    """Look through the processes; ours and those that it has started do not count."""
    try:
        sharers = [pid for pid in owners_of(device, proc) if _parent(pid, proc) != os.getpid()]
    except OSError:
        return Sharers()
    if sharers:
        remedies = {advice for pid in sharers if (advice := MEDDLERS.get(_program(pid, proc)))}
        does = f", {remedies.pop()}" if len(remedies) == 1 else ""
        seen = f"{_name_processes(sharers, proc)} has {device} open too{does}: two readers each get a part of the bytes"
        return Sharers(seen=seen)
    suspects = [f"{name} (pid {pid}) runs here, {MEDDLERS[name]}" for pid, name in _meddlers(proc)]
    return Sharers(suspects="; ".join(suspects))


def _meddlers(proc: Path) -> list[tuple[int, str]]:
    named = (
        (int(entry.name), _program(int(entry.name), proc))
        for entry in proc.iterdir()
        if entry.name.isdecimal()
    )
    return sorted((pid, name) for pid, name in named if name in MEDDLERS)


def _parent(pid: int, proc: Path) -> int:
    """The process that started it; 0 where that cannot be told."""
    try:
        fields = (proc / str(pid) / "stat").read_text().rpartition(")")[2].split()
        return int(fields[1])
    except (OSError, IndexError, ValueError):
        return 0


def _name_processes(pids: list[int], proc: Path) -> str:
    return ", ".join(f"{_program(pid, proc)} (pid {pid})" for pid in pids)


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
        if process.name.isdecimal() and any(_is_same(real, file) for file in _open_files(process, real)):
            yield int(process.name)


def _open_files(process: Path, real: str) -> Iterator[Path]:
    """Those of this name. Processes and files come and go while we look, and some are not for us to see."""
    try:
        for descriptor in (process / "fd").iterdir():
            if str(descriptor.readlink()) == real:
                yield descriptor
    except OSError:
        return


def _is_same(real: str, descriptor: Path) -> bool:
    """Whether this is the same file for us: a sandboxed service may have other pseudo-terminals of the same names."""
    try:
        ours, theirs = Path(real).stat(), descriptor.stat()
    except OSError:
        return True
    if stat.S_ISCHR(ours.st_mode) and os.major(ours.st_rdev) not in PTS_MAJORS:
        return ours.st_rdev == theirs.st_rdev
    return (ours.st_dev, ours.st_ino) == (theirs.st_dev, theirs.st_ino)


def _program(pid: int, proc: Path) -> str:
    try:
        return (proc / str(pid) / "comm").read_text().strip()
    except OSError:
        return UNKNOWN
